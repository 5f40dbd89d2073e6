//! `self schema`.

use crate::commands::Outcome;
use crate::stdout::stdout;
use anyhow::Result;
use std::io::Write;
use stonewise::project::project_schema;

/// The schema of the project file goes to stdout.
pub fn schema() -> Result<Outcome> {
    writeln!(stdout(), "{:#}", project_schema())?;
    Ok(Outcome::Done)
}
