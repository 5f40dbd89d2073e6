//! The list of steps that a run announces before it begins.

use stonewise_core::progress::Progress;

/// The steps that a reader is told of, in order. Work that is not on the list counts as part of the step before it.
#[derive(Debug, Default)]
pub struct Agenda {
    /// In words.
    steps: Vec<String>,
    /// Pieces of work by name, each with the place of its step.
    places: Vec<(String, usize)>,
}

impl Agenda {
    /// Pieces of work, each by its name and with the step that it belongs to, in words.
    pub fn of(work: impl IntoIterator<Item = (String, String)>) -> Self {
        let mut agenda = Self::default();
        for (name, words) in work {
            let known = agenda.steps.iter().position(|step| *step == words);
            let place = known.unwrap_or(agenda.steps.len());
            if known.is_none() {
                agenda.steps.push(words);
            }
            agenda.places.push((name, place));
        }
        agenda
    }

    /// Tells the list to the caller, and that its first step begins.
    pub fn announce(&self, progress: &dyn Progress) {
        progress.agenda(&self.steps);
        progress.enter(0);
    }

    /// Place of the step that a piece of work belongs to, counted from 0.
    pub fn place(&self, name: &str) -> Option<usize> {
        let listed = self.places.iter().find(|(listed, _)| listed == name);
        listed.map(|(_, place)| *place)
    }
}
