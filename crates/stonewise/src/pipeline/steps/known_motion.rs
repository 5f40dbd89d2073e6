//! The motion that the project file prescribes.

use crate::project::Project;
use nalgebra::{Point3, Vector3};
use stonewise_core::epoch::EpochId;
use stonewise_core::evaluate::MotionField;

/// The motion of a later epoch's points that the project prescribes, as a function of where they were; a known
/// motion of the reference is taken away from it. `None` where the project prescribes none.
pub fn known_motion(project: &Project, later: EpochId) -> Option<impl Fn(&Point3<f64>) -> Vector3<f64> + '_> {
    let motions = project.epochs.pair(later).map(|e| &e.motion);
    if motions.first.is_none() && motions.later.is_none() {
        return None;
    }
    let at = |field: &Option<MotionField>, p: &Point3<f64>| {
        field
            .as_ref()
            .map_or_else(Vector3::zeros, |f| f.displacement_at(p))
    };
    Some(move |p: &Point3<f64>| at(motions.later, p) - at(motions.first, p))
}
