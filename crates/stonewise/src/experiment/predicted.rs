//! Figures of predictions, in millimetres.

use crate::results::{StoneOutline, StoneRow};
use std::borrow::Cow;
use std::collections::BTreeMap;
use stonewise_core::registration::{Deformation, StoneDeformation};
use stonewise_core::statistics::median;

/// Median over the items along, up and out, of those that have a value. `of`: an item's value along an axis, metres.
pub(super) fn medians_mm<T>(items: &[T], of: impl Fn(&T, usize) -> Option<f64>) -> [Option<f64>; 3] {
    [0, 1, 2].map(|axis| {
        let mut values: Vec<f64> = items.iter().filter_map(|item| of(item, axis)).collect();
        median(&mut values).map(|m| 1e3 * m)
    })
}

/// Limits of a deformation that was judged; none of one that was not.
pub(super) fn limits_mm(
    judged: Option<&Deformation>,
    limits_m: fn(&Deformation) -> [Option<f64>; 3],
) -> [Option<f64>; 3] {
    let limits_m = judged.map_or([None; 3], limits_m);
    limits_m.map(|limit| limit.map(|m| 1e3 * m))
}

/// The rows with the standard deviations of deformations as they are where no deformation is shown: where the noise of a
/// single draw shows one by chance, what is added to their variances for it is no part of a prediction.
pub(super) fn without_chance<'a>(
    rows: &'a [StoneRow],
    judged: Option<&Deformation>,
    outlines: &BTreeMap<u32, StoneOutline>,
) -> Cow<'a, [StoneRow]> {
    let Some(shown) = judged.filter(|d| d.is_shown()) else {
        return rows.into();
    };
    let stones: BTreeMap<u32, &StoneDeformation> = shown.stones.iter().map(|s| (s.stone.0, s)).collect();
    let predicted = |row: &StoneRow| {
        let row = row.clone();
        let Some((drawn, outline)) = stones.get(&row.stone_id).zip(outlines.get(&row.stone_id)) else {
            return row;
        };
        let still = StoneDeformation {
            covariance: drawn.covariance_without_zones(),
            ..**drawn
        };
        row.with_deformation(&outline.normal, &still)
    };
    rows.iter().map(predicted).collect()
}

/// A figure in a table; a dash where there is none.
pub(super) fn in_table(mm: Option<f64>) -> String {
    mm.map_or("\u{2013}".to_owned(), |mm| format!("{mm:.2}"))
}
