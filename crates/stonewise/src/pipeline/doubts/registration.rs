//! Doubts about the registration of an epoch.

use super::check::Check;
use super::rules::AGREES;
use crate::texts::Said;
use nalgebra::Vector3;
use stonewise_core::registration::observers::CrossCheck;

/// Surfaces off the wall show a registration error that differs significantly from the one found without
/// them. An error that the project states is not questioned.
pub(super) fn misregistered(stated_m: Option<f64>, check: &CrossCheck) -> Option<Check> {
    if stated_m.is_some() {
        return None;
    }
    let mm = |v: &Vector3<f64>| Said::list(&[v.x, v.y, v.z].map(|m| format!("{:+.1}", 1e3 * m)));
    let sd = check.covariance.diagonal().max().max(0.0).sqrt();
    let values = || {
        [
            ("cells", check.cells.to_string().into()),
            ("shown", mm(&check.error)),
            ("found", mm(&check.found)),
            ("sd", Said::numbers(format!("{:.1}", 1e3 * sd))),
        ]
    };
    Some(AGREES.check(check.p, values))
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
