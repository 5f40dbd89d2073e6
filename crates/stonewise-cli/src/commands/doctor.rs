//! `self doctor`.

use crate::commands::Outcome;
use crate::stdout::stdout;
use anyhow::Result;
use std::env;
use std::io::Write;
use std::num::NonZero;
use std::process::Command;
use stonewise::check::{free_disk, free_memory};
use stonewise::processor_class;
use stonewise::report::Browser;

/// Bytes of a gigabyte, as disks and memory are sold.
const GB: f64 = 1e9;

/// What this machine offers goes to stdout, one line each; nothing in it is an error.
pub fn doctor() -> Result<Outcome> {
    let unknown = || "not known here".to_owned();
    let bytes = |bytes: Option<u64>| bytes.map_or_else(unknown, |b| format!("{:.1} GB free", b as f64 / GB));
    let folder = env::current_dir().ok();
    let lines = [
        ("stonewise", env!("CARGO_PKG_VERSION").to_owned()),
        ("system", env::consts::OS.to_owned()),
        ("processor class", processor_class().to_owned()),
        (
            "threads",
            std::thread::available_parallelism()
                .map_or(1, NonZero::get)
                .to_string(),
        ),
        ("memory", bytes(free_memory())),
        ("disk, this folder", bytes(folder.as_deref().and_then(free_disk))),
        ("locale", locale().unwrap_or_else(|| "none set".to_owned())),
        (
            "PDF of reports",
            match Browser::find() {
                Ok(browser) => format!("printed by {}", browser.program().display()),
                Err(error) => error.to_string(),
            },
        ),
        (
            "Python",
            python().unwrap_or_else(|| "no python3 on the path; only the Python module needs it".to_owned()),
        ),
    ];
    let mut out = stdout();
    for (what, found) in lines {
        writeln!(out, "{what:<18} {found}")?;
    }
    Ok(Outcome::Done)
}

/// The locale, by the variables in the order in which they count.
fn locale() -> Option<String> {
    let set = |name| env::var(name).ok().filter(|value| !value.is_empty());
    ["LC_ALL", "LC_CTYPE", "LANG"].into_iter().find_map(set)
}

fn python() -> Option<String> {
    // On Windows it is called python.
    let version = |name| Command::new(name).arg("--version").output().ok();
    let answer = version("python3").or_else(|| version("python"))?;
    let text = String::from_utf8(answer.stdout).ok()?;
    Some(text.trim().to_owned()).filter(|t| !t.is_empty())
}
