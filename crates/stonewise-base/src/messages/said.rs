//! A sentence in the languages that there are words of it in.

use crate::report_params::Language;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;

/// A text in other languages than English.
pub type Translations = BTreeMap<Language, String>;

/// A sentence, or a value of one, that a run says in English and a report in its own language.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Said {
    /// Name under which `docs/src/messages.md` explains the sentence; absent for values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub code: Option<String>,
    /// The text in English, as a run prints it.
    pub english: String,
    /// The text in other languages, as reports print it; empty where there are no words but English ones.
    #[serde(default, skip_serializing_if = "Translations::is_empty")]
    pub translations: Translations,
}

impl Said {
    /// A text that every language has.
    pub fn in_each(text: impl Fn(Language) -> String) -> Self {
        let others = Language::ALL.into_iter().filter(|l| *l != Language::English);
        Self {
            code: None,
            english: text(Language::English),
            translations: others.map(|language| (language, text(language))).collect(),
        }
    }

    /// Numbers, given with a point before their decimals.
    pub fn numbers(numbers: String) -> Self {
        Self::in_each(|language| numbers.replace('.', language.text("language.decimal")))
    }

    /// Numbers one after the other, given likewise.
    pub fn list(numbers: &[String]) -> Self {
        Self::in_each(|language| {
            let numbers = numbers
                .iter()
                .map(|n| n.replace('.', language.text("language.decimal")));
            numbers.collect::<Vec<_>>().join(language.text("language.list"))
        })
    }

    /// The text in a language; in English where it has no words in this one.
    pub fn text(&self, language: Language) -> &str {
        self.translations.get(&language).unwrap_or(&self.english)
    }

    /// The sentence, and another behind it.
    #[must_use]
    pub fn and(mut self, other: impl Fn(Language) -> &'static str) -> Self {
        let add = |text: &mut String, language| *text += &format!(". {}", other(language));
        add(&mut self.english, Language::English);
        for (language, text) in &mut self.translations {
            add(text, *language);
        }
        self
    }

    /// What was looked at, and what was seen, with a colon between them; translated where both are.
    pub fn about(topic: &Self, text: &Self) -> Self {
        // Half a translation would be worse than none.
        let both = |(language, topic): (&Language, &String)| {
            let colon = language.text("language.colon");
            Some((
                *language,
                format!("{topic}{colon}{}", text.translations.get(language)?),
            ))
        };
        Self {
            code: text.code.clone(),
            english: format!("{}: {}", topic.english, text.english),
            translations: topic.translations.iter().filter_map(both).collect(),
        }
    }
}

/// What a record keeps of translations whose report is in this language.
pub fn recorded(mut translations: Translations, language: Language) -> Translations {
    translations.retain(|of, _| *of == language);
    translations
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
            translations: Translations::new(),
        }
    }
}

impl From<&str> for Said {
    fn from(english: &str) -> Self {
        english.to_owned().into()
    }
}
