//! What a look at a survey found.

use crate::Project;
use serde::{Deserialize, Serialize};
use std::fmt::Write;
use stonewise_base::messages::{Said, Translations};

/// What a finding means for a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// As it should be.
    Fine,
    /// Worth knowing.
    Note,
    /// The results may be wrong: a run goes on and ends with exit code 3.
    Doubt,
    /// The results would be wrong: a run stops, unless it is forced.
    Wrong,
    /// An input cannot be read: a run ends.
    Unreadable,
}

impl Verdict {
    /// The word in tables.
    pub fn word(self) -> &'static str {
        match self {
            Self::Fine => "ok",
            Self::Note => "note",
            Self::Doubt => "DOUBT",
            Self::Wrong => "WRONG",
            Self::Unreadable => "ERROR",
        }
    }
}

/// One line of the table.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Finding {
    /// Name of the epoch; empty where it is about all of them.
    pub epoch: String,
    /// What was looked at.
    pub topic: String,
    /// What it means.
    pub verdict: Verdict,
    /// Name under which `docs/src/messages.md` and `stonewise explain` say more of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub code: Option<String>,
    /// What was seen, and what to do about it.
    pub text: String,
    /// Topic and text in other languages, where these have words for both.
    #[serde(default, skip_serializing_if = "Translations::is_empty")]
    translations: Translations,
}

impl Finding {
    pub(super) fn new(epoch: &str, topic: impl Into<Said>, verdict: Verdict, text: impl Into<Said>) -> Self {
        let (topic, text) = (topic.into(), text.into());
        let translations = Said::about(&topic, &text).translations;
        Self {
            epoch: epoch.to_owned(),
            topic: topic.english,
            verdict,
            code: text.code,
            text: text.english,
            translations,
        }
    }

    /// Topic and text in one sentence.
    pub fn said(&self) -> Said {
        Said {
            code: self.code.clone(),
            english: format!("{}: {}", self.topic, self.text),
            translations: self.translations.clone(),
        }
    }
}

/// A picture for people: a photo with the edges of the cloud.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// What it shows.
    pub(super) caption: String,
    /// JPEG.
    pub(super) jpeg: Vec<u8>,
}

/// Everything that a look found.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Report {
    /// The lines of the table: about all epochs first, then epoch by epoch.
    pub findings: Vec<Finding>,
    #[serde(skip)]
    pub(super) pictures: Vec<Picture>,
}

impl Report {
    /// The gravest verdict.
    pub fn verdict(&self) -> Verdict {
        let verdicts = self.findings.iter().map(|f| f.verdict);
        verdicts.max().unwrap_or(Verdict::Fine)
    }

    /// Lines that are graver than a note.
    pub fn doubtful(&self) -> impl Iterator<Item = &Finding> {
        self.findings.iter().filter(|f| f.verdict >= Verdict::Doubt)
    }

    /// The table as text.
    pub fn text(&self) -> String {
        let wide = |of: fn(&Finding) -> &str| self.findings.iter().map(|f| of(f).chars().count()).max();
        let epochs = wide(|f| f.epoch.as_str()).unwrap_or(0).max(3);
        let topics = wide(|f| f.topic.as_str()).unwrap_or(0);
        let mut text = String::new();
        for f in &self.findings {
            let epoch = if f.epoch.is_empty() { "all" } else { &f.epoch };
            let _ = write!(
                text,
                "{epoch:epochs$}  {:topics$}  {:5}  {}",
                f.topic,
                f.verdict.word(),
                f.text
            );
            // A line that finds nothing wrong needs no explanation.
            if let Some(code) = f.code.as_ref().filter(|_| f.verdict > Verdict::Fine) {
                let _ = write!(text, " [{code}]");
            }
            text.push('\n');
        }
        text
    }

    pub(super) fn sort(&mut self, project: &Project) {
        let place = |f: &Finding| {
            project
                .epochs
                .iter()
                .position(|e| e.name == f.epoch)
                .map_or(0, |i| i + 1)
        };
        self.findings.sort_by_key(place);
    }
}
