//! Lines for a person.

use std::io::Write;

/// Writes one line to stderr; a closed stderr is no reason to fail.
pub fn note(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}
