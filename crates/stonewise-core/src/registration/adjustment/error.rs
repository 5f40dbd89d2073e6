//! Why the adjustment stopped.

use crate::progress::Interrupted;

/// Why the adjustment stopped.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AdjustError<E: std::error::Error + 'static> {
    /// A batch of pairs could not be read.
    #[error("cannot read the points of a batch of stones")]
    Source(#[source] E),
    /// The caller stopped the work.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
    /// The equations could not be factored.
    #[error(
        "the equations of the stones ({stones}) could not be solved: not enough memory, or coordinates that are not finite"
    )]
    Unsolvable {
        /// Stones in the adjustment.
        stones: usize,
    },
}
