//! The points of matched stones in both epochs.

mod face_spacing;
mod local_shifts;
mod pairs;
mod stone_points;
mod window;

pub use face_spacing::face_spacing;
pub use local_shifts::local_shifts;
pub use pairs::{MemoryPairs, PairPoints, PairSource};
pub use stone_points::{NearPoint, StonePoints, stone_points};
pub use window::Window;
