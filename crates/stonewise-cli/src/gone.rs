//! Words of the command line that earlier versions knew, and what to do instead.

use std::ffi::OsString;

/// Words that are gone, and what takes their place.
const GONE: [(&str, &str); 3] = [
    (
        "sensitivity",
        "`experiment sensitivity` is gone: simulate a survey with each value (`stonewise test simulate --params FILE`, the \
         spacing is `spacing_m` in [scene.tls]), then `stonewise run` it and `stonewise evaluate --truth` the results",
    ),
    (
        "--train-minutes",
        "`--train-minutes` is gone: train the detector first (`stonewise detector train --data MASKS --images PHOTOS`), then name it \
         in the project file ([segment] model) and leave out `masks`",
    ),
    (
        "--batch-points",
        "`--batch-points` is gone: a unit is a whole step or one photo now: leave it out",
    ),
];

/// What to do instead of the first of these words that is gone.
pub fn instead(words: &[OsString]) -> Option<&'static str> {
    let words = words.iter().filter_map(|word| word.to_str());
    let mut names = words.map(|word| word.split_once('=').map_or(word, |(name, _)| name));
    let of = |name: &str| GONE.iter().find(|(gone, _)| *gone == name);
    names.find_map(of).map(|(_, instead)| *instead)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_that_are_gone_name_what_takes_their_place() {
        let said = |words: &str| {
            let words: Vec<OsString> = words.split(' ').map(OsString::from).collect();
            instead(&words)
        };
        let sensitivity = said("stonewise experiment sensitivity --out curves").unwrap();
        assert!(sensitivity.contains("stonewise test simulate"), "{sensitivity}");
        let trained = said("stonewise experiment paper --train-minutes=4 --out paper").unwrap();
        assert!(trained.contains("stonewise detector train"), "{trained}");
        assert_eq!(said("stonewise run sensitivity.toml"), None);
    }
}
