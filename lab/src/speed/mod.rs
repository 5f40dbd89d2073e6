//! Time that work takes; `lab/speed.py` compares it with other programs.

pub mod clouds;
pub mod comparisons;
pub mod series_time;
mod survey;
pub mod tiles;
