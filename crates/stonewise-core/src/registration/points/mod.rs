//! The points of matched stones in both epochs.

mod choose_points;
mod face_spacing;
mod local_shifts;
mod matched_pairs;
mod pairs;
mod stone_points;
mod window;

pub use choose_points::choose_points;
pub use face_spacing::face_spacing;
pub use local_shifts::local_shifts;
pub use matched_pairs::{MatchedPair, PairPlaces, StoneExtents};
pub use pairs::{MemoryPairs, PairPoints, PairSource};
pub use stone_points::{NearPoint, StonePoints, stone_points};
pub use window::Window;
