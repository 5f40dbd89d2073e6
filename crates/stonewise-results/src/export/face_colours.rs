//! Colours of stones by their motion out of the wall.

use crate::{StoneRow, component_limit_m};
use stonewise_base::thresholds::Thresholds;
use stonewise_figure::Scale;

/// Colour of what was not measured.
const UNKNOWN: [u8; 3] = [150; 3];

/// The colours of the out-of-plane displacement, on the scale of the report.
pub struct FaceColours(Scale);

impl FaceColours {
    /// The scale of these rows, with the thresholds of their project.
    pub fn new(rows: &[StoneRow], thresholds: &Thresholds) -> Self {
        let motions = rows.iter().filter_map(|r| r.motion.as_ref());
        Self(Scale::Diverging(component_limit_m(motions, thresholds)))
    }

    /// Colour of a stone; grey where its motion is not known.
    pub fn of(&self, row: Option<&StoneRow>) -> [u8; 3] {
        let motion = row.and_then(|r| r.motion.as_ref());
        motion.map_or(UNKNOWN, |m| self.0.colour(self.0.step(m.face.z)).0)
    }
}
