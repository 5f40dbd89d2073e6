//! Counts with their noun.

use std::fmt::Display;

/// "1 stone", "2 stones"; for nouns that take an s.
pub fn counted(n: impl Display, noun: &str) -> String {
    let n = n.to_string();
    let plural = if n == "1" { "" } else { "s" };
    format!("{n} {noun}{plural}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_one_is_singular() {
        let said = [0u32, 1, 2].map(|n| counted(n, "posed photo"));
        assert_eq!(said, ["0 posed photos", "1 posed photo", "2 posed photos"]);
    }
}
