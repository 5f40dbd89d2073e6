//! Errors of comparisons.

use crate::params::ParamError;
use crate::progress::Interrupted;

/// Why clouds could not be compared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CompareError {
    /// A tile could not be read.
    #[error("a tile of the cloud could not be read")]
    Read(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// Stopped by the caller.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
    /// Parameters that cannot work.
    #[error(transparent)]
    Params(#[from] ParamError),
    /// Normals that do not belong to the core points.
    #[error("{normals} normals for {core_points} core points: give one normal for each core point")]
    NormalCount {
        /// Number of core points.
        core_points: usize,
        /// Number of normals.
        normals: usize,
    },
}
