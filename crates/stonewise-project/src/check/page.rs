//! The look as a page.

use super::{Report, Verdict};
use crate::Project;
use std::path::Path;
use stonewise_base::error::Result;
use stonewise_base::files::write_text;
use stonewise_figure::{Page, jpeg_element, words};

impl Report {
    /// Writes the table with its pictures as one HTML page.
    ///
    /// # Errors
    /// The page cannot be written.
    pub fn write_page(&self, path: &Path, project: &Project) -> Result<()> {
        write_text(path, &self.page(project))
    }

    /// The table with its pictures as one HTML page.
    pub fn page(&self, project: &Project) -> String {
        let mut page = Page::new(&format!("{}: a look at the survey", project.name));
        page.note(match self.verdict() {
            Verdict::Fine => "Nothing speaks against running this project.",
            Verdict::Note => "Nothing would stop a run: read the notes, and look at the pictures.",
            Verdict::Doubt => {
                "Some things are doubtful: a run goes on, and ends with exit code 3 where it finds the same."
            }
            Verdict::Wrong => "Something cannot be right: a run stops, unless --force is given.",
            Verdict::Unreadable => "An input cannot be read: a run ends with exit code 1.",
        });
        let rows: Vec<Vec<String>> = self
            .findings
            .iter()
            .map(|f| {
                let epoch = if f.epoch.is_empty() { "all" } else { &f.epoch };
                vec![
                    epoch.to_owned(),
                    f.topic.clone(),
                    f.verdict.word().to_owned(),
                    f.text.clone(),
                ]
            })
            .collect();

        page.html(&words(&["epoch", "what", "verdict", "finding"], &rows));
        if !self.pictures.is_empty() {
            page.heading("Cameras against clouds").note(
                "Each photo with the edges of the projected cloud in orange. Where camera and cloud belong together they lie on the \
                 joints and rims that the photo shows.",
            );
        }

        for picture in &self.pictures {
            page.figure(&picture.caption, &jpeg_element(&picture.jpeg, &picture.caption));
        }
        page.finish()
    }
}
