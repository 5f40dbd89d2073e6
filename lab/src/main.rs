//! Programs that produce the figures of docs/, and what tests of other languages need; README.md lists them.

mod detector;
mod figures;
mod projjson;
mod sample_report;
mod speed;
mod table;
mod words;
mod yardstick;

use words::Words;

/// What a program says in the end.
type Outcome = Result<(), Box<dyn std::error::Error>>;

/// Name and start of a program.
type Program = (&'static str, fn(&Words) -> Outcome);

const PROGRAMS: [Program; 12] = [
    ("yardstick", yardstick::run),
    ("series-time", speed::series_time::run),
    ("projjson", projjson::run),
    ("kept-walls", detector::kept_walls::run),
    ("overfit", detector::overfit::run),
    ("step-time", detector::step_time::run),
    ("training-crops", detector::training_crops::run),
    ("instances", detector::instances::run),
    ("comparisons", speed::comparisons::run),
    ("tiles", speed::tiles::run),
    ("clouds", speed::clouds::run),
    ("sample-report", sample_report::run),
];

fn main() -> Outcome {
    let (name, words) = Words::of_this_program();
    match PROGRAMS.iter().find(|program| program.0 == name) {
        Some((_, run)) => run(&words),
        None => {
            let names = PROGRAMS.map(|program| program.0).join(", ");
            Err(format!("name one of the programs {names}; lab/README.md says what each does").into())
        }
    }
}
