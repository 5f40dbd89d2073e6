//! What is said of a file.

use serde_json::Value;

/// What is said of a file, for people and for programs.
pub struct Described {
    /// Lines, each with two spaces before it and an end.
    pub text: String,
    /// An object.
    pub json: Value,
}
