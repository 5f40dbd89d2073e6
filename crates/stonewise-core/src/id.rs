//! Identifiers that cannot be mixed up.

use serde::{Deserialize, Serialize};

/// A stone within one epoch; 0 never names a stone (it is "no stone" in label images and clouds).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct StoneId(pub u32);

/// A photo within one epoch: its index in the epoch's list of views.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct ImageId(pub u32);

/// A segmented instance within one photo; 0 is background.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct InstanceId(pub u32);
