//! Time that work takes; `lab/speed.py` compares it with other programs.

pub mod clouds;
pub mod comparisons;
pub mod machine;
mod photos;
pub mod series_time;
mod survey;
pub mod tiles;
