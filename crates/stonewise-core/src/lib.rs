//! Types and algorithms of stonewise: how a masonry dam moves, stone by stone.
//!
//! This crate touches no files and prints nothing. Lengths are metres, angles radians, coordinates `f64` in
//! the survey's own world frame unless a name or a comment says otherwise. Pixel coordinates have the centre
//! of the first pixel at (0.5, 0.5). Displacements are second epoch minus first; transforms read right to
//! left: `second_from_first * point_in_first`.
//!
//! A module uses only those before it, and those in braces never each other:
//!
//! ```text
//! id < epoch < statistics < linalg < components < progress < parallel < params < geometry < raster < cloud
//!    < stone < surface < {transfer | matching | registration | change | views | series} < evaluate
//! ```

pub mod change;
pub mod cloud;
mod components;
pub mod epoch;
pub mod evaluate;
pub mod geometry;
pub mod id;
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
pub mod transfer;
pub mod views;
