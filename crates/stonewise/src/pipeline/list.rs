//! The list of all steps, and the walk over those that a run does. A new step is a file and a line here.

use super::agenda::Agenda;
use super::graph::{About, Step, Task};
use super::until::Until;
use super::{doubts, outputs, steps};
use crate::project::Project;
use stonewise_core::epoch::EpochId;

/// All steps, each after those that it needs.
pub static STEPS: &[&Step] = &[
    &steps::check::CHECK,
    &steps::ingest::INGEST,
    &steps::overlap::OVERLAP,
    &steps::views::VIEWS,
    &steps::segment::CHOOSE,
    &steps::segment::SEGMENT,
    &steps::label::LABEL,
    &steps::label::ALIGN,
    &steps::label::STONES,
    &steps::join::JOIN,
    &steps::carry::CARRY,
    &steps::confirm::CONFIRM,
    &steps::edit::EDIT,
    &outputs::audits::AUDITS,
    &outputs::outlines::OUTLINES,
    &steps::panels::PANELS,
    &steps::r#match::MATCH,
    &steps::offsets::OFFSETS,
    &steps::register::REGISTER,
    &steps::measure::MEASURE,
    &doubts::DOUBTS,
    &outputs::tables::TABLES,
    &steps::m3c2::M3C2,
    &steps::change::CHANGE,
    &steps::evaluate::EVALUATE,
    &outputs::zones::ZONES,
    &outputs::instruments::INSTRUMENTS,
    &steps::tracks::TRACKS,
    &outputs::trends::TRENDS,
    &outputs::verdict::VERDICT,
    &outputs::influence::INFLUENCE,
    &outputs::evidence::EVIDENCE,
    &outputs::clouds::CLOUDS,
    &outputs::face_cloud::FACE_CLOUD,
    &outputs::series::SERIES,
    &outputs::run_record::RECORD,
    &outputs::report::REPORT,
    &outputs::report::LAYERS,
];

/// The tasks of a run that goes so far, each after those that it needs.
///
/// Neighbouring steps of later epochs are done epoch by epoch, those of all epochs step by step, together with
/// steps behind them that are of no phase.
pub fn tasks(project: &Project, until: Until) -> Vec<Task> {
    let epochs = &project.epochs;
    let of_block = |block: &[&'static Step]| -> Vec<Task> {
        let of_epoch = |epoch: EpochId, steps: &[&'static Step]| -> Vec<Task> {
            steps.iter().map(|&step| Task { step, epoch }).collect()
        };
        match block[0].about {
            About::Survey => of_epoch(EpochId::REFERENCE, block),
            About::Epoch => block
                .chunk_by(|_, next| next.phase.is_none())
                .flat_map(|steps| epochs.ids().flat_map(move |epoch| of_epoch(epoch, steps)))
                .collect(),
            About::Later => epochs
                .later_ids()
                .flat_map(|epoch| of_epoch(epoch, block))
                .collect(),
        }
    };
    let blocks = STEPS.chunk_by(|a, b| a.about == b.about);
    let mut all: Vec<Task> = blocks.flat_map(of_block).collect();
    all.retain(|task| (task.step.wanted)(until) && (task.step.applies)(project, task.epoch));
    all
}

