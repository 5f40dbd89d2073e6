//! How a command ended.

/// How a command ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Everything was done.
    Done,
    /// Done, but for inputs that were left out, or with a doubt about the whole.
    InDoubt,
    /// The verdict on the wall is at or above the state of `--exit-on`.
    Verdict,
    /// Something failed, and the command's output says what.
    Failed,
}
