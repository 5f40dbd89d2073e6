//! A sentence with words left open, in both languages.

use super::Said;
use super::braces::fill;

/// A sentence in both languages; words in braces are filled in.
#[derive(Debug)]
pub struct Message {
    /// Name under which `docs/src/messages.md` explains it; absent for words that are part of a sentence.
    pub code: Option<&'static str>,
    /// The text in English, as a run prints it.
    pub english: &'static str,
    /// The text in German, as a German report prints it.
    pub german: &'static str,
}

impl Message {
    /// The sentence with these values: names and counts as they are ([`Said::from`]), numbers with decimals
    /// ([`Said::numbers`]), other messages.
    pub fn say(&self, values: &[(&str, Said)]) -> Said {
        let english: Vec<(&str, &str)> = values.iter().map(|(name, v)| (*name, &*v.english)).collect();
        let german: Vec<(&str, &str)> = values.iter().map(|(name, v)| (*name, v.in_german())).collect();
        Said {
            code: self.code.map(str::to_owned),
            english: fill(self.english, &english),
            german: Some(fill(self.german, &german)),
        }
    }
}

impl From<&Message> for Said {
    fn from(message: &Message) -> Self {
        message.say(&[])
    }
}

/// Declares messages and, for tests, the list of all of them: a name, the code if it is a sentence of its own, the
/// English and the German text of each.
macro_rules! messages {
    ($all:ident { $($name:ident $(= $code:literal)?: $english:expr, $german:expr;)* }) => {
        $(
            #[doc = $english]
            pub static $name: Message = Message {
                code: messages!(@code $($code)?),
                english: $english,
                german: $german,
            };
        )*

        #[cfg(test)]
        pub(super) static $all: &[&Message] = &[$(&$name),*];
    };
    (@code) => { None };
    (@code $code:literal) => { Some($code) };
}
pub(super) use messages;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::{doubts::DOUBTS, findings::FINDINGS, notices::NOTICES};
    use std::collections::BTreeSet;

    fn braces(text: &str) -> BTreeSet<&str> {
        text.split('{')
            .skip(1)
            .filter_map(|t| Some(t.split_once('}')?.0))
            .collect()
    }

    #[test]
    fn both_languages_leave_the_same_words_open_and_differ() {
        for message in [DOUBTS, FINDINGS, NOTICES].concat() {
            assert_eq!(
                braces(message.english),
                braces(message.german),
                "{}",
                message.english
            );
            assert_ne!(message.english, message.german);
        }
    }

    /// The page explains every message and every error, and nothing else.
    #[test]
    fn the_page_of_messages_explains_every_code() {
        let page = include_str!("../../../../docs/src/messages.md");
        let explained: BTreeSet<&str> = page
            .lines()
            .filter_map(|line| line.strip_prefix("### "))
            .collect();
        let of_messages = [DOUBTS, FINDINGS, NOTICES].concat();
        let of_messages = of_messages.iter().filter_map(|message| message.code);
        let of_errors = include_str!("../error.rs").lines();
        let of_errors = of_errors.filter_map(|line| line.split_once("=> \"")?.1.strip_suffix("\","));
        let said: BTreeSet<&str> = of_messages.chain(of_errors).collect();
        assert_eq!(explained, said);
    }

    #[test]
    fn numbers_and_sentences_are_those_of_the_language() {
        let message = Message {
            code: None,
            english: "{share} % of {file} are in {unit} at ({place})",
            german: "{share} % von {file} sind in {unit} bei ({place})",
        };
        let feet = Message {
            code: None,
            english: "feet",
            german: "Fuß",
        };
        let said = message.say(&[
            ("share", Said::numbers("2.5".to_owned())),
            ("file", "a.laz".into()),
            ("unit", Said::from(&feet)),
            ("place", Said::list(&["1.0".to_owned(), "-2.0".to_owned()])),
        ]);
        assert_eq!(said.english, "2.5 % of a.laz are in feet at (1.0, -2.0)");
        let german = "2,5 % von a.laz sind in Fuß bei (1,0; -2,0)";
        assert_eq!(said.german.as_deref(), Some(german));
        let units = Said::from("units");
        assert_eq!(Said::about(&units, &said).german, None);
        assert_eq!(
            Said::about(&Said::from(&feet), &said).german,
            Some(format!("Fuß: {german}"))
        );
    }
}
