//! What the tests of several crates share. It depends on none of them, so that unit tests of all can use it.

mod csv_metadata;
pub mod formula;
mod normal;
mod surveys;
mod threads;

pub use csv_metadata::check_csv_metadata;
pub use normal::normal;
pub use surveys::survey;
pub use threads::on_threads;
