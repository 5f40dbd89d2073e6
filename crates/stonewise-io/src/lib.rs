//! stonewise-io
