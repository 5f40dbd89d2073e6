//! Programs about the detector.

pub mod instances;
pub mod kept_walls;
pub mod masonry_sheet;
pub mod overfit;
pub mod step_time;
