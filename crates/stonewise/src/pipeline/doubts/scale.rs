//! Doubts about the scale of an epoch.

use crate::pipeline::steps::register::Registered;
use crate::texts::{STRETCHED, Said};

/// The wall seems to have grown or shrunk all round by more than instruments and temperature explain.
pub(super) fn stretched(registered: &Registered) -> Option<Said> {
    let [mean, half_width, lesser] = registered.epoch_errors.as_ref()?.scale.as_ref()?.strain?;
    let values = [
        ("strain", format!("{:+.1}", 1e3 * mean)),
        ("half_width", format!("{:.1}", 1e3 * half_width)),
        ("lesser", format!("{:+.1}", 1e3 * lesser)),
    ];
    Some(STRETCHED.say(&values.map(|(name, value)| (name, Said::numbers(value)))))
}
