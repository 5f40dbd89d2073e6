//! How a command ended.

/// How a command ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Everything that was asked for was done.
    Done,
    /// Done, but for inputs that were left out, or with a doubt about the whole.
    InDoubt,
    /// The verdict on the wall is one that the caller wanted to hear of.
    Verdict,
}
