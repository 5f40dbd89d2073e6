//! What a run said in English, in the language of a report.

use super::braces::fill;
use super::doubts::DOUBTS;
use super::findings::FINDINGS;
use super::message::Message;
use super::notices::NOTICES;
use crate::report_params::Language;

/// Values that hold numbers as a run writes them, with a decimal point.
const NUMBERS: [&str; 11] = [
    "error_mm", "excess", "found", "limit", "mean", "ratio", "share", "spacing", "x", "y", "z",
];
/// Values that are messages of their own.
const NESTED: [&str; 4] = ["cause", "reason", "unit", "which"];

fn all() -> impl Iterator<Item = &'static Message> {
    DOUBTS.iter().chain(NOTICES).chain(FINDINGS).copied()
}

/// A sentence as a run said it, in the language of a report; `None` where it has no words of that language. A
/// value that is a sentence of its own (`reason`) is given in that language, too.
pub fn message_in(language: Language, said: &str) -> Option<String> {
    match language {
        Language::English => Some(said.to_owned()),
        Language::German => finding(said).or_else(|| all().find_map(|message| in_german(message, said))),
    }
}

/// A finding with what was looked at before it, in German.
fn finding(said: &str) -> Option<String> {
    let (topic, finding) = said.split_once(": ")?;
    let topic = FINDINGS.iter().find(|message| message.english == topic)?;
    let finding = message_in(Language::German, finding)?;
    Some(format!("{}: {finding}", topic.german))
}

/// The sentence in German, if it is this message.
fn in_german(message: &Message, said: &str) -> Option<String> {
    let value = |(name, value): &(&'static str, &str)| {
        let value = match *name {
            name if NESTED.contains(&name) => message_in(Language::German, value),
            name if NUMBERS.contains(&name) => Some(value.replace('.', ",")),
            _ => None,
        }
        .unwrap_or_else(|| (*value).to_owned());
        (*name, value)
    };
    let values: Vec<(&str, String)> = values_of(message.english, said)?.iter().map(value).collect();
    let values: Vec<(&str, &str)> = values.iter().map(|(name, value)| (*name, &**value)).collect();
    Some(fill(message.german, &values))
}

/// What the braces of `text` were filled with in `said`.
fn values_of<'a>(text: &'static str, said: &'a str) -> Option<Vec<(&'static str, &'a str)>> {
    let mut parts = text.split('{');
    let mut rest = said.strip_prefix(parts.next()?)?;
    let mut values = Vec::new();
    for part in parts {
        let (name, after) = part.split_once('}')?;
        let end = match after {
            "" => rest.len(),
            after => rest.find(after)?,
        };
        values.push((name, &rest[..end]));
        rest = &rest[end + after.len()..];
    }
    rest.is_empty().then_some(values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn what_a_run_said_is_said_in_german_with_its_values() {
        for message in all() {
            let names: BTreeSet<&str> = message
                .english
                .split('{')
                .skip(1)
                .filter_map(|t| Some(t.split_once('}')?.0))
                .collect();
            let values: Vec<String> = (0..names.len()).map(|k| format!("<{k}>")).collect();
            let pairs: Vec<(&str, &str)> = names
                .iter()
                .zip(&values)
                .map(|(name, value)| (*name, value.as_str()))
                .collect();
            let said = message.say(&pairs);
            let german = message_in(Language::German, &said).unwrap();
            assert!(
                values.iter().all(|v| german.contains(v)) && !german.contains('{'),
                "{german}"
            );
            assert_ne!(german, said);
            assert_eq!(message_in(Language::English, &said), Some(said));
        }
        assert_eq!(message_in(Language::German, "something else"), None);
        let reason = message_in(Language::German, "camera not used: not aligned");
        assert_eq!(
            reason.as_deref(),
            Some("Kamera nicht verwendet: nicht ausgerichtet")
        );
        let german = |said| message_in(Language::German, said);
        assert_eq!(
            german("units: the clouds' coordinate system is in feet: transform them to a system in metres")
                .as_deref(),
            Some(
                "Einheiten: das Koordinatensystem der Punktwolken ist in Fuß: sie in ein System in Metern umrechnen"
            )
        );
        assert_eq!(
            german("extent: 0.1 x 0.2 x 0.3 m, 500 points: are the coordinates in metres?").as_deref(),
            Some("Ausdehnung: 0,1 x 0,2 x 0,3 m, 500 Punkte: sind die Koordinaten in Metern?")
        );
        // Half a translation would be worse than none.
        assert_eq!(german("units: something else"), None);
    }
}
