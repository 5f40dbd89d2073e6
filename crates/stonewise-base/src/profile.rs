//! The order and the words of a report, as a small file that a firm copies and changes.

use crate::error::{Error, Result};
use crate::files::{is_there, read_json, read_parameters};
use crate::language::Language;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// The profiles that the program brings, by name.
const SHIPPED: [(&str, &str); 2] = [
    ("plain", include_str!("../profiles/plain.toml")),
    ("din19700", include_str!("../profiles/din19700.toml")),
];

/// Texts that say the verdict, which is the same under every profile.
const OF_THE_VERDICT: [&str; 2] = ["states", "clauses"];

/// Declares the chapters of a document by their names in files.
macro_rules! chapters {
    ($($(#[$of:meta])* $kind:ident { $($(#[$doc:meta])* $chapter:ident = $name:literal,)* })*) => {$(
        $(#[$of])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
        pub enum $kind {
            $($(#[$doc])* #[serde(rename = $name)] $chapter,)*
        }

        impl $kind {
            /// The name in files.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$chapter => $name,)*
                }
            }
        }
    )*};
}

chapters! {
    /// A chapter of the report.
    Chapter {
        #[doc = "What moved, what to look at first, the place to sign."] Summary = "summary",
        #[doc = "The path over years."] Series = "series",
        #[doc = "Maps of the unrolled wall."] Maps = "maps",
        #[doc = "Tables of stones."] Tables = "tables",
        #[doc = "Histograms."] Distributions = "distributions",
        #[doc = "What is known about the datum."] Datum = "datum",
        #[doc = "Required and achieved accuracy, budget of the largest motion."] Accuracy = "accuracy",
        #[doc = "Comparison with other instruments."] Instruments = "instruments",
        #[doc = "What could put the results in doubt."] Checks = "checks",
        #[doc = "Score against a known motion."] Evaluation = "evaluation",
        #[doc = "Method, terms and limits."] Method = "method",
        #[doc = "Inputs, warnings, decisions, parameters."] Audit = "audit",
    }

    /// A chapter of the yearly report.
    YearlyChapter {
        #[doc = "What was measured and how."] Survey = "survey",
        #[doc = "Conditions of the epochs."] Conditions = "conditions",
        #[doc = "What moved."] Results = "results",
        #[doc = "The four answers about the series."] Prediction = "prediction",
        #[doc = "What the engineer makes of it."] Interpretation = "interpretation",
        #[doc = "What follows."] Conclusion = "conclusion",
        #[doc = "The place to sign."] Signature = "signature",
    }
}

/// The order and the words of a report.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// Chapters of the report in their order.
    pub chapters: Vec<Chapter>,
    /// Chapters that follow and can be left out on paper.
    #[serde(default)]
    pub appendix: Vec<Chapter>,
    /// Chapters of the yearly report in their order.
    pub yearly: Vec<YearlyChapter>,
    #[serde(default)]
    words: BTreeMap<Language, Value>,
}

impl Profile {
    /// The profile of this name that the program brings; `None` where a file is meant.
    pub fn shipped(name: &Path) -> Option<Self> {
        let (name, text) = SHIPPED.into_iter().find(|(known, _)| name == Path::new(known))?;
        Self::parse(Path::new(name), text).ok()
    }

    /// The order of the report without a profile.
    pub fn plain() -> Self {
        Self::shipped(Path::new("plain")).unwrap_or_default()
    }

    /// The names of the shipped profiles.
    pub fn names() -> String {
        SHIPPED.map(|(name, _)| name).join(", ")
    }

    /// Reads a profile of one's own.
    ///
    /// # Errors
    /// The file cannot be read; a chapter, a language or a text that does not exist, a chapter that stands
    /// twice, or a text of another form than the one it replaces. The error names the line and what is known.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(path, &read_parameters(path)?)
    }

    /// Reads a profile that a run kept with its results; `None` where there is no file.
    ///
    /// # Errors
    /// The file cannot be read, or does not hold what [`Self::read`] accepts.
    pub fn kept(path: &Path) -> Result<Option<Self>> {
        if !is_there(path)? {
            return Ok(None);
        }
        let profile: Self = read_json(path)?;
        match profile.misfit() {
            None => Ok(Some(profile)),
            Some((key, reason)) => Err(Error::results(path, format!("{key}: {reason}"))),
        }
    }

    fn parse(path: &Path, text: &str) -> Result<Self> {
        let profile: Self = toml::from_str(text).map_err(|error| Error::toml(path, text, &error))?;
        match profile.misfit() {
            None => Ok(profile),
            Some((key, reason)) => {
                let place = Error::place_in_toml(text, &key).start;
                Err(Error::in_text(path, text, place, format!("{key}: {reason}")))
            }
        }
    }

    /// The words that take the place of those of the report in this language: a tree like that of its texts.
    pub fn words(&self, language: Language) -> Option<&Value> {
        self.words.get(&language)
    }

    /// The key of what cannot be, and the reason.
    fn misfit(&self) -> Option<(String, String)> {
        let chapters = named("chapters", &self.chapters, Chapter::name);
        let appendix = named("appendix", &self.appendix, Chapter::name);
        let of_report: Vec<_> = chapters.into_iter().chain(appendix).collect();
        let of_year = named("yearly", &self.yearly, YearlyChapter::name);
        let of_words = || {
            self.words.iter().find_map(|(language, words)| {
                let mut texts: Value = language.read("report");
                if let Value::Object(texts) = &mut texts {
                    texts.retain(|group, _| !OF_THE_VERDICT.contains(&group.as_str()));
                }
                misfit(words, &texts, &format!("words.{}", language.tag()))
            })
        };
        repeated(&of_report)
            .or_else(|| repeated(&of_year))
            .or_else(of_words)
    }
}

