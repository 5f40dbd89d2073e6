//! How far a run goes.

/// How far to go.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Until {
    /// Masks of every photo.
    Segmented,
    /// Stones in the clouds.
    Labelled,
    /// Stones across epochs.
    Matched,
    /// Motions of stones.
    Registered,
    /// Every table of results, M3C2 and evaluation too, but no copies of the clouds and no report.
    Compared,
    /// Everything.
    Reported,
}
