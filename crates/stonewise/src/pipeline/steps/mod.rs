//! The steps that compute, in their order: `../list.rs`.

mod align;
pub mod carry;
pub mod change;
pub mod check;
pub mod confirm;
pub mod edit;
pub mod evaluate;
pub mod ingest;
pub mod instruments;
pub mod join;
pub mod known_motion;
pub mod label;
pub mod m3c2;
pub mod r#match;
mod matching;
pub mod measure;
pub mod offsets;
pub mod overlap;
pub mod panels;
pub mod register;
pub mod segment;
mod shapes;
pub mod stone_outlines;
pub mod tracks;
pub mod views;
