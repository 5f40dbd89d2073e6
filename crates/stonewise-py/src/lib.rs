//! The Python module of stonewise: a thin mirror of the crates. `python/stonewise` wraps it for people.
//!
//! Work runs on a thread of its own with the interpreter's lock released, see `attended`. Arrays come
//! contiguous, in the types that the signatures name; the Python side sees to that.

mod adjust;
mod arrays;
mod attended;
mod clouds;
mod command;
mod detector;
mod error;
mod fixed;
mod m3c2;
mod transfer;
mod units;
mod view;

use pyo3::prelude::*;

/// What Python sees of the crates.
#[pymodule]
mod _native {
    #[pymodule_export]
    use crate::adjust::adjust;
    #[pymodule_export]
    use crate::command::{command, run, simulate};
    #[pymodule_export]
    use crate::detector::Detector;
    #[pymodule_export]
    use crate::error::Error;
    #[pymodule_export]
    use crate::fixed::fixed;
    #[pymodule_export]
    use crate::m3c2::{m3c2, thin};
    #[pymodule_export]
    use crate::transfer::transfer;
    #[pymodule_export]
    use crate::units::{Plan, loaded_from, plan, unit};
    #[pymodule_export]
    use crate::view::{View, read_cameras};

    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
