//! The points of matched stones in both epochs.

mod best_sensor;
mod choose_points;
mod face_spacing;
mod local_shifts;
mod matched_pairs;
mod near_point;
mod noise;
mod pairs;
mod stone_points;
mod window;

pub use choose_points::choose_points;
pub use face_spacing::face_spacing;
pub use local_shifts::local_shifts;
pub use matched_pairs::{MatchedPair, PairPlaces, StoneExtents};
pub use near_point::NearPoint;
pub(crate) use noise::{NOISES_ALIKE, noise_of, sharpest_sensor};
pub use pairs::{MemoryPairs, PairPoints, PairSource};
pub use stone_points::{StonePoints, stone_points};
pub use window::Window;
