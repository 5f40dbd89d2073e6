//! What the API takes and gives, beside what other modules show.

use crate::elsewhere::Unfinished;
use crate::epochs::EpochShown;
use crate::project_text::Step;
use crate::stable::StableShown;
use crate::work::RunShown;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use stonewise::edits::Edit;

/// `GET /state`, and every event of `GET /events`.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct State {
    /// Whether nothing can be changed.
    pub view: bool,
    /// Whether that is so because the project lies outside the folder that was opened; `POST /allow` ends it.
    pub read_only: bool,
    /// The project file, and the folder of the results.
    pub project_file: Option<String>,
    /// Where results go.
    pub results_folder: String,
    /// Whether the project file is there.
    pub has_project: bool,
    /// When the report was written, a number that changes with it; absent where there is none.
    pub report: Option<String>,
    /// Whether edits or the project changed after the report was written.
    pub is_outdated: bool,
    /// When a trained detector was offered, a number that changes with it; absent where none is.
    pub offer: Option<String>,
    /// The run.
    pub run: RunShown,
    /// A run that was started elsewhere and has not finished.
    pub elsewhere: Option<Unfinished>,
    /// The look at the survey.
    pub check: CheckShown,
    /// The number of the project file's version: it changes with every change of the file.
    pub project_version: String,
}

/// The look at the survey that goes on by itself.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct CheckShown {
    /// Whether it goes on.
    pub is_running: bool,
    /// Whether it has ended, so that there are findings and a page with pictures (`/check`).
    pub is_done: bool,
    /// What it found.
    pub findings: Vec<FindingShown>,
    /// Why it could not be done.
    pub error: Option<String>,
}

/// What a finding means for a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Weight {
    /// As it should be.
    Fine,
    /// Worth knowing.
    Note,
    /// The results may be wrong.
    Doubt,
    /// The results would be wrong.
    Wrong,
    /// An input cannot be read.
    Unreadable,
}

/// A finding of the look at the survey.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct FindingShown {
    /// The epoch; empty where it is about all of them.
    pub epoch: String,
    /// What it means.
    pub weight: Weight,
    /// What was looked at, in the project's language.
    pub text: String,
}

/// `GET /project`: the project file.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ProjectShown {
    /// Its values, as TOML holds them.
    pub values: Value,
    /// Its epochs; none where the file is not valid.
    pub epochs: Vec<EpochShown>,
    /// Its stable areas.
    pub stable: Vec<StableShown>,
    /// What is wrong with the file.
    pub mistake: Option<MistakeShown>,
    /// Where there is no file: the file that would be written, and why it is this one.
    pub proposal: Option<ProposalShown>,
}

/// A project file for what lies in the folder.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ProposalShown {
    /// Its text.
    pub text: String,
    /// What was chosen and what was left out, one line each.
    pub lines: Vec<String>,
}

/// Why a request was refused; the body of every error.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct MistakeShown {
    /// What is wrong, and the fix.
    pub message: String,
    /// The line of the project file.
    pub line: Option<usize>,
    /// The way to the value that is wrong.
    pub way: Vec<Step>,
}

/// `PATCH /project`: changes that hold together or not at all.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProjectChanges {
    /// The changes, one after the other.
    pub changes: Vec<Change>,
}

/// A change of the project file.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Change {
    /// The way to the value.
    pub way: Vec<Step>,
    /// The value; `null` removes it.
    pub value: Value,
}

/// `GET /edits`, and the answer to every act: the corrections by hand.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct EditsShown {
    /// The edits, as the file of edits holds them.
    pub edits: Vec<Edit>,
    /// Whether there is an act to undo.
    pub can_undo: bool,
    /// Whether there is an undone act.
    pub can_redo: bool,
}

/// `POST /edits`: edits that are one act and are undone together.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NewEdits {
    /// A name that no other act has: an act that is sent again counts once.
    pub id: String,
    /// The edits; `when` may be empty: now.
    pub edits: Vec<Edit>,
}

/// `POST /edits/undo` and `POST /edits/redo`.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Act {
    /// A name that no other act has.
    pub id: String,
}
