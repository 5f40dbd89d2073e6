//! `--version --verbose`.

use std::env::consts::{ARCH, OS};
use stonewise::processor_class;
use stonewise_segment::Weights;

/// What tells one build from another and decides the last digits of results, one line each.
pub fn version_details() -> String {
    let commit =
        option_env!("STONEWISE_COMMIT").unwrap_or("unknown (STONEWISE_COMMIT was not set for the build)");
    let build = if cfg!(debug_assertions) {
        "development"
    } else {
        "release"
    };
    let weights = match Weights::BuiltIn.bytes() {
        Ok(bytes) => format!("BLAKE3 {}", blake3::hash(&bytes).to_hex()),
        Err(error) => error.to_string(),
    };
    format!(
        "commit           {commit}\nsystem           {OS} {ARCH}\nbuild            {build}\n\
         processor class  {}\nbuilt-in weights {weights}\n",
        processor_class()
    )
}
