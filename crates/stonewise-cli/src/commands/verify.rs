//! `verify`.

use crate::args::VerifyArgs;
use crate::commands::Outcome;
use crate::printer::Printer;
use crate::stdout::stdout;
use anyhow::Result;
use std::io::Write;
use stonewise::{Answer, Project};

/// Compares results with their digests and with each other, and with the run again; the findings go to stdout.
pub fn verify(args: &VerifyArgs, printer: &Printer) -> Result<Outcome> {
    let project = args.project.as_deref().map(Project::read).transpose()?;
    let verification = stonewise::verify(&args.results, project.as_ref(), printer)?;
    printer.finish();
    let mut out = stdout();
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&verification)?)?;
    } else {
        for finding in &verification.findings {
            let answer = finding.answer.to_string();
            writeln!(
                out,
                "{answer:<6} {:<7} {}: {}",
                finding.kind, finding.subject, finding.message
            )?;
        }
    }
    printer.log(match verification.answer {
        Answer::Holds => "the results are those of the run",
        Answer::Open => "nothing contradicts the results, but not all of them could be compared",
        Answer::Fails => "the results are not those of the run",
    });
    Ok(match verification.answer {
        Answer::Holds => Outcome::Done,
        Answer::Open => Outcome::InDoubt,
        Answer::Fails => Outcome::Failed,
    })
}
