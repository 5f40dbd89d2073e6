//! The studio, asked as a browser or an attacker asks it.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on must stop")]

mod attacks;
mod bundle;
mod edits;
mod layers;
mod support;
mod types;
