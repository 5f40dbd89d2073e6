//! The words of a command line.

use std::str::FromStr;

/// Words in their order: names, and `KEY=VALUE`.
#[derive(Clone, Debug)]
pub struct Words(Vec<String>);

impl Words {
    /// The name of the program that is to be run, and what follows it.
    pub fn of_this_program() -> (String, Self) {
        let mut words = std::env::args().skip(1);
        (words.next().unwrap_or_default(), Self(words.collect()))
    }

    pub fn as_slice(&self) -> &[String] {
        &self.0
    }

    /// What stands behind `KEY=`, or another prefix.
    pub fn after(&self, prefix: &str) -> Option<&str> {
        self.0.iter().find_map(|w| w.strip_prefix(prefix))
    }

    /// The word behind an option such as `--out`.
    pub fn option(&self, option: &str) -> Option<&str> {
        let at = self.0.iter().position(|w| w == option)?;
        self.0.get(at + 1).map(String::as_str)
    }

    /// The number behind a prefix.
    pub fn number<T: FromStr>(&self, prefix: &str) -> Option<T> {
        Some(parsed(self.after(prefix)?))
    }

    /// The word at a place as a number.
    pub fn number_at<T: FromStr>(&self, place: usize) -> Option<T> {
        self.0.get(place).map(|word| parsed(word))
    }

    /// The list behind a prefix, or the default.
    pub fn list(&self, prefix: &str, default: &str) -> Vec<String> {
        let list = self.after(prefix).unwrap_or(default);
        list.split(',').map(str::to_owned).collect()
    }
}

fn parsed<T: FromStr>(word: &str) -> T {
    word.parse()
        .unwrap_or_else(|_| panic!("{word} is not such a number"))
}
