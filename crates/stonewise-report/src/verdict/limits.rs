//! Thresholds in words, with the quantity and the zones that they belong to.

use crate::texts::Texts;
use std::collections::{BTreeMap, BTreeSet};
use stonewise_base::thresholds::{Levels, Measures, Thresholds};

/// What has thresholds of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quantity {
    /// The length of a stone's motion.
    Length,
    /// The length of its motion against its neighbours.
    Neighbours,
    /// The opening of a joint.
    Joints,
}

/// Where a quantity is compared with thresholds: the zone of each of its stones or joints.
#[derive(Clone, Debug)]
pub(super) struct Compared {
    pub quantity: Quantity,
    pub zones: Vec<Option<usize>>,
}

/// One threshold of a quantity and the zones that it holds in.
struct Limit {
    quantity: Quantity,
    micrometres: i64,
    zones: BTreeSet<Option<usize>>,
}

impl Quantity {
    /// All quantities.
    pub(super) const ALL: [Self; 3] = [Self::Length, Self::Neighbours, Self::Joints];

    /// The thresholds of the quantity.
    pub(super) fn of(self, measures: &Measures) -> Levels {
        match self {
            Self::Length => measures.length,
            Self::Neighbours => measures.neighbours,
            Self::Joints => measures.joints,
        }
    }
}

/// The thresholds that are compared with, such as "5 mm" or "6 mm (crest) or 20 mm (rest of the wall)"; the
/// quantity is named where thresholds of several quantities differ, the zones where a quantity's thresholds
/// differ on the wall.
pub(super) fn in_words(
    thresholds: &Thresholds,
    compared: &[Compared],
    threshold: fn(&Levels) -> Option<f64>,
    texts: &Texts,
) -> String {
    let limits: Vec<Limit> = compared
        .iter()
        .flat_map(|compared| limits(thresholds, compared, threshold))
        .collect();
    let differ = |a: &Limit, b: &Limit| a.micrometres != b.micrometres && a.quantity != b.quantity;
    let several = limits.iter().any(|a| limits.iter().any(|b| differ(a, b)));
    let mut words: Vec<String> = Vec::new();

    for limit in &limits {
        let names: Vec<String> = several
            .then(|| texts.clauses.quantities[limit.quantity as usize].to_owned())
            .into_iter()
            .chain(zone_names(thresholds, limit, threshold, texts))
            .collect();
        let mm = format!("{} mm", texts.threshold(limit.micrometres as f64 / 1e3));
        let word = match names.is_empty() {
            true => mm,
            false => format!("{mm} ({})", names.join(", ")),
        };
        if !words.contains(&word) {
            words.push(word);
        }
    }

    let last = words.pop().unwrap_or_default();
    match words.is_empty() {
        true => last,
        false => format!("{} {} {last}", words.join(", "), texts.clauses.or),
    }
}

/// The thresholds of one quantity, ascending.
fn limits(thresholds: &Thresholds, compared: &Compared, threshold: fn(&Levels) -> Option<f64>) -> Vec<Limit> {
    let mut zones: BTreeMap<i64, BTreeSet<Option<usize>>> = BTreeMap::new();
    for zone in &compared.zones {
        let levels = compared.quantity.of(&thresholds.measures(*zone));
        if let Some(m) = threshold(&levels) {
            let micrometres = (m * 1e6).round() as i64;
            zones.entry(micrometres).or_default().insert(*zone);
        }
    }
    let limit = |(micrometres, zones)| Limit {
        quantity: compared.quantity,
        micrometres,
        zones,
    };
    zones.into_iter().map(limit).collect()
}

/// Names of the zones of a limit; none where the threshold is the same on the whole wall.
fn zone_names(
    thresholds: &Thresholds,
    limit: &Limit,
    threshold: fn(&Levels) -> Option<f64>,
    texts: &Texts,
) -> Vec<String> {
    let of = |measures: &Measures| threshold(&limit.quantity.of(measures));
    let wall = of(&thresholds.wall);
    if thresholds.zones.iter().all(|zone| of(&zone.measures) == wall) {
        return Vec::new();
    }
    if limit.zones.contains(&None) {
        return vec![texts.clauses.elsewhere.to_owned()];
    }
    let names = limit.zones.iter().flatten();
    names.map(|zone| thresholds.zones[*zone].name.clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_base::report_params::Language;

    fn said(text: &str, compared: &[(Quantity, &[Option<usize>])], language: Language) -> String {
        let thresholds: Thresholds = toml::from_str(text).unwrap();
        let compared: Vec<Compared> = compared
            .iter()
            .map(|(quantity, zones)| Compared {
                quantity: *quantity,
                zones: zones.to_vec(),
            })
            .collect();
        in_words(&thresholds, &compared, Levels::attention_m, Texts::of(language))
    }

    #[test]
    fn a_threshold_names_its_quantity_and_its_zones_only_where_they_tell_it_apart() {
        use Quantity::{Joints, Length, Neighbours};
        let zone = |name: &str, keys: &str| {
            format!("[[zones]]\nname = \"{name}\"\npolygon = [[0, 0], [1, 0], [1, 1]]\n{keys}\n")
        };
        let zones = format!(
            "attention_mm = 5\n{}{}{}",
            zone("crest", "attention_mm = 3"),
            zone("pier", "attention_mm = 3"),
            zone("foot", "")
        );
        let all: &[Option<usize>] = &[Some(2), Some(1), Some(0), None, Some(0)];
        let three = "attention_mm = 5\nneighbours = { attention_mm = 2.5 }\njoints = { attention_mm = 2 }";
        let every: [(Quantity, &[Option<usize>]); 3] = [(Length, all), (Neighbours, all), (Joints, all)];
        for (text, compared, expected) in [
            ("attention_mm = 5", &every[..1], "5 mm"),
            (
                &zones,
                &every[..1],
                "3 mm (crest, pier) or 5 mm (rest of the wall)",
            ),
            (&zones, &[(Length, &all[1..2])], "3 mm (pier)"),
            (&zones, &[(Length, &all[..1])], "5 mm (foot)"),
            (
                three,
                &every,
                "5 mm (motion), 2.5 mm (against neighbours) or 2 mm (joint opening)",
            ),
            (three, &every[1..2], "2.5 mm"),
            ("attention_mm = 5\njoints = { attention_mm = 5 }", &every, "5 mm"),
            (
                &zones.replacen('\n', "\njoints = { attention_mm = 2 }\n", 1),
                &every,
                "3 mm (motion, crest, pier), 5 mm (motion, rest of the wall) or 2 mm (joint opening)",
            ),
        ] {
            assert_eq!(said(text, compared, Language::English), expected, "{text}");
        }
        assert_eq!(
            said(three, &every[1..], Language::German),
            "2,5 mm (gegen Nachbarn) oder 2 mm (Fugen\u{f6}ffnung)"
        );
    }
}
