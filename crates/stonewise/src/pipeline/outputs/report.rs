//! The report, and the layers for other programs: both are made from the result files alone.

use super::clouds::CLOUDS;
use super::edits::tell_steps;
use super::evidence::EVIDENCE;
use super::face_cloud::FACE_CLOUD;
use super::instruments::INSTRUMENTS;
use super::run_record::RECORD;
use super::series::SERIES;
use crate::export::write_layers;
use crate::pipeline::cost::Cost;
use crate::pipeline::graph::{Need, Phase, Step};
use crate::pipeline::steps::evaluate::EVALUATE;
use crate::pipeline::until::Until;
use crate::report::write_report;
use stonewise_core::epoch::EpochId;

/// Writes the report. Its unit is the last of a plan, and does whatever is no unit of its own.
pub static REPORT: Step = Step {
    name: "report",
    phase: Some(Phase::Write),
    needs: &[
        Need::same(&RECORD),
        Need::same(&EVIDENCE),
        Need::same(&FACE_CLOUD),
        Need::same(&SERIES),
        Need::same(&INSTRUMENTS),
        Need::all(&CLOUDS),
        Need::all(&EVALUATE),
    ],
    wanted: |until| until == Until::Reported,
    cost: Some(|sizes, _| {
        let clouds = sizes.points.ids().map(|epoch| sizes.cloud_bytes(epoch));
        Cost::of(2, clouds.sum())
    }),
    make: |run, _| {
        let context = run.context;
        let write = || {
            tell_steps(context);
            context.timed("report", || write_report(&context.out))
        };
        run.once(&REPORT, EpochId::REFERENCE, write).map(drop)
    },
    ..Step::PLAIN
};

/// Writes the layers for GIS and viewers of clouds.
pub static LAYERS: Step = Step {
    name: "layers",
    needs: &[Need::same(&RECORD)],
    wanted: |until| until == Until::Reported,
    make: |run, _| run.context.timed("layers", || write_layers(&run.context.out)),
    ..Step::PLAIN
};
