//! What went wrong without stopping the run.

use crate::messages::{Said, Translations, recorded};
use crate::report_params::Language;
use serde::{Deserialize, Serialize};
use std::sync::{Mutex, PoisonError};

/// One thing that a user must be told.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Warning {
    /// The step that met it.
    pub step: String,
    /// The photo, camera, file or stone that it is about.
    pub subject: String,
    /// Name under which `docs/src/messages.md` and `stonewise explain` say more of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub code: Option<String>,
    /// What happened, and what to do about it.
    pub message: String,
    /// The message in other languages; in a record, only in that of its report.
    #[serde(default, skip_serializing_if = "Translations::is_empty")]
    pub translations: Translations,
    /// An input of the project was left out: the run ends with exit code 3.
    pub skipped_input: bool,
    /// The results as a whole cannot be relied on: the run ends with exit code 3, and says so before anything
    /// else.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub doubt: bool,
}

/// Collects warnings from all threads.
#[derive(Default)]
pub struct Warnings(Mutex<Vec<Warning>>);

impl Warning {
    fn new(step: &str, subject: impl Into<String>, message: impl Into<Said>) -> Self {
        let (subject, message) = (subject.into(), message.into());
        // Errors name their file first.
        let prefix = format!("{subject}: ");
        let without = |text: String| text.strip_prefix(&prefix).map(str::to_owned).unwrap_or(text);
        Self {
            step: step.into(),
            code: message.code,
            message: without(message.english),
            translations: message
                .translations
                .into_iter()
                .map(|(l, t)| (l, without(t)))
                .collect(),
            subject,
            skipped_input: false,
            doubt: false,
        }
    }

    /// Subject and message, in English where there are no words in this language.
    pub fn text(&self, language: Language) -> String {
        let message = self.translations.get(&language).unwrap_or(&self.message);
        format!("{}{}{message}", self.subject, language.text("language.colon"))
    }

    /// Subject, message and code in one line.
    pub fn line(&self, language: Language) -> String {
        let code = self.code.iter().map(|code| format!(" [{code}]"));
        format!("{}{}", self.text(language), code.collect::<String>())
    }
}

impl Warnings {
    /// Something worth knowing that left nothing out.
    pub fn notice(&self, step: &str, subject: impl Into<String>, message: impl Into<Said>) {
        self.push(Warning::new(step, subject, message));
    }

    /// An input was left out.
    pub fn skipped(&self, step: &str, subject: impl Into<String>, message: impl Into<Said>) {
        self.push(Warning {
            skipped_input: true,
            ..Warning::new(step, subject, message)
        });
    }

    /// The results as a whole cannot be relied on.
    pub fn doubt(&self, step: &str, subject: impl Into<String>, message: impl Into<Said>) {
        self.push(Warning {
            doubt: true,
            ..Warning::new(step, subject, message)
        });
    }

    /// Adds a warning that was made elsewhere, once.
    pub fn push(&self, warning: Warning) {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if !all.contains(&warning) {
            all.push(warning);
        }
    }

    /// The sorted warnings as the record of a run keeps them whose report is in this language.
    pub fn recorded(&self, language: Language) -> Vec<Warning> {
        let keep = |warning: Warning| Warning {
            translations: recorded(warning.translations, language),
            ..warning
        };
        self.sorted().into_iter().map(keep).collect()
    }

    /// All warnings so far, sorted, so that their order does not depend on threads.
    pub fn sorted(&self) -> Vec<Warning> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        all.sort();
        all
    }
}
