//! Where the datum of two epochs comes from.

use serde::{Deserialize, Serialize};

/// Where the knowledge of the epochs' common frame comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Datum {
    /// Areas that did not move.
    Stable,
    /// Differences between the sources of each epoch.
    Sources,
    /// Nothing shows it.
    Unknown,
}
