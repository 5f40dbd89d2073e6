//! The languages of the texts, and the files that hold them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::sync::LazyLock;

/// Declares the languages: a name, and the tag of BCP 47, after which the file in `texts/` is named.
macro_rules! languages {
    ($($(#[$meta:meta])* $name:ident = $tag:literal;)*) => {
        /// A language of the texts.
        #[derive(
            Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
        )]
        pub enum Language {
            $($(#[$meta])* #[serde(rename = $tag)] $name,)*
        }

        impl Language {
            /// All languages.
            pub const ALL: [Self; [$($tag),*].len()] = [$(Self::$name),*];

            /// The tag of BCP 47.
            pub fn tag(self) -> &'static str {
                match self {
                    $(Self::$name => $tag,)*
                }
            }

            fn file(self) -> &'static str {
                match self {
                    $(Self::$name => include_str!(concat!("../texts/", $tag, ".toml")),)*
                }
            }
        }
    };
}

languages! {
    #[doc = "English."] #[default] English = "en";
    #[doc = "German."] German = "de";
    #[doc = "French."] French = "fr";
}

/// The files of texts; a test reads them.
static FILES: LazyLock<[Value; Language::ALL.len()]> =
    LazyLock::new(|| Language::ALL.map(|language| toml::from_str(language.file()).unwrap_or_default()));

impl Language {
    /// The text under a dotted key; empty where there is none.
    pub fn text(self, key: &str) -> &'static str {
        self.at(key).and_then(Value::as_str).unwrap_or_default()
    }

    /// What stands under a dotted key, as a type; the default where it does not fit, which tests rule out.
    pub fn read<T: Deserialize<'static> + Default>(self, key: &str) -> T {
        let read = self.at(key).and_then(|value| T::deserialize(value).ok());
        read.unwrap_or_default()
    }

    fn at(self, key: &str) -> Option<&'static Value> {
        key.split('.')
            .try_fold(&FILES[self as usize], |value, part| value.get(part))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::{BTreeMap, BTreeSet};

    /// Every text by its key.
    fn flat(value: &Value, key: &str, out: &mut BTreeMap<String, String>) {
        match value {
            Value::Object(table) => table
                .iter()
                .for_each(|(name, value)| flat(value, &format!("{key}.{name}"), out)),
            Value::Array(list) => list
                .iter()
                .zip(0..)
                .for_each(|(value, i)| flat(value, &format!("{key}.{i}"), out)),
            Value::String(text) => drop(out.insert(key.to_owned(), text.clone())),
            other => drop(out.insert(key.to_owned(), other.to_string())),
        }
    }

    fn holes(text: &str) -> BTreeSet<&str> {
        let after = text.split('{').skip(1);
        after.filter_map(|t| Some(t.split_once('}')?.0)).collect()
    }

    #[test]
    fn every_language_has_the_same_keys_and_the_same_holes() {
        let [english, others @ ..] = Language::ALL.map(|language| {
            let value: Value = toml::from_str(language.file()).unwrap();
            let mut texts = BTreeMap::new();
            flat(&value, "", &mut texts);
            (language, texts)
        });
        for (language, texts) in others {
            let keys: Vec<&String> = texts.keys().collect();
            assert_eq!(keys, english.1.keys().collect::<Vec<_>>(), "{}", language.tag());
            for (key, text) in &texts {
                assert!(!text.is_empty(), "{key} in {}", language.tag());
                assert_eq!(holes(text), holes(&english.1[key]), "{key} in {}", language.tag());
            }
        }
    }

    #[test]
    fn texts_are_found_by_their_dotted_keys() {
        assert_eq!(Language::German.text("messages.feet"), "Fuß");
        assert_eq!(Language::English.text("messages.nothing.of_the_kind"), "");
        assert!(Language::German.read::<bool>("language.capital_nouns"));
    }
}
