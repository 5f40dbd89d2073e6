//! `init`.

use crate::args::InitArgs;
use crate::commands::Outcome;
use crate::note::note;
use anyhow::Result;

/// Writes a project file; says what was chosen and what was left out.
pub fn init(args: &InitArgs) -> Result<Outcome> {
    let done = stonewise::init(&args.dir)?;
    done.lines.iter().for_each(|line| note(line));
    note(&format!("wrote {}", done.path.display()));
    Ok(Outcome::Done)
}
