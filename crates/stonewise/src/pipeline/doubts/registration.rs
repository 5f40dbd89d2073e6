//! Doubts about the registration of an epoch.

use super::check::{Check, Rule};
use crate::texts::{MISREGISTERED_EPOCH, Said};
use nalgebra::Vector3;
use stonewise_core::registration::observers::CrossCheck;

/// Probability of the difference between the registration errors with and without surfaces off the wall,
/// below which the run is in doubt: one sound survey in a thousand.
const MISREGISTERED: f64 = 1e-3;

static AGREES: Rule = Rule {
    message: &MISREGISTERED_EPOCH,
    limit: MISREGISTERED,
    source: "probability of the difference: one sound survey in a thousand",
    remedy: "use the surfaces off the wall (`auto_stable`, `[[registration.stable]]`), or state `epoch_error_m`",
};

/// Surfaces off the wall show a registration error that differs significantly from the one found without
/// them. An error that the project states is not questioned.
pub(super) fn misregistered(stated_m: Option<f64>, check: &CrossCheck) -> Option<Check> {
    if stated_m.is_some() {
        return None;
    }
    let mm = |v: &Vector3<f64>| Said::list(&[v.x, v.y, v.z].map(|m| format!("{:+.1}", 1e3 * m)));
    let sd = check.covariance.diagonal().max().max(0.0).sqrt();
    let values = [
        ("cells", check.cells.to_string().into()),
        ("shown", mm(&check.error)),
        ("found", mm(&check.found)),
        ("sd", Said::numbers(format!("{:.1}", 1e3 * sd))),
    ];
    let doubt = (check.p < MISREGISTERED).then(|| MISREGISTERED_EPOCH.say(&values));
    Some(AGREES.check(check.p, doubt))
}

#[cfg(test)]
mod tests {
    use super::super::check::said;
    use super::*;

    #[test]
    fn what_surfaces_off_the_wall_show_is_doubted_only_against_an_assumption() {
        let with = |p| CrossCheck {
            cells: 30,
            error: Vector3::new(0.02, 0.0, -0.001),
            found: Vector3::zeros(),
            covariance: nalgebra::Matrix3::identity() * 25e-8,
            p,
        };
        assert_eq!(said(misregistered(None, &with(0.01))), None);
        assert_eq!(said(misregistered(Some(0.02), &with(1e-9))), None);
        let message = said(misregistered(None, &with(1e-9))).unwrap();
        for part in ["30 pieces", "(+20.0, +0.0, -1.0) mm", "of 0.5 mm"] {
            assert!(message.english.contains(part), "{message}");
        }
    }
}
