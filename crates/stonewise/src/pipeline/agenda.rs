//! The list of steps that a run announces before it begins.

use crate::pipeline::until::Until;
use crate::project::Project;
use crate::settings::Estimator;
use stonewise_core::progress::Progress;

/// Name of the steps that edit labels, before their numbers.
const EDITS: &str = "edit";

/// The steps of a run in order: each under the name that the runner gives it, and in words. Work that is not
/// on the list counts as part of the step before it.
#[derive(Debug, Default)]
pub struct Agenda(Vec<(String, String)>);

impl Agenda {
    /// The steps of a run that goes so far.
    pub fn of(project: &Project, until: Until) -> Self {
        let mut agenda = Self(vec![("check".to_owned(), "check of the survey".to_owned())]);
        let last = project.epochs.len();
        agenda.push(project, 1..=last, "ingest", "clouds of");
        agenda.push(project, 1..=last, "segment", "stones in the photos of");
        if until >= Until::Labelled {
            agenda.push(project, 1..=last, "label", "stones in the clouds of");
        }
        if until >= Until::Labelled && project.edits.is_some() {
            agenda.0.push((EDITS.to_owned(), "edits by hand".to_owned()));
        }
        if until >= Until::Matched {
            agenda.0.push(("outlines".to_owned(), "outlines".to_owned()));
        }
        for number in 2..=last {
            agenda.push_pair(project, number, until);
        }
        if until == Until::Reported {
            let excerpts = "excerpts for the report".to_owned();
            agenda.0.push(("evidence".to_owned(), excerpts));
        }
        if matches!(until, Until::Labelled | Until::Reported) {
            agenda.push(project, 1..=last, "clouds", "labelled clouds of");
        }
        if until == Until::Reported {
            agenda.0.push(("report".to_owned(), "report".to_owned()));
        }
        agenda
    }

    /// The steps of a comparison of two clouds: those of `epochs` are cut into tiles, then comes `compare`
    /// under the name `step`.
    pub fn of_clouds(
        project: &Project,
        epochs: std::ops::RangeInclusive<usize>,
        step: &str,
        compare: &str,
    ) -> Self {
        let mut agenda = Self::default();
        agenda.push(project, epochs, "ingest", "clouds of");
        agenda.0.push((step.to_owned(), compare.to_owned()));
        agenda
    }

    /// Tells the list to the caller, and that its first step begins.
    pub fn announce(&self, progress: &dyn Progress) {
        let words: Vec<String> = self.0.iter().map(|(_, words)| words.clone()).collect();
        progress.agenda(&words);
        progress.enter(0);
    }

    /// Place of a step in the list, counted from 0.
    pub fn place(&self, step: &str) -> Option<usize> {
        // Edits are one step for a reader, whichever epochs they touch.
        let is_edit = step.strip_prefix(EDITS).is_some_and(|rest| rest.starts_with('-'));
        let wanted = if is_edit { EDITS } else { step };
        self.0.iter().position(|(name, _)| name == wanted)
    }

    /// The steps of a later epoch.
    fn push_pair(&mut self, project: &Project, number: usize, until: Until) {
        let only = number..=number;
        if until >= Until::Matched {
            self.push(project, only.clone(), "match", "matches of");
        }
        if until >= Until::Registered {
            let words = match project.settings.registration.estimator {
                Estimator::Adjustment => "adjustment of",
                Estimator::Gicp => "GICP of",
            };
            self.push(project, only.clone(), "register", words);
        }
        if until >= Until::Compared {
            self.push(project, only, "m3c2", "M3C2 of");
        }
    }

    fn push(&mut self, project: &Project, numbers: std::ops::RangeInclusive<usize>, step: &str, words: &str) {
        for number in numbers {
            let epoch = &project.epochs[number - 1].name;
            self.0
                .push((format!("{step}-{number}"), format!("{words} {epoch}")));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_step_of_a_run_is_named_with_its_epoch() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("stonewise.toml");
        let epoch = |name: &str| {
            std::fs::write(folder.path().join(format!("{name}.xyz")), "0 0 0\n").unwrap();
            std::fs::write(folder.path().join("cameras.json"), "[]").unwrap();
            format!(
                "[[epochs]]\nname = \"{name}\"\nclouds = [\"{name}.xyz\"]\nimages = \".\"\ncameras = \"cameras.json\"\n"
            )
        };
        let text = format!(
            "[project]\nname = \"Wall\"\n{}{}{}",
            epoch("2024"),
            epoch("2025"),
            epoch("2026")
        );
        std::fs::write(&path, text).unwrap();
        let project = Project::read(&path).unwrap();
        let words = |until| {
            Agenda::of(&project, until)
                .0
                .into_iter()
                .map(|(_, words)| words)
                .collect::<Vec<_>>()
        };
        assert_eq!(
            words(Until::Segmented),
            [
                "check of the survey",
                "clouds of 2024",
                "clouds of 2025",
                "clouds of 2026",
                "stones in the photos of 2024",
                "stones in the photos of 2025",
                "stones in the photos of 2026"
            ]
        );
        let all = words(Until::Reported);
        assert_eq!(all.len(), 1 + 3 * 3 + 1 + 2 * 3 + 1 + 3 + 1);
        let place = |word: &str| all.iter().position(|w| w == word).unwrap();
        assert!(place("adjustment of 2026") > place("M3C2 of 2025"));
        assert!(words(Until::Labelled).last().unwrap() == "labelled clouds of 2026");
        let agenda = Agenda::of(&project, Until::Reported);
        assert_eq!(agenda.place("register-3"), Some(place("adjustment of 2026")));
        assert_eq!((agenda.place("verdict"), agenda.place("check")), (None, Some(0)));
    }
}
