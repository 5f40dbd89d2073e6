//! The steps, in their order: ingest, segment, label, join, carry, edit, match, offsets, register, m3c2, evaluate.

pub mod carry;
pub mod edit;
pub mod evaluate;
pub mod ingest;
pub mod join;
pub mod label;
pub mod m3c2;
pub mod r#match;
pub mod offsets;
pub mod register;
pub mod segment;
