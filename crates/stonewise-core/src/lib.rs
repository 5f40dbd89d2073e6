//! Types and algorithms of stonewise: how a masonry dam moves, stone by stone.
//!
//! This crate touches no files and prints nothing. Lengths are metres, angles radians, coordinates `f64` in
//! the survey's own world frame unless a name or a comment says otherwise. Pixel coordinates have the centre
//! of the first pixel at (0.5, 0.5). Displacements are second epoch minus first; transforms read right to
//! left: `second_from_first * point_in_first`.
//!
//! [`nalgebra`] is the one that these types are made of. The motion of stones between two scans whose points
//! carry the numbers of their stones:
//!
//! ```
//! use stonewise_core::cloud::{Cloud, MemoryTiles};
//! use stonewise_core::matching::{MatchParams, Surroundings, match_stones};
//! use stonewise_core::nalgebra::{Point3, Vector3};
//! use stonewise_core::progress::Silent;
//! use stonewise_core::registration::{AdjustmentParams, MatchedPair, adjust, choose_points};
//! use stonewise_core::stone::{MatchOutcome, Stone};
//! use stonewise_core::transfer::{MemoryLabels, StoneParams, TileLabels, TransferError, build_stones};
//!
//! # fn scan(start: f64, lower: f64) -> Vec<(Point3<f64>, u32)> {
//! #     let share = |step: f64, i: u32| (start + step * f64::from(i)).fract();
//! #     let of_stone = |k: u32| {
//! #         let centre = Vector3::new(0.0, 0.3 * f64::from(k % 4) + 0.04 * f64::from(k * k % 5), 0.2 * f64::from(k / 4));
//! #         (0..600).map(move |i| {
//! #             let (y, z) = (0.22 * share(0.618034, i) - 0.11, 0.16 * share(0.754878, i) - 0.08);
//! #             let noise = 0.002 * (share(0.414214, i) - 0.5);
//! #             let relief = 0.004 * ((50.0 * y).sin() + (43.0 * z).cos());
//! #             (Point3::new(relief + noise, y, z - lower) + centre, k + 1)
//! #         })
//! #     };
//! #     (0..12).flat_map(of_stone).collect()
//! # }
//! // Points with the numbers of their stones: here the second scan shows all twelve 3 mm lower.
//! let epochs: [Vec<(Point3<f64>, u32)>; 2] = [scan(0.0, 0.0), scan(0.3, 0.003)];
//!
//! let stones_of = |points: &[(Point3<f64>, u32)]| -> Result<Vec<Stone>, TransferError> {
//!     let cloud = Cloud::from_world(Point3::origin(), points.iter().map(|(point, _)| *point));
//!     let labels = TileLabels {
//!         stone: points.iter().map(|(_, stone)| *stone).collect(),
//!         confidence: vec![1.0; points.len()],
//!         seen: vec![true; points.len()],
//!     };
//!     let labels = MemoryLabels { tiles: vec![labels] };
//!     build_stones(&MemoryTiles::new([cloud]), &labels, &[], &[], &StoneParams::default(), &Silent)
//! };
//! let (first, second) = (stones_of(&epochs[0])?, stones_of(&epochs[1])?);
//!
//! let surroundings = Surroundings { covered: &|_| true, overlap: None };
//! let matched = match_stones(&first, &second, &surroundings, &MatchParams::default());
//! let partners = matched.outcomes.iter().filter_map(|(id, outcome)| match outcome {
//!     MatchOutcome::Matched { second } => Some((*id, *second)),
//!     MatchOutcome::Unmatched(_) => None,
//! });
//! let pairs = MatchedPair::of_matches(&first, &second, &partners.collect::<Vec<_>>());
//! let points = choose_points(&pairs, [epochs[0].iter().copied(), epochs[1].iter().copied()], 0.0);
//!
//! let report = adjust(&points, &AdjustmentParams::default(), &Silent)?;
//! assert_eq!(report.results.len(), 12);
//! assert!((report.common_motion - Vector3::new(0.0, 0.0, -0.003)).norm() < 4e-4);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A module uses only those before it, and those in braces never each other:
//!
//! ```text
//! switches < id < epoch < statistics < linalg < components < progress < parallel < params < geometry < raster
//!    < cloud < stone < surface < {transfer | matching | registration | change | views | series | instruments} < evaluate
//! ```

pub use nalgebra;

pub mod change;
pub mod cloud;
pub mod components;
pub mod epoch;
pub mod evaluate;
pub mod geometry;
pub mod id;
pub mod instruments;
pub mod linalg;
pub mod matching;
pub mod parallel;
pub mod params;
pub mod progress;
pub mod raster;
pub mod registration;
pub mod series;
pub mod statistics;
pub mod stone;
pub mod surface;
#[cfg(feature = "lab")]
pub mod switches;
#[cfg(not(feature = "lab"))]
mod switches;
pub mod transfer;
pub mod views;
