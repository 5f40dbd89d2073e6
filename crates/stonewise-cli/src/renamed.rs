//! Names of commands that earlier versions had, and the words that take their place. They work for one release.

use std::ffi::OsString;

const RENAMED: [(&str, &str); 21] = [
    ("label", "run --until label"),
    ("match", "run --until match"),
    ("register", "run --until register"),
    ("plan", "run --plan"),
    ("unit", "run --unit"),
    ("photos", "info --unpack-photos"),
    ("m3c2", "compare m3c2"),
    ("c2c", "compare c2c"),
    ("c2m", "compare c2m"),
    ("segment", "detector segment"),
    ("train", "detector train"),
    ("adapt", "detector adapt"),
    ("simulate", "test simulate"),
    ("split", "test split"),
    ("certify", "test certify"),
    ("tune", "test tune"),
    ("experiment", "test experiment"),
    ("schema", "self schema"),
    ("doctor", "self doctor"),
    ("completions", "self completions"),
    ("man", "self man"),
];

/// The words of a command line with the present name of its command, and a note on it; `None` where the command
/// has its present name.
pub fn renamed(words: &[OsString]) -> Option<(Vec<OsString>, String)> {
    let mut at = place_of_command(words, 1)?;
    let asks_for_help = words[at] == "help";
    if asks_for_help {
        at = place_of_command(words, at + 1)?;
    }
    let (old, new) = RENAMED.iter().find(|(old, _)| words[at] == *old)?;
    let name = new
        .split(' ')
        .take_while(|word| !asks_for_help || !word.starts_with("--"));
    let mut all = words.to_vec();
    all.splice(at..=at, name.map(OsString::from));
    let note =
        format!("note: `stonewise {old}` is now `stonewise {new}`; the old name goes with the next release");
    Some((all, note))
}

/// Place of the first word that is no global option, from a place on.
fn place_of_command(words: &[OsString], mut from: usize) -> Option<usize> {
    while words.get(from)?.to_string_lossy().starts_with('-') {
        from += if words[from] == "--threads" { 2 } else { 1 };
    }
    Some(from)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args;

    #[test]
    fn every_old_name_leads_to_a_command() {
        for (old, new) in RENAMED {
            let said: Vec<&str> = new.split(' ').collect();
            let mut command = args::command();
            for word in said.iter().take_while(|word| !word.starts_with("--")) {
                command = command
                    .find_subcommand(word)
                    .unwrap_or_else(|| panic!("{old}: {word}"))
                    .clone();
            }
            for option in said.iter().filter_map(|word| word.strip_prefix("--")) {
                assert!(
                    command.get_arguments().any(|a| a.get_long() == Some(option)),
                    "{old}: {option}"
                );
            }
            assert!(
                args::command().find_subcommand(old).is_none(),
                "{old} is a command"
            );
        }
    }

    #[test]
    fn only_the_command_is_renamed() {
        let said = |words: &str| {
            let words: Vec<OsString> = words.split(' ').map(OsString::from).collect();
            renamed(&words).map(|(words, _)| words.join(" ".as_ref()).into_string().unwrap())
        };
        let is = |old: &str, new: &str| assert_eq!(said(old).as_deref(), Some(new));
        is(
            "s -q --threads 2 label p.toml --out r",
            "s -q --threads 2 run --until label p.toml --out r",
        );
        is("s unit ingest-1 --out r", "s run --unit ingest-1 --out r");
        is("s help label", "s help run");
        is("s help m3c2", "s help compare m3c2");
        for present in [
            "s run label",
            "s --help",
            "s",
            "s compare m3c2 a b",
            "s --threads=2 run x",
        ] {
            assert_eq!(said(present), None, "{present}");
        }
    }
}
