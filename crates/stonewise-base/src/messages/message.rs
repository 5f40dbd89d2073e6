//! A sentence with words left open, in both languages.

use super::Said;
use super::braces::fill;

/// Values that are decimal numbers, written with a point.
const NUMBERS: [&str; 11] = [
    "error_mm", "excess", "found", "limit", "mean", "ratio", "share", "spacing", "x", "y", "z",
];

/// A sentence in both languages; words in braces are filled in.
#[derive(Debug)]
pub struct Message {
    /// As a run says it.
    pub english: &'static str,
    /// As a German report says it.
    pub german: &'static str,
}

impl Message {
    /// The sentence with these values, which are the same in all languages but for the mark before decimals.
    pub fn say(&self, values: &[(&str, &str)]) -> Said {
        self.say_with(values, &[])
    }

    /// The sentence with values that are sentences of their own, too; one without German words stays English.
    pub fn say_with(&self, values: &[(&str, &str)], said: &[(&str, &Said)]) -> Said {
        let decimal = |(name, value): &(&str, &str)| match NUMBERS.contains(name) {
            true => value.replace('.', ","),
            false => (*value).to_owned(),
        };
        let german: Vec<String> = values.iter().map(decimal).collect();
        let german = values
            .iter()
            .zip(&german)
            .map(|((name, _), value)| (*name, &**value));
        let nested_german = said
            .iter()
            .map(|(name, said)| (*name, said.german.as_deref().unwrap_or(&said.english)));
        let nested = said.iter().map(|(name, said)| (*name, &*said.english));
        let english: Vec<(&str, &str)> = values.iter().copied().chain(nested).collect();
        let german: Vec<(&str, &str)> = german.chain(nested_german).collect();
        Said {
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

/// Declares messages: a name, the English and the German text of each.
macro_rules! messages {
    ($($name:ident: $english:expr, $german:expr;)*) => {
        $(
            #[doc = $english]
            pub static $name: Message = Message { english: $english, german: $german };
        )*

        #[cfg(test)]
        pub(super) static ALL: &[&Message] = &[$(&$name),*];
    };
}
pub(super) use messages;

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    fn braces(text: &str) -> BTreeSet<&str> {
        text.split('{')
            .skip(1)
            .filter_map(|t| Some(t.split_once('}')?.0))
            .collect()
    }

    #[test]
    fn both_languages_leave_the_same_words_open_and_differ() {
        let all = [
            crate::messages::doubts::ALL,
            crate::messages::notices::ALL,
            crate::messages::findings::ALL,
        ]
        .concat();
        for message in all {
            assert_eq!(
                braces(message.english),
                braces(message.german),
                "{}",
                message.english
            );
            assert_ne!(message.english, message.german);
        }
    }

    #[test]
    fn numbers_and_sentences_are_those_of_the_language() {
        let message = Message {
            english: "{share} % of {file} are in {unit}",
            german: "{share} % von {file} sind in {unit}",
        };
        let feet = Message {
            english: "feet",
            german: "Fuß",
        };
        let said = message.say_with(
            &[("share", "2.5"), ("file", "a.laz")],
            &[("unit", &Said::from(&feet))],
        );
        assert_eq!(said.english, "2.5 % of a.laz are in feet");
        assert_eq!(said.german.as_deref(), Some("2,5 % von a.laz sind in Fuß"));
        let units = Said::from("units");
        assert_eq!(Said::about(&units, &said).german, None);
        assert_eq!(
            Said::about(&Said::from(&feet), &said).german.as_deref(),
            Some("Fuß: 2,5 % von a.laz sind in Fuß")
        );
    }
}
