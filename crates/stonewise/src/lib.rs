//! stonewise
