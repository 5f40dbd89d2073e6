//! `self completions` and `self man`, from the same table of arguments as the command itself.

use crate::args::{CompletionsArgs, ManArgs, command};
use crate::commands::Outcome;
use crate::stdout::stdout;
use anyhow::{Context, Result, bail};
use std::fs;
use std::io::Write;
use stonewise_io::atomic::write_atomically;

/// Completions of a shell go to stdout.
pub fn completions(args: &CompletionsArgs) -> Result<Outcome> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut command(), "stonewise", &mut text);
    stdout().write_all(&text)?;
    Ok(Outcome::Done)
}

/// One man page for each command, in the folder; pages that are there are replaced with `force` only.
pub fn man(args: &ManArgs, force: bool) -> Result<Outcome> {
    fs::create_dir_all(&args.out).with_context(|| format!("creating {}", args.out.display()))?;
    let mut command = command().disable_help_subcommand(true);
    command.build();
    let pages = std::iter::once(command.clone()).chain(command.get_subcommands().cloned());
    for page in pages {
        let page = clap_mangen::Man::new(page);
        let path = args.out.join(page.get_filename());
        let mut text = Vec::new();
        page.render(&mut text)?;
        if path.exists() && !force {
            bail!("{} exists; --force replaces it", path.display());
        }
        write_atomically(&path, |partial| fs::write(partial, &text))
            .with_context(|| format!("writing {}", path.display()))?;
    }
    Ok(Outcome::Done)
}
