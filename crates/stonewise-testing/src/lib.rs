//! What the tests of several crates share. It depends on none of them, so that unit tests of all can use it.

mod bundle;
mod csv_metadata;
pub mod formula;
mod module_graph;
mod normal;
mod surveys;
mod threads;

pub use bundle::assert_bundle;
pub use csv_metadata::check_csv_metadata;
pub use module_graph::assert_layers;
pub use normal::normal;
pub use surveys::survey;
pub use threads::on_threads;