/// The names of a list with their keys.
fn named<T: Copy>(list: &str, chapters: &[T], name: fn(T) -> &'static str) -> Vec<(String, &'static str)> {
    let keys = (0..chapters.len()).map(|i| format!("{list}.{i}"));
    keys.zip(chapters.iter().map(|chapter| name(*chapter))).collect()
}

fn repeated(chapters: &[(String, &str)]) -> Option<(String, String)> {
    let again =
        (0..chapters.len()).find(|&i| chapters[..i].iter().any(|(_, name)| *name == chapters[i].1))?;
    let (key, name) = &chapters[again];
    Some((
        key.clone(),
        format!("{name:?} stands twice: name each chapter once"),
    ))
}

/// Where words do not fit the texts that they replace, and why.
fn misfit(words: &Value, texts: &Value, key: &str) -> Option<(String, String)> {
    let inner = |name: &str, word: &Value, text: &Value| misfit(word, text, &format!("{key}.{name}"));
    let reason = match (words, texts) {
        (Value::Object(words), Value::Object(texts)) => {
            return words.iter().find_map(|(name, word)| match texts.get(name) {
                Some(text) => inner(name, word, text),
                None => {
                    let known: Vec<&str> = texts.keys().map(String::as_str).collect();
                    let reason = format!("there is no such text, but {}", known.join(", "));
                    Some((format!("{key}.{name}"), reason))
                }
            });
        }
        (Value::Array(words), Value::Array(texts)) if words.len() == texts.len() => {
            let mut pairs = words.iter().zip(texts).enumerate();
            return pairs.find_map(|(i, (word, text))| inner(&i.to_string(), word, text));
        }
        (Value::String(word), Value::String(text)) => {
            let unknown = holes(word).find(|hole| !holes(text).any(|known| known == *hole));
            match unknown {
                Some(hole) => {
                    let known: Vec<String> = holes(text).map(|known| format!("{{{known}}}")).collect();
                    format!("nothing fills {{{hole}}} in; known here: [{}]", known.join(", "))
                }
                None if word.contains('<') && !text.contains('<') => {
                    "this text takes no HTML: write it without <".to_owned()
                }
                None => return None,
            }
        }
        (_, Value::Object(_)) => "this must be a table of texts".to_owned(),
        (_, Value::Array(texts)) => format!("this must be a list of {}", texts.len()),
        _ => "this must be a text".to_owned(),
    };
    Some((key.to_owned(), reason))
}

/// What is filled into a text, by name.
fn holes(text: &str) -> impl Iterator<Item = &str> {
    let after = text.split('{').skip(1);
    after.filter_map(|rest| Some(rest.split_once('}')?.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_profiles_hold() {
        for (name, text) in SHIPPED {
            let profile = Profile::parse(Path::new(name), text).unwrap();
            assert_eq!(Profile::shipped(Path::new(name)), Some(profile));
        }
        assert_eq!(Profile::shipped(Path::new("plain.toml")), None);
    }

    #[test]
    fn errors_name_the_line_the_key_and_what_is_known() {
        let head = "chapters = [\"summary\"]\nyearly = [\"survey\"]\n";
        for (text, line, words) in [
            (
                "chapters = [\n\"summary\",\n\"sumary\"]\nyearly = []\n".to_owned(),
                3,
                "`summary`, `series`, `maps`",
            ),
            (
                "chapters = [\"maps\"]\nappendix = [\"maps\"]\nyearly = []\n".to_owned(),
                2,
                "appendix.0: \"maps\" stands twice",
            ),
            (
                "chapters = []\nyearly = [\"results\",\n\"results\"]\n".to_owned(),
                3,
                "yearly.1: \"results\" stands twice",
            ),
            (
                format!("{head}chapter = []\n"),
                3,
                "expected one of `chapters`, `appendix`, `yearly`, `words`",
            ),
            ("chapters = []\n".to_owned(), 1, "missing field `yearly`"),
            (
                format!("{head}[words.it.page]\nkind = \"x\"\n"),
                3,
                "`en`, `de`, `fr`",
            ),
            (
                format!("{head}[words.en.sections]\nmaps = \"x\"\nmap = \"x\"\n"),
                5,
                "words.en.sections.map: there is no such text, but audit, ",
            ),
            (
                format!("{head}[words.en.states]\nfine = \"Good\"\n"),
                3,
                "words.en.states: there is no such text, but ",
            ),
            (
                format!("{head}[words.de.yearly]\nconclusions = [\"x\"]\n"),
                4,
                "this must be a list of 4",
            ),
            (
                format!("{head}[words.de.page]\nkind = 3\n"),
                4,
                "words.de.page.kind: this must be a text",
            ),
            (
                format!("{head}[words.de]\npage = 3\n"),
                4,
                "words.de.page: this must be a table of texts",
            ),
            (
                format!("{head}[words.de.yearly]\nof = \"{{n}} / {{all}}\"\n"),
                4,
                "nothing fills {all} in; known here: [{n}, {m}]",
            ),
            (
                format!("{head}[words.en.page]\nkind = \"<b>\"\n"),
                4,
                "takes no HTML",
            ),
        ] {
            let message = Profile::parse(Path::new("ours.toml"), &text)
                .unwrap_err()
                .to_string();
            assert!(
                message.starts_with(&format!("ours.toml:{line}: ")) && message.contains(words),
                "{words}: {message}"
            );
        }
    }
}
