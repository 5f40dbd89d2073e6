//! `init`.

use crate::args::InitArgs;
use crate::commands::Outcome;
use crate::printer::note;
use anyhow::Result;

/// Writes a project file and says where.
pub fn init(args: &InitArgs) -> Result<Outcome> {
    let path = stonewise::init(&args.dir)?;
    note(&format!("wrote {}", path.display()));
    Ok(Outcome::Done)
}
