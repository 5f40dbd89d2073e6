//! Memory that a simulation takes.

use crate::address_space;
use crate::error::Result;
use crate::simulate::SurveyParams;

/// Peaks of 0.27 GB at 6 m^2 of wall, 0.44 GB at 200, 0.7 GB at 800 and 1.9 GB at 5,540
/// (docs/src/performance.md), rounded up.
const BASE: u64 = 250 << 20;
const PER_SQUARE_METRE: f64 = 6e5;

/// Compares the limit on the address space with what [`write_survey`](crate::simulate::write_survey) takes.
///
/// # Errors
/// The limit is too low.
pub fn require_memory(params: &SurveyParams) -> Result<()> {
    let wall = &params.scene.wall;
    let growth = PER_SQUARE_METRE * wall.width_m * wall.height_m;
    // Sizes that are no numbers are refused with the other parameters.
    address_space::require(BASE.saturating_add(growth.max(0.0) as u64), "this simulation")
}
