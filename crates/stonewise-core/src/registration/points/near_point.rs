//! A point that may belong to a stone.

/// A point near a stone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearPoint {
    /// Relative to the stone's centroid in the first epoch, metres.
    pub offset: [f32; 3],
    /// Whether the point has the label of the stone.
    pub labelled: bool,
    /// Number of the station or strip that it comes from.
    pub source: u32,
}
