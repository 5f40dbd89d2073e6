//! The wall on which a person drew.

use crate::id::StoneId;
use nalgebra::Point3;
use std::collections::BTreeSet;

/// How a cloud lies on the wall on which edits are drawn.
pub struct EditedWall<'a> {
    /// (along, up, out) of a point, metres: its place on the unrolled wall, and how far it lies in front of
    /// any fixed plane that is roughly the wall's.
    pub place: &'a (dyn Fn(&Point3<f64>) -> Point3<f64> + Sync),
    /// Stones that belong to the side of the wall on which edits are drawn.
    pub stones: &'a BTreeSet<StoneId>,
    /// Parts of stones, and added stones, have at least this many points.
    pub min_points: u32,
    /// Number of the first new stone; above that of every stone.
    pub first_new: u32,
}
