//! Figures of predictions, in millimetres.

use stonewise_core::registration::Deformation;
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

/// A figure in a table; a dash where there is none.
pub(super) fn in_table(mm: Option<f64>) -> String {
    mm.map_or("\u{2013}".to_owned(), |mm| format!("{mm:.2}"))
}
