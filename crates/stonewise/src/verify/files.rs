//! Result files against the digests that their run noted.

use super::finding::{Answer, Finding};
use crate::error::Result;
use crate::kept::file_digest;
use crate::output::{Digests, UNFINISHED_FILE, named_results_in};
use crate::results::names::DIGESTS;
use std::path::Path;
use stonewise_core::progress::Progress;

const KIND: &str = "files";

/// Every file that differs from its digest is a finding; those that do not are counted.
pub(super) fn files(results: &Path, progress: &dyn Progress) -> Result<Vec<Finding>> {
    let mut findings = Vec::new();
    if results.join(UNFINISHED_FILE).exists() {
        let message = "the last run here has not finished: run it again";
        findings.push(Finding::new(KIND, UNFINISHED_FILE, Answer::Fails, message));
    }

    let digests = match Digests::read(results) {
        Ok(Some(digests)) => digests,
        Ok(None) => {
            let message = "no digests were noted: the results are of an earlier version, or the file is lost";
            findings.push(Finding::new(KIND, DIGESTS, Answer::Open, message));
            return Ok(findings);
        }
        Err(error) => {
            findings.push(Finding::new(KIND, DIGESTS, Answer::Fails, error.to_string()));
            return Ok(findings);
        }
    };
    let mut agree = 0;
    progress.begin("digests", digests.iter().count() as u64);

    for (file, digest) in digests.iter() {
        progress.check()?;
        let path = results.join(file);
        let fails = |message: String| Finding::of(file, KIND, Answer::Fails, message);
        match (path.is_file(), file_digest(&path)) {
            (false, _) => findings.push(fails("is missing".to_owned())),
            (true, Err(error)) => findings.push(fails(error.to_string())),
            (true, Ok(found)) if found == digest => agree += 1,
            (true, Ok(_)) => findings.push(fails("was changed or damaged after the run".to_owned())),
        }
        progress.advance(1);
    }

    for file in named_results_in(results)? {
        if file != Path::new(DIGESTS) && !digests.holds(&file) {
            let message = "has the name of a result, but the run did not make it";
            findings.push(Finding::of(&file, KIND, Answer::Open, message));
        }
    }

    let message = format!("{agree} files are as the run left them");
    findings.push(Finding::new(KIND, DIGESTS, Answer::Holds, message));
    Ok(findings)
}
