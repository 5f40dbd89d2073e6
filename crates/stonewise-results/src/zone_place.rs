//! Where a zone of deformation lies.

use crate::StoneRow;

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
    /// The place of the zone of this number among the stones of its pair of epochs.
    pub fn of(zone: u32, rows: &[StoneRow]) -> Self {
        let stones = || rows.iter().filter(|s| s.zone_id == zone);
        let area_m2: f64 = stones().map(|s| s.area_m2).sum();
        let middle =
            |place: fn(&StoneRow) -> f64| stones().map(|s| place(s) * s.area_m2).sum::<f64>() / area_m2;
        Self {
            stones: stones().count() as u32,
            area_m2,
            middle_m: [middle(|s| s.along_m), middle(|s| s.up_m)],
        }
    }
}
