//! Round ends for the colour scales of pictures and layers.

use super::{RowMotion, Sorted};
use stonewise_base::thresholds::Thresholds;
use stonewise_figure::nice_above;

/// A round length that 98 % of the values do not exceed, metres.
pub fn nice_scale_m(values: impl IntoIterator<Item = f64>) -> f64 {
    nice_above(Sorted::new(values).quantile(0.98).unwrap_or(0.0) * 1e3) / 1e3
}

/// End of the scale that the components of these motions share, metres: the alarm threshold; without one it covers 98 %
/// of them, and their typical detection limit.
pub fn component_limit_m<'a>(
    motions: impl Iterator<Item = &'a RowMotion> + Clone,
    thresholds: &Thresholds,
) -> f64 {
    if let Some(alarm_m) = thresholds.farthest_alarm_m() {
        return alarm_m;
    }
    let components = motions
        .clone()
        .flat_map(|m| [m.face.x, m.face.y, m.face.z])
        .map(f64::abs);
    let limits = Sorted::new(motions.map(|m| m.detection_limit_m));
    nice_scale_m(components).max(nice_above(limits.median().unwrap_or(0.0) * 1e3) / 1e3)
}
