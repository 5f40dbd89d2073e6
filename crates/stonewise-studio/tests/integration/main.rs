//! The studio under the requests of browsers and of attackers.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on must stop")]

mod attacks;
mod edits;
mod support;
mod types;
