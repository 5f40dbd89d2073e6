//! A sentence in the languages that there are words of it in.

use crate::report_params::Language;
use serde::{Deserialize, Serialize};
use std::fmt;

/// A sentence, or a value of one, that a run says in English and a report in its own language.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Said {
    /// Name under which `docs/src/messages.md` explains the sentence; absent for values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub code: Option<String>,
    /// The text in English, as a run prints it.
    pub english: String,
    /// The text in German, as a German report prints it; absent where there are no German words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub german: Option<String>,
}

impl Said {
    /// Numbers, written with a point before their decimals, which is a comma in German.
    pub fn numbers(english: String) -> Self {
        Self {
            code: None,
            german: Some(english.replace('.', ",")),
            english,
        }
    }

    /// Numbers one after the other: German, whose numbers hold commas, has semicolons between them.
    pub fn list(numbers: &[String]) -> Self {
        Self {
            code: None,
            english: numbers.join(", "),
            german: Some(numbers.join("; ").replace('.', ",")),
        }
    }

    /// The text of a report in German; in English where there are no German words.
    pub fn in_german(&self) -> &str {
        self.german.as_deref().unwrap_or(&self.english)
    }

    /// The German sentence, where a report is in German.
    pub fn german_in(german: Option<String>, language: Language) -> Option<String> {
        german.filter(|_| language == Language::German)
    }

    /// The sentence, and another behind it, in English and in German.
    #[must_use]
    pub fn and(self, [english, german]: [&str; 2]) -> Self {
        Self {
            code: self.code,
            english: format!("{}. {english}", self.english),
            german: self.german.map(|said| format!("{said}. {german}")),
        }
    }

    /// What was looked at, and what was seen, with a colon between them; in German where both are.
    pub fn about(topic: &Self, text: &Self) -> Self {
        let german = topic.german.as_ref().zip(text.german.as_ref());
        Self {
            code: text.code.clone(),
            english: format!("{}: {}", topic.english, text.english),
            // Half a translation would be worse than none.
            german: german.map(|(topic, text)| format!("{topic}: {text}")),
        }
    }
}

impl fmt::Display for Said {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.english)
    }
}

impl From<String> for Said {
    fn from(english: String) -> Self {
        Self {
            code: None,
            english,
            german: None,
        }
    }
}

impl From<&str> for Said {
    fn from(english: &str) -> Self {
        english.to_owned().into()
    }
}
