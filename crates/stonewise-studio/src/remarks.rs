//! What people say of the results: remarks, the signature, and the report on paper.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::{env, fs, process};
use stonewise::results::names::REMARKS;
use stonewise::results::records::{Remark, Remarks, Signature, Timestamp, signed_digest};
use stonewise::{Error, OutputFolder, Result};
use stonewise_base::files::write_readable_json;
use stonewise_core::progress::Silent;

/// Longest text of a remark, name and place, characters.
const LONGEST: [usize; 2] = [4000, 200];

/// `GET /remarks`, and the answer to every change of them.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct RemarksShown {
    /// In the order in which they were made.
    pub remarks: Vec<RemarkShown>,
    /// Who signed.
    pub signature: Option<SignatureShown>,
}

/// A remark.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct RemarkShown {
    /// What it says, and of what.
    pub said: NewRemark,
    /// When it was made, ISO 8601.
    pub when: String,
}

/// `POST /remarks`: a remark on a stone, on a zone of deformation, or on the wall.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NewRemark {
    /// The stone.
    pub stone: Option<u32>,
    /// The zone; with neither, it is about the wall.
    pub zone: Option<u32>,
    /// Name of the later epoch whose report prints it; empty: every report.
    pub epoch: String,
    /// Who makes it.
    pub who: String,
    /// What is said.
    pub text: String,
}

/// `DELETE /remarks`: the remark that was made at this time.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OldRemark {
    /// When it was made, as the list has it.
    pub when: String,
}

/// `POST /signature`.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NewSignature {
    /// Who signs.
    pub who: String,
    /// Where; may be empty.
    pub place: String,
}

/// A signature.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct SignatureShown {
    /// Who signed.
    pub who: String,
    /// Where.
    pub place: String,
    /// When, ISO 8601.
    pub when: String,
    /// Whether it is under the results as they are now.
    pub holds: bool,
}

/// What was said of these results.
///
/// # Errors
/// The file is damaged, or a result file cannot be read.
pub fn shown(results: &Path) -> Result<RemarksShown> {
    let all = Remarks::read(results)?;
    let holds = all.is_signed(results)?;
    let remark = |remark: Remark| RemarkShown {
        when: remark.when.to_string(),
        said: NewRemark {
            stone: remark.stone,
            zone: remark.zone,
            epoch: remark.epoch,
            who: remark.who,
            text: remark.text,
        },
    };
    let signature = |of: Signature| SignatureShown {
        who: of.who,
        place: of.place,
        when: of.when.to_string(),
        holds,
    };
    Ok(RemarksShown {
        remarks: all.remarks.into_iter().map(remark).collect(),
        signature: all.signature.map(signature),
    })
}

/// Adds a remark.
///
/// # Errors
/// It says nothing or too much, a run is at work, or the files cannot be written.
pub fn add(results: &Path, new: NewRemark) -> Result<()> {
    let [text, name] = LONGEST;
    bounded("text", &new.text, text)?;
    bounded("name", &new.who, name)?;
    change(results, |all| {
        // The time tells remarks from each other.
        let mut when = Timestamp::now();
        while all.remarks.iter().any(|remark| remark.when == when) {
            when = when.next();
        }
        all.remarks.push(Remark {
            stone: new.stone,
            zone: new.zone,
            epoch: new.epoch,
            who: new.who,
            when,
            text: new.text,
        });
        Ok(())
    })
}

/// Takes a remark away.
///
/// # Errors
/// There is none of this time, a run is at work, or the files cannot be written.
pub fn remove(results: &Path, old: &OldRemark) -> Result<()> {
    change(results, |all| {
        let before = all.remarks.len();
        all.remarks.retain(|remark| remark.when.to_string() != old.when);
        match all.remarks.len() < before {
            true => Ok(()),
            false => Err(Error::Parameters(format!("no remark was made at {}", old.when))),
        }
    })
}

/// Signs the results as they are; an earlier signature goes.
///
/// # Errors
/// Nobody is named, a run is at work, or the files cannot be written.
pub fn sign(results: &Path, new: NewSignature) -> Result<()> {
    let [_, name] = LONGEST;
    bounded("name", &new.who, name)?;
    if new.place.chars().count() > name {
        return Err(Error::Parameters(format!(
            "the place is longer than {name} characters"
        )));
    }
    change(results, |all| {
        all.signature = Some(Signature {
            who: new.who,
            place: new.place,
            when: Timestamp::now(),
            blake3: signed_digest(results)?,
        });
        Ok(())
    })
}

/// Takes the signature away.
///
/// # Errors
/// A run is at work, or the files cannot be written.
pub fn unsign(results: &Path) -> Result<()> {
    change(results, |all| {
        all.signature = None;
        Ok(())
    })
}

/// The report with its appendix as PDF.
///
/// # Errors
/// No browser is installed, or it fails.
pub fn pdf(results: &Path) -> Result<Vec<u8>> {
    static NUMBER: AtomicU64 = AtomicU64::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let path = env::temp_dir().join(format!("stonewise-{}-{number}.pdf", process::id()));
    let print = || {
        stonewise::report::Pdf::at(&path, false)?.write(results, true, &Silent)?;
        fs::read(&path).map_err(Error::io("reading", &path))
    };
    let bytes = print();
    // It may not have been made.
    let _ = fs::remove_file(&path);
    bytes
}

fn bounded(what: &str, text: &str, longest: usize) -> Result<()> {
    if text.trim().is_empty() {
        return Err(Error::Parameters(format!("the {what} is missing")));
    }
    if text.chars().count() > longest {
        return Err(Error::Parameters(format!(
            "the {what} is longer than {longest} characters"
        )));
    }
    Ok(())
}

/// Changes the file, whole or not at all, and makes the report again, while no run writes into the folder.
fn change(results: &Path, change: impl FnOnce(&mut Remarks) -> Result<()>) -> Result<()> {
    let folder = OutputFolder::of_results(results)?;
    let mut all = Remarks::read(results)?;
    change(&mut all)?;
    write_readable_json(&results.join(REMARKS), &all)?;
    stonewise::report::write_report(results)?;
    folder.note_made_anew()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_remark_without_words_or_name_and_one_too_long_are_refused() {
        let said = |who: &str, text: &str| NewRemark {
            stone: None,
            zone: None,
            epoch: String::new(),
            who: who.to_owned(),
            text: text.to_owned(),
        };
        let dir = tempfile::tempdir().unwrap();
        for (new, part) in [
            (said("A", " "), "text is missing"),
            (said("", "x"), "name is missing"),
            (said("A", &"x".repeat(4001)), "longer than 4000"),
        ] {
            let error = add(dir.path(), new).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
        // Where there are no results, nothing is said of them.
        let error = add(dir.path(), said("A", "x")).unwrap_err();
        assert!(matches!(error, Error::NoResults(_)) && !dir.path().join(REMARKS).exists());
    }
}
