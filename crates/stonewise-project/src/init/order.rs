//! Which epoch comes first.

use super::epoch::Found;

/// Words in names of epochs, in order of time.
const WORDS: [&[&str]; 7] = [
    &["before", "after"],
    &["first", "second", "third", "fourth"],
    &["old", "new"],
    &["pre", "post"],
    &["vorher", "nachher"],
    &["erste", "zweite", "dritte", "vierte"],
    &["alt", "neu"],
];

/// Brings epochs in order of time as far as their names tell it; says what told it.
pub(super) fn order(epochs: &mut [Found]) -> &'static str {
    let names: Vec<String> = epochs.iter().map(|e| e.name.to_lowercase()).collect();
    if names.iter().all(|n| n.bytes().any(|b| b.is_ascii_digit())) {
        epochs.sort_by_cached_key(|e| pieces(&e.name));
        return "by the numbers in their names";
    }
    let told = WORDS.iter().find(|words| {
        let mut places: Vec<Option<usize>> = names.iter().map(|name| place(name, words)).collect();
        places.sort();
        places.windows(2).all(|pair| pair[0] != pair[1]) && places.first() != Some(&None)
    });
    if let Some(words) = told {
        epochs.sort_by_cached_key(|e| place(&e.name.to_lowercase(), words));
        return "by their names";
    }
    "in alphabetical order, as their names do not tell: if that is wrong, change the order in the project file"
}

/// Which of the words a name holds.
fn place(name: &str, words: &[&str]) -> Option<usize> {
    words.iter().position(|word| name.contains(word))
}

/// A name in pieces: text, and numbers by their value, so that epoch 10 follows epoch 9.
fn pieces(name: &str) -> Vec<(String, u64)> {
    let mut pieces = vec![(String::new(), 0u64)];
    let mut is_number = false;
    for c in name.to_lowercase().chars() {
        let last = pieces.len() - 1;
        match c.to_digit(10) {
            Some(digit) => {
                pieces[last].1 = pieces[last].1.saturating_mul(10).saturating_add(u64::from(digit));
                is_number = true;
            }
            None if is_number => {
                pieces.push((c.to_string(), 0));
                is_number = false;
            }
            None => pieces[last].0.push(c),
        }
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ordered(names: &[&str]) -> (Vec<String>, &'static str) {
        let named = |name: &&str| Found {
            name: (*name).to_owned(),
            ..Found::default()
        };
        let mut epochs: Vec<Found> = names.iter().map(named).collect();
        let why = order(&mut epochs);
        (epochs.into_iter().map(|e| e.name).collect(), why)
    }

    #[test]
    fn words_and_numbers_tell_the_order_and_else_it_is_said() {
        assert_eq!(ordered(&["after", "before"]).0, ["before", "after"]);
        assert_eq!(ordered(&["Wand neu", "wand_alt"]).0, ["wand_alt", "Wand neu"]);
        assert_eq!(ordered(&["epoch10", "epoch9"]).0, ["epoch9", "epoch10"]);
        assert_eq!(
            ordered(&["2024-10-01", "2024-9-30", "2023"]).0,
            ["2023", "2024-9-30", "2024-10-01"]
        );
        let (names, why) = ordered(&["company a", "company b"]);
        assert_eq!(names, ["company a", "company b"]);
        assert!(why.contains("change the order"));
    }
}