/// What a run that goes so far announces.
pub fn agenda(project: &Project, until: Until) -> Agenda {
    Agenda::of(
        tasks(project, until)
            .iter()
            .filter_map(|task| Some((task.id(), task.words(project)?))),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::graph::Of;
    use crate::report_params::Language;

    /// A project of three epochs, of which these have masks.
    fn project(folder: &std::path::Path, masked: &[&str]) -> Project {
        let path = folder.join("stonewise.toml");
        std::fs::write(folder.join("cameras.json"), "[]").unwrap();
        std::fs::write(folder.join("masks.json"), "{}").unwrap();
        let epoch = |name: &str| {
            std::fs::write(folder.join(format!("{name}.xyz")), "0 0 0\n").unwrap();
            let masks = if masked.contains(&name) {
                "masks = \"masks.json\"\n"
            } else {
                ""
            };
            format!(
                "[[epochs]]\nname = \"{name}\"\nclouds = [\"{name}.xyz\"]\nimages = \".\"\n{masks}cameras = \"cameras.json\"\n"
            )
        };
        let epochs = ["2024", "2025", "2026"].map(epoch).concat();
        std::fs::write(&path, format!("[project]\nname = \"Wall\"\n{epochs}")).unwrap();
        Project::read(&path).unwrap()
    }

    #[test]
    fn a_run_has_six_steps_and_those_of_a_pair_come_epoch_by_epoch() {
        let folder = tempfile::tempdir().unwrap();
        let mut project = project(folder.path(), &["2024"]);
        let named = |project: &Project| {
            let all = tasks(project, Until::Reported);
            let mut words: Vec<String> = all.iter().filter_map(|task| task.words(project)).collect();
            words.dedup();
            words
        };
        assert_eq!(
            named(&project),
            [
                "read the survey",
                "find the stones",
                "match the stones (2025)",
                "measure the motions (2025)",
                "compare the clouds (2025)",
                "match the stones (2026)",
                "measure the motions (2026)",
                "compare the clouds (2026)",
                "write the results",
            ]
        );
        let all = agenda(&project, Until::Reported);
        assert_eq!((all.place("register-3"), all.place("verdict")), (Some(6), None));
        project.epochs.truncate(2);
        let agenda = agenda(&project, Until::Reported);
        assert_eq!(named(&project).len(), 6);
        let names = ["check", "carry-2", "match-2", "register-2", "m3c2-2", "report"];
        assert_eq!(names.map(|name| agenda.place(name)), [0, 1, 2, 3, 4, 5].map(Some));
    }

    /// The list of steps as the documentation has it.
    fn table() -> String {
        let lines = STEPS.iter().map(|step| {
            let words = step.phase.map_or("", |phase| phase.words(Language::English));
            let about = match step.about {
                About::Survey => "survey",
                About::Epoch => "epoch",
                About::Later => "later epoch",
            };
            let unit = match (&step.cost, &step.photos) {
                (_, Some(_)) => "yes, and each photo",
                (Some(_), None) => "yes",
                (None, None) => "no",
            };
            let cells = [
                format!("`{}`", step.name),
                words.to_owned(),
                about.to_owned(),
                needs(step),
                unit.to_owned(),
                runs(step),
            ];
            format!("| {} |\n", cells.join(" | "))
        });
        lines.collect()
    }

    fn needs(step: &Step) -> String {
        let needs = step.needs.iter().map(|need| {
            let whose = match need.of {
                Of::Same => "",
                Of::Reference => " of the reference",
                Of::FirstLater => " of the first later epoch",
                Of::All => " of all",
            };
            format!("`{}`{whose}", need.step.name)
        });
        let needs: Vec<String> = needs.collect();
        if needs.is_empty() {
            "–".to_owned()
        } else {
            needs.join(", ")
        }
    }

    fn runs(step: &Step) -> String {
        let all = [
            Until::Segmented,
            Until::Labelled,
            Until::Matched,
            Until::Registered,
            Until::Compared,
            Until::Reported,
        ];
        let wanted: Vec<Until> = all.into_iter().filter(|until| (step.wanted)(*until)).collect();
        let name = |until: &Until| format!("`{until:?}`").to_lowercase();
        match all.ends_with(&wanted) {
            true if wanted.len() == all.len() => "all".to_owned(),
            true => format!("from {}", name(&wanted[0])),
            false => wanted.iter().map(name).collect::<Vec<_>>().join(", "),
        }
    }

    #[test]
    fn the_documentation_lists_the_steps_as_they_are() {
        let docs = include_str!("../../../../docs/src/units.md");
        let table = table();
        let missing: Vec<&str> = table.lines().filter(|line| !docs.contains(line)).collect();
        assert!(
            docs.contains(&table),
            "docs/src/units.md lacks, or has in another order:\n{}",
            missing.join("\n")
        );
    }

    #[test]
    fn every_step_comes_after_those_that_it_needs() {
        for (place, step) in STEPS.iter().enumerate() {
            for need in step.needs {
                let before = STEPS[..=place].iter().any(|other| other.name == need.step.name);
                assert!(before, "{} needs {}", step.name, need.step.name);
            }
        }
    }
}
