//! Errors of simulated surveys.

use crate::error::Error;
use stonewise_simulate::SimulateError;

/// An error of the simulator as one of this crate; an impossible parameter is wrong usage.
pub fn not_simulated(error: SimulateError) -> Error {
    match error {
        SimulateError::Interrupted(_) => Error::Interrupted,
        SimulateError::Parameter { .. } => Error::Parameters(error.to_string()),
        error => Error::Simulate(error.into()),
    }
}
