//! What is odd about a cloud file that is read all the same.

/// Something that a user must be told about a file that was read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Remark {
    /// What is odd, and how it was read.
    pub text: String,
    /// The points that were read may not be those that were meant.
    pub is_doubt: bool,
}

impl Remark {
    pub(super) fn note(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            is_doubt: false,
        }
    }

    pub(super) fn doubt(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            is_doubt: true,
        }
    }
}
