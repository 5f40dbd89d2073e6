//! Thresholds in words, with the quantity and the zones that they belong to.

use crate::texts::Texts;
use std::collections::{BTreeMap, BTreeSet};
use stonewise_base::thresholds::{Level, Quantity, Threshold, Thresholds};

/// A threshold that something is compared with, and where: in a zone, or on the wall outside all zones.
pub(super) type Placed = (Threshold, Option<usize>);

/// The thresholds at which attention begins: of every quantity of stones and joints in every one of these zones.
pub(super) fn of_attention(thresholds: &Thresholds, zones: &BTreeSet<Option<usize>>) -> Vec<Placed> {
    let quantities = Quantity::ALL.into_iter().filter(|q| *q != Quantity::Deformation);
    let first = |(quantity, zone): (Quantity, Option<usize>)| {
        let all = thresholds.of(quantity, zone);
        let level = all.clone().map(|t| t.level).min().unwrap_or(Level::Alarm);
        let first: Vec<Placed> = all.filter(|t| t.level == level).map(|t| (t, zone)).collect();
        first
    };
    quantities
        .flat_map(|quantity| zones.iter().map(move |zone| (quantity, *zone)))
        .flat_map(first)
        .collect()
}

/// The thresholds that were compared with, such as "5 mm" or "6 mm (crest) or 20 mm (rest of the wall)". The quantity
/// is named where thresholds of several quantities differ and where it is more than a length; zones are named where a
/// quantity's thresholds differ on the wall.
pub(super) fn in_words(thresholds: &Thresholds, compared: &[Placed], texts: &Texts) -> String {
    let mut limits: BTreeMap<(Quantity, i64), BTreeSet<Option<usize>>> = BTreeMap::new();
    for (threshold, zone) in compared {
        let thousandths = (threshold.limit * 1e3).round() as i64;
        let zones = limits.entry((threshold.quantity, thousandths)).or_default();
        zones.insert(*zone);
    }
    let differ = |a: &(Quantity, i64), b: &(Quantity, i64)| a.0 != b.0 && a.1 != b.1;
    let several = limits.keys().any(|a| limits.keys().any(|b| differ(a, b)));
    let mut words: Vec<String> = Vec::new();

    for ((quantity, thousandths), zones) in &limits {
        use Quantity::{Along, Out, Up};
        let is_named = several || matches!(quantity, Out | Up | Along);
        let names: Vec<String> = is_named
            .then(|| texts.clauses.quantities[*quantity as usize].to_owned())
            .into_iter()
            .chain(zone_names(thresholds, *quantity, zones, texts))
            .collect();
        let limit = texts.limit(*quantity, *thousandths as f64 / 1e3);
        let word = match names.is_empty() {
            true => limit,
            false => format!("{limit} ({})", names.join(", ")),
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

/// Names of the zones of a limit; none where the thresholds of its quantity are the same on the whole wall.
fn zone_names(
    thresholds: &Thresholds,
    quantity: Quantity,
    zones: &BTreeSet<Option<usize>>,
    texts: &Texts,
) -> Vec<String> {
    let is_as_elsewhere = |zone: usize| {
        thresholds
            .of(quantity, Some(zone))
            .eq(thresholds.of(quantity, None))
    };
    let all = thresholds.zones();
    if (0..all.len()).all(is_as_elsewhere) {
        return Vec::new();
    }
    if zones.contains(&None) {
        return vec![texts.clauses.elsewhere.to_owned()];
    }
    zones
        .iter()
        .flatten()
        .map(|zone| all[*zone].name.clone())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_base::report_params::Language;

    fn said(text: &str, quantities: &[Quantity], zones: &[Option<usize>], language: Language) -> String {
        let thresholds: Thresholds = toml::from_str(text).unwrap();
        let all = of_attention(&thresholds, &zones.iter().copied().collect());
        let compared: Vec<Placed> = all
            .into_iter()
            .filter(|(t, _)| quantities.contains(&t.quantity))
            .collect();
        in_words(&thresholds, &compared, Texts::of(language))
    }

    #[test]
    fn a_threshold_names_its_quantity_and_its_zones_only_where_they_tell_it_apart() {
        use Quantity::{Joints, Length, Neighbours, Out, Rate};
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
        let every = [Length, Neighbours, Joints];
        for (text, quantities, zones, expected) in [
            ("attention_mm = 5", &every[..1], all, "5 mm"),
            ("alarm_mm = 5", &every[..1], all, "5 mm"),
            (
                &zones,
                &every[..1],
                all,
                "3 mm (crest, pier) or 5 mm (rest of the wall)",
            ),
            (&zones, &[Length], &all[1..2], "3 mm (pier)"),
            (&zones, &[Length], &all[..1], "5 mm (foot)"),
            (
                three,
                &every,
                all,
                "5 mm (motion), 2.5 mm (against neighbours) or 2 mm (joint opening)",
            ),
            (three, &every[1..2], all, "2.5 mm"),
            (
                "attention_mm = 5\njoints = { attention_mm = 5 }",
                &every,
                all,
                "5 mm",
            ),
            (
                &zones.replacen('\n', "\njoints = { attention_mm = 2 }\n", 1),
                &every,
                all,
                "3 mm (motion, crest, pier), 5 mm (motion, rest of the wall) or 2 mm (joint opening)",
            ),
            (
                "out_attention_mm = [-5, 10]\nout_alarm_mm = [-8, 20]",
                &[Out],
                all,
                "-5 mm (out of the wall) or 10 mm (out of the wall)",
            ),
            ("rate_attention_mm_per_year = 1.5", &[Rate], all, "1.5 mm a year"),
        ] {
            assert_eq!(
                said(text, quantities, zones, Language::English),
                expected,
                "{text}"
            );
        }
        assert_eq!(
            said(three, &every[1..], all, Language::German),
            "2,5 mm (gegen Nachbarn) oder 2 mm (Fugen\u{f6}ffnung)"
        );
    }
}
