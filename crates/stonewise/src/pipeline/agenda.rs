//! The list of steps that a run announces before it begins.

use stonewise_core::progress::Progress;

/// The steps of a run in order: each by its name, and in words. Work that is not on the list counts as part
/// of the step before it.
#[derive(Debug, Default)]
pub struct Agenda(Vec<(String, String)>);

impl Agenda {
    /// These steps, by name and in words, but for those that have no words.
    pub fn of(steps: impl IntoIterator<Item = (String, String)>) -> Self {
        Self(steps.into_iter().filter(|(_, words)| !words.is_empty()).collect())
    }

    /// Tells the list to the caller, and that its first step begins.
    pub fn announce(&self, progress: &dyn Progress) {
        let words: Vec<String> = self.0.iter().map(|(_, words)| words.clone()).collect();
        progress.agenda(&words);
        progress.enter(0);
    }

    /// Place of a step in the list, counted from 0.
    pub fn place(&self, name: &str) -> Option<usize> {
        self.0.iter().position(|(listed, _)| listed == name)
    }
}
