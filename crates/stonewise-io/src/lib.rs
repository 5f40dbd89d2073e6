//! Readers and writers of the formats that surveys come in and results go out.

pub mod atomic;
pub mod cameras;
pub mod cloud;
pub mod table;
