//! Who made an edit, when and why.

use super::edits_file::{Action, Edit};

/// Who made edits, when and why, where the file from which they come does not say it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Signed {
    /// Name.
    pub who: String,
    /// Date, YYYY-MM-DD, with a time or without.
    pub when: String,
    /// Reason.
    pub why: String,
}

impl Signed {
    /// An edit of this person without a shape yet.
    pub(super) fn edit(self, action: Action) -> Edit {
        Edit {
            action,
            photo: None,
            epoch: None,
            epochs: None,
            at: Vec::new(),
            line: Vec::new(),
            outline: Vec::new(),
            corners: Vec::new(),
            who: self.who,
            when: self.when,
            why: self.why,
        }
    }
}
