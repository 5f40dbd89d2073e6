//! A sentence with words left open, in every language.

use super::Said;
use super::braces::fill;
use crate::report_params::Language;

/// A sentence, or words of one, that the files of texts hold under `messages`; words in braces are filled in.
#[derive(Debug)]
pub struct Message {
    /// Name under which `docs/src/messages.md` explains it; absent for words that are part of a sentence.
    pub code: Option<&'static str>,
    /// Its key, in capitals.
    name: &'static str,
}

impl Message {
    pub(super) const fn new(name: &'static str, code: Option<&'static str>) -> Self {
        Self { code, name }
    }

    /// The sentence with these values: names and counts as they are ([`Said::from`]), numbers with decimals
    /// ([`Said::numbers`]), other messages.
    pub fn say(&self, values: &[(&str, Said)]) -> Said {
        let key = format!("messages.{}", self.name.to_ascii_lowercase());
        let in_language = |language: Language| {
            let values: Vec<(&str, &str)> =
                values.iter().map(|(name, v)| (*name, v.text(language))).collect();
            fill(language.text(&key), &values)
        };
        Said {
            code: self.code.map(str::to_owned),
            ..Said::in_each(in_language)
        }
    }
}

impl From<&Message> for Said {
    fn from(message: &Message) -> Self {
        message.say(&[])
    }
}

/// Declares messages, each with its code if it is a sentence of its own, and, for tests, the list of all of them.
macro_rules! messages {
    ($all:ident { $($name:ident $(= $code:literal)?,)* }) => {
        $(
            /// The message of this name in the files of texts.
            pub static $name: Message = Message::new(stringify!($name), messages!(@code $($code)?));
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
    use crate::messages::findings::{DEGREES, FEET, FINDINGS, SYSTEM_UNIT, TOO_SMALL};
    use crate::messages::notices::{AREA_OFF_WALL, NOTICES, STABLE_MOVED};
    use crate::messages::{doubts::DOUBTS, remarks::REMARKS};
    use std::collections::{BTreeMap, BTreeSet};

    /// A key without a message would never be said, a message without a key would say nothing.
    #[test]
    fn the_files_hold_the_messages_and_nothing_else() {
        let keys: BTreeMap<String, String> = Language::English.read("messages");
        let all = [DOUBTS, FINDINGS, NOTICES, REMARKS].concat();
        let names: BTreeSet<String> = all.iter().map(|m| m.name.to_ascii_lowercase()).collect();
        assert_eq!(names.len(), all.len());
        assert_eq!(names, keys.into_keys().collect());
    }

    #[test]
    fn languages_differ() {
        for message in [DOUBTS, FINDINGS, NOTICES, REMARKS].concat() {
            let said = Said::from(message);
            for (language, text) in &said.translations {
                assert_ne!(*text, said.english, "{} in {}", message.name, language.tag());
            }
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
        let place = Said::list(&["1.0".to_owned(), "-2.0".to_owned()]);
        let area = AREA_OFF_WALL.say(&[("place", place)]);
        let said = STABLE_MOVED.say(&[("area", area)]);
        assert_eq!(
            said.english,
            "the area off the wall around (1.0, -2.0) moved against the other stable areas and is left out"
        );
        assert_eq!(
            said.text(Language::German),
            "die Fläche neben der Mauer um (1,0; -2,0) hat sich gegen die anderen stabilen Flächen bewegt und ist weggelassen"
        );
        let size = ["x", "y", "z"].map(|axis| (axis, Said::numbers("2.5".to_owned())));
        let small = TOO_SMALL.say(&[&size[..], &[("points", "7".into())]].concat());
        assert!(
            small
                .text(Language::German)
                .starts_with("2,5 x 2,5 x 2,5 m, 7 Punkte")
        );

        // Names have no translation, and half of one would be worse than none.
        let unit = SYSTEM_UNIT.say(&[("unit", (&FEET).into())]);
        assert_eq!(Said::about(&Said::from("units"), &unit).translations.len(), 0);
        let both = Said::about(&Said::from(&DEGREES), &unit);
        assert!(
            both.text(Language::German)
                .starts_with("Grad: das Koordinatensystem")
        );
        assert_eq!(both.code, unit.code);
    }
}
