//! `explain`.

use crate::args::ExplainArgs;
use crate::commands::Outcome;
use crate::stdout::stdout;
use anyhow::{Context, Result};
use std::io::Write;

/// The page that explains every code, a section each.
const PAGE: &str = include_str!("../../messages.md");

/// The section of a code, or the list of all codes, goes to stdout.
pub fn explain(args: &ExplainArgs) -> Result<Outcome> {
    let mut out = stdout();
    match &args.code {
        None => codes().try_for_each(|code| writeln!(out, "{code}"))?,
        Some(code) => {
            let text = section(code.trim_matches(['[', ']']))
                .with_context(|| format!("no message has the code {code}; `stonewise explain` lists them"))?;
            writeln!(out, "{code}\n\n{text}")?;
        }
    }
    Ok(Outcome::Done)
}

fn codes() -> impl Iterator<Item = &'static str> {
    PAGE.lines().filter_map(|line| line.strip_prefix("### "))
}

fn section(code: &str) -> Option<&'static str> {
    let (_, rest) = PAGE.split_once(&format!("\n### {code}\n"))?;
    let end = rest.find("\n#").unwrap_or(rest.len());
    Some(rest[..end].trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_code_has_a_section_of_its_own() {
        assert!(codes().count() > 60);
        for code in codes() {
            let text = section(code).unwrap_or_default();
            assert!(text.ends_with('.') && !text.contains("###"), "{code}: {text}");
        }
        assert!(section("interrupted").is_some_and(|text| text.starts_with("You stopped")));
        assert_eq!(section("no-such-code"), None);
    }
}
