//! Errors of simulated surveys.

use crate::error::Error;
use stonewise_simulate::SimulateError;

/// Why a survey was not simulated, as an error of this crate: an impossible parameter is one of the user's.
pub fn not_simulated(error: SimulateError) -> Error {
    match error {
        SimulateError::Interrupted(_) => Error::Interrupted,
        SimulateError::Parameter { .. } => Error::Parameters(error.to_string()),
        error => Error::Simulate(error.into()),
    }
}
