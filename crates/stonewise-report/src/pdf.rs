//! The report as PDF.

use super::browser::Browser;
use super::page::{printed, yearly};
use super::summary::Summary;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use stonewise_base::error::Error;
use stonewise_core::progress::Progress;
use stonewise_io::atomic::write_atomically;
use stonewise_results::ResultSet;

/// A comment behind the end of the file, by which a later call recognises that it may replace the file.
const MARK: &str = "% made by stonewise report\n";

/// A report as PDF: the browser that prints it, and the file that it may become.
#[derive(Debug)]
pub struct Pdf {
    path: PathBuf,
    browser: Browser,
}

impl Pdf {
    /// Looks whether a PDF can be made here. `replace`: also over a file that this program did not make.
    ///
    /// # Errors
    /// No browser is installed; there is no such folder, or the file exists and comes from elsewhere.
    pub fn at(path: &Path, replace: bool) -> Result<Self, Error> {
        let refused = |message: &str| {
            Err(Error::Output {
                path: path.to_path_buf(),
                message: message.to_owned(),
            })
        };
        if path.is_dir() {
            return refused("this is a folder; give the name of a file");
        }
        if !replace && path.exists() && !is_ours(path) {
            return refused(
                "this file was not made by `stonewise report`; give another name, or --force to replace it",
            );
        }
        match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() && !folder.is_dir() => {
                refused("the folder of this file does not exist; make it first")
            }
            _ => Ok(Self {
                path: path.to_path_buf(),
                browser: Browser::find()?,
            }),
        }
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Prints the report on the results in `dir`, A4; `appendix`: with parameters, digests and decisions
    /// about masks at the end.
    ///
    /// Every later epoch has its own part, with project, epochs and date at the foot of each page. The file
    /// appears whole or not at all.
    ///
    /// # Errors
    /// `dir` holds no results, the browser fails, the file cannot be written, or the caller stopped the work.
    pub fn write(&self, dir: &Path, appendix: bool, progress: &dyn Progress) -> Result<(), Error> {
        let first = ResultSet::read(dir)?;
        let later: Vec<ResultSet> = (2..=first.pairs)
            .map(|pair| ResultSet::read_pair(dir, pair))
            .collect::<Result<_, _>>()?;
        let all: Vec<&ResultSet> = std::iter::once(&first).chain(&later).collect();
        self.print(&printed(&all, appendix), progress)
    }

    /// Prints the part of the yearly safety report on measurements, A4.
    ///
    /// # Errors
    /// As [`Self::write`]; there are only two epochs.
    pub fn write_yearly(&self, dir: &Path, progress: &dyn Progress) -> Result<(), Error> {
        let pairs = ResultSet::read(dir)?.pairs;
        let newest = ResultSet::read_pair(dir, pairs)?;
        let page = yearly(&newest, &Summary::new(&newest))
            .ok_or_else(|| Error::Parameters("--yearly needs results of more than two epochs".to_owned()))?;
        self.print(&page, progress)
    }

    fn print(&self, page: &str, progress: &dyn Progress) -> Result<(), Error> {
        let mut failure = None;
        let written = write_atomically(&self.path, |partial| {
            print_page(&self.browser, page, partial, progress).map_err(|error| {
                failure = Some(error);
                std::io::Error::other("the browser failed")
            })
        });
        written.map_err(|error| failure.unwrap_or_else(|| Error::io("writing the PDF", &self.path)(error)))
    }
}

/// Prints the page to the file `to`, marked as ours.
fn print_page(browser: &Browser, page: &str, to: &Path, progress: &dyn Progress) -> Result<(), Error> {
    let folder = Scratch::beside(to)?;
    let html = folder.0.join("report.html");
    fs::write(&html, page).map_err(Error::io("writing", &html))?;
    progress.begin("print the report", 0);
    // The browser may have another working folder, so paths are absolute, and it gets a name that ends in .pdf.
    let printed = folder.0.join("report.pdf");
    let [html, pdf] = [&html, &printed].map(|p| std::path::absolute(p).unwrap_or_else(|_| p.clone()));
    let profile = std::path::absolute(&folder.0).unwrap_or_else(|_| folder.0.clone());
    browser.print(&html, &pdf, &profile, progress)?;
    fs::rename(&printed, to).map_err(Error::io("writing the PDF", to))?;
    let marked = fs::File::options()
        .append(true)
        .open(to)
        .and_then(|mut file| file.write_all(MARK.as_bytes()));
    marked.map_err(Error::io("writing the PDF", to))
}

/// Whether an earlier call made this file.
fn is_ours(path: &Path) -> bool {
    fs::read(path).is_ok_and(|bytes| bytes.ends_with(MARK.as_bytes()))
}

/// A folder that goes when the work is done.
struct Scratch(PathBuf);

impl Scratch {
    fn beside(partial: &Path) -> Result<Self, Error> {
        let mut name = partial.file_name().unwrap_or_default().to_owned();
        name.push(".d");
        let path = partial.with_file_name(name);
        fs::create_dir(&path).map_err(Error::io("making the folder", &path))?;
        Ok(Self(path))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // Nothing can be done about a failure here.
        let _ = fs::remove_dir_all(&self.0);
    }
}
