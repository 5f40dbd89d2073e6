//! Doubts about the scale of an epoch.

use super::check::{Check, Rule};
use crate::pipeline::steps::register::Registered;
use crate::texts::{STRETCHED, Said};

static SCALED: Rule = Rule {
    message: &STRETCHED,
    limit: 1.0,
    source: "the strain that temperature (0.3 mm per metre) and the scale of the instruments explain",
    remedy: "name a known length of each epoch in `[[distances]]`",
};

/// The wall seems to have grown or shrunk all round by more than instruments and temperature explain.
pub(super) fn stretched(registered: &Registered) -> Option<Check> {
    let strain = registered.epoch_errors.as_ref()?.scale.as_ref()?.strain?;
    let values = [
        ("strain", format!("{:+.1}", 1e3 * strain.mean)),
        ("half_width", format!("{:.1}", 1e3 * strain.half_width)),
        ("lesser", format!("{:+.1}", 1e3 * strain.lesser)),
    ];
    let values = values.map(|(name, value)| (name, Said::numbers(value)));
    let doubt = (strain.excess > SCALED.limit).then(|| STRETCHED.say(&values));
    Some(SCALED.check(strain.excess, doubt))
}
