//! How closely a survey is looked at.

/// How closely to look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// At the first 500,000 points of each epoch, without pictures: what a run affords before it works.
    Quick,
    /// At the first six million points of each epoch and the edges in three photos, with pictures.
    Full,
}
