//! What a run said in English, in the language of a report.

use super::braces::fill;
use super::doubts::DOUBTS;
use super::message::Message;
use super::notices::NOTICES;
use crate::report_params::Language;

fn all() -> impl Iterator<Item = &'static Message> {
    DOUBTS.into_iter().chain(NOTICES)
}

/// A sentence as a run said it, in the language of a report; `None` where it has no words of that language. A
/// value that is a sentence of its own (`reason`) is given in that language, too.
pub(crate) fn message_in(language: Language, said: &str) -> Option<String> {
    let translated = |message: &Message| {
        let values = values_of(message.english, said)?;
        let reason = |(name, value): &(&'static str, &str)| {
            let known = (*name == "reason").then(|| message_in(language, value)).flatten();
            (*name, known.unwrap_or_else(|| (*value).to_owned()))
        };
        let values: Vec<(&str, String)> = values.iter().map(reason).collect();
        let values: Vec<(&str, &str)> = values.iter().map(|(name, value)| (*name, &**value)).collect();
        Some(fill(message.german, &values))
    };
    match language {
        Language::English => Some(said.to_owned()),
        Language::German => all().find_map(translated),
    }
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

    #[test]
    fn what_a_run_said_is_said_in_german_with_its_values() {
        for message in all() {
            let names: Vec<&str> = message
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
    }
}
