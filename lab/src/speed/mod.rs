//! Time that work takes; `lab/speed.py` compares it with other programs.

pub mod clouds;
pub mod comparisons;
mod photos;
mod survey;
pub mod tiles;
