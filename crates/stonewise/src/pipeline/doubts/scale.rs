//! Doubts about the scale of an epoch.

use super::check::Check;
use super::rules::SCALED;
use crate::pipeline::steps::register::Registered;
use crate::texts::Said;

/// The wall seems to have grown or shrunk all round by more than instruments and temperature explain.
pub(super) fn stretched(registered: &Registered) -> Option<Check> {
    let strain = registered.epoch_errors.as_ref()?.scale.as_ref()?.strain?;
    let values = [
        ("strain", format!("{:+.1}", 1e3 * strain.mean)),
        ("half_width", format!("{:.1}", 1e3 * strain.half_width)),
        ("lesser", format!("{:+.1}", 1e3 * strain.lesser)),
    ];
    let values = || values.map(|(name, value)| (name, Said::numbers(value)));
    Some(SCALED.check(strain.excess, values))
}
