//! Where a zone of deformation lies.

use crate::StoneRow;
use stonewise_core::id::StoneId;
use stonewise_core::registration::DeformationZone;

/// Place and size of a zone of deformation, of its stones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZonePlace {
    /// Number of stones.
    pub stones: u32,
    /// Area of their faces, square metres.
    pub area_m2: f64,
    /// Middle along the unrolled wall and up, weighted by area, metres; NaN where there is no area.
    pub middle_m: [f64; 2],
}

impl ZonePlace {
    /// The place of a zone among the stones of its pair of epochs.
    pub fn of(zone: &DeformationZone, rows: &[StoneRow]) -> Self {
        let stones = || Self::stones(zone, rows);
        let area_m2: f64 = stones().map(|s| s.area_m2).sum();
        let middle =
            |place: fn(&StoneRow) -> f64| stones().map(|s| place(s) * s.area_m2).sum::<f64>() / area_m2;
        Self {
            stones: stones().count() as u32,
            area_m2,
            middle_m: [middle(|s| s.along_m), middle(|s| s.up_m)],
        }
    }

    /// The rows of the stones of a zone.
    pub fn stones<'a>(zone: &'a DeformationZone, rows: &'a [StoneRow]) -> impl Iterator<Item = &'a StoneRow> {
        let is_in_zone = |s: &&StoneRow| zone.stones.binary_search(&StoneId(s.stone_id)).is_ok();
        rows.iter().filter(is_in_zone)
    }
}
