//! Memory that a simulation takes.

use crate::files::SurveyParams;

/// Peaks of 0.27 GB at 6 m^2 of wall, 0.44 GB at 200, 0.7 GB at 800 and 1.9 GB at 5,540
/// (docs/src/performance.md), rounded up.
const BASE: u64 = 250 << 20;
const PER_SQUARE_METRE: f64 = 6e5;

impl SurveyParams {
    /// Memory that [`write_survey`](crate::write_survey) takes, bytes.
    pub fn memory_bytes(&self) -> u64 {
        let wall = &self.scene.wall;
        let growth = PER_SQUARE_METRE * wall.width_m * wall.height_m;
        // Sizes that are no numbers are refused with the other parameters.
        BASE.saturating_add(growth.max(0.0) as u64)
    }
}
