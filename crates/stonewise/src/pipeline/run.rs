//! The method, from surveys to results.

use crate::error::{Error, Result};
use crate::export::write_layers;
use crate::files::write_readable_json;
use crate::output::OutputFolder;
use crate::pipeline::agenda::Agenda;
use crate::pipeline::context::Context;
use crate::pipeline::doubts::note_doubts;
use crate::pipeline::look::look;
use crate::pipeline::outputs::audit::write_audit;
use crate::pipeline::outputs::carried::write_carry_audit;
use crate::pipeline::outputs::clouds::write_clouds;
use crate::pipeline::outputs::crs::coordinate_system;
use crate::pipeline::outputs::edits::{tell_steps, write_edits_audit};
use crate::pipeline::outputs::evidence::{write_evidence, write_tracked_stones};
use crate::pipeline::outputs::face_cloud::write_face_cloud;
use crate::pipeline::outputs::m3c2::write_m3c2;
use crate::pipeline::outputs::outlines::write_stone_outlines;
use crate::pipeline::outputs::run_record::write_run_record;
use crate::pipeline::outputs::series::write_series;
use crate::pipeline::outputs::stone_rows::{motion_in_common, stone_rows};
use crate::pipeline::outputs::verdict::write_verdict;
use crate::pipeline::steps::carry::{carry, drop_contradictions};
use crate::pipeline::steps::edit::{Edited, edit};
use crate::pipeline::steps::evaluate::evaluate;
use crate::pipeline::steps::ingest::{Ingested, ingest};
use crate::pipeline::steps::join::join;
use crate::pipeline::steps::label::{Labelled, label};
use crate::pipeline::steps::m3c2::{m3c2, with_datum};
use crate::pipeline::steps::r#match::{Matched, r#match};
use crate::pipeline::steps::offsets::label_offsets;
use crate::pipeline::steps::register::{Registered, register};
use crate::pipeline::steps::segment::{Segmented, segment};
use crate::pipeline::units::forget;
use crate::pipeline::until::Until;
use crate::project::Project;
use crate::report::write_report;
use crate::results::names::PairFile;
use crate::results::records::{Datum, DatumState, ObserversRecord, RegistrationRecord, Verdict};
use crate::results::{
    Facade, StoneOutline, StoneRow, facade_of, read_outlines, write_neighbours, write_stones,
};
use crate::texts::notices::REGISTRATION_UNKNOWN;
use crate::warnings::Warning;
use nalgebra::Point3;
use std::collections::BTreeMap;
use stonewise_core::change::OutwardReference;
use stonewise_core::cloud::TileSource;
use stonewise_core::evaluate::Evaluation;
use stonewise_core::geometry::{Bounds, View};
use stonewise_core::progress::Progress;
use stonewise_core::stone::Stone;

/// What a run did.
#[derive(Clone, Debug)]
pub struct Summary {
    /// What went wrong without stopping the run.
    pub warnings: Vec<Warning>,
    /// Each later epoch against the first.
    pub pairs: Vec<PairSummary>,
    /// The verdict; `None` where the run did not go so far.
    pub verdict: Option<Verdict>,
}

/// What came out for a later epoch against the first.
#[derive(Clone, Debug, Default)]
pub struct PairSummary {
    /// One row for each stone of the first epoch; empty where the run did not go so far.
    pub rows: Vec<StoneRow>,
    /// What is known about the registration of the epoch; `None` where the run did not go so far.
    pub datum: Option<Datum>,
    /// Where the project prescribes the motion, and the run went so far.
    pub evaluation: Option<Evaluation>,
}

impl Summary {
    /// Whether an input was left out.
    pub fn skipped_inputs(&self) -> bool {
        self.warnings.iter().any(|w| w.skipped_input)
    }

    /// Why the results as a whole cannot be relied on; none where they can, as far as the intervals say.
    pub fn doubts(&self) -> impl Iterator<Item = &Warning> {
        self.warnings.iter().filter(|w| w.doubt)
    }
}

/// Runs a project up to the step `until`, in the folder `out`; takes over whatever an earlier run finished
/// there.
///
/// Results of an earlier run lie aside until this one has finished.
///
/// ```no_run
/// use std::path::Path;
/// use stonewise::results::ResultSet;
/// use stonewise::{OutputFolder, Project, Until, run};
/// use stonewise_core::progress::Silent;
///
/// let (project, out) = (Project::read(Path::new("survey/stonewise.toml"))?, Path::new("results"));
/// let folder = OutputFolder::of_project(out, &project, false)?;
/// let summary = run(&project, &folder, Until::Reported, &Silent)?;
/// println!("{} warnings", summary.warnings.len());
/// for stone in &ResultSet::read(out)?.stones {
///     println!("{} {:?}", stone.stone_id, stone.motion.as_ref().map(|m| m.displacement));
/// }
/// # Ok::<(), stonewise::Error>(())
/// ```
///
/// # Errors
/// An input that cannot be used, epochs that do not overlap, a full disk, interruption. Finished steps stay,
/// and the same call continues from there.
pub fn run(project: &Project, out: &OutputFolder, until: Until, progress: &dyn Progress) -> Result<Summary> {
    forget(out.path())?;
    out.begin_results(project)?;
    let mut context = Context::new(project, out, progress)?;
    context.agenda = Agenda::of(project, until);
    context.agenda.announce(progress);
    look(&context, out.is_forced())?;
    let summary = run_in(&context, until)?;
    out.finish_results(until == Until::Reported)?;
    Ok(summary)
}

/// The same in a context of the caller's.
pub(crate) fn run_in(context: &Context, until: Until) -> Result<Summary> {
    let epochs = 1..=context.project.epochs.len();
    let ingested = epochs
        .clone()
        .map(|n| ingest(context, n))
        .collect::<Result<Vec<_>>>()?;
    check_overlap(context, &ingested.iter().zip(1..).collect::<Vec<_>>())?;
    let photos = all_photos(context)?;
    if until == Until::Segmented {
        return Ok(summary(context, Vec::new()));
    }
    let labelled = all_labelled(context, ingested, &photos)?;
    let labelled = join(context, &photos, labelled)?;
    let (labelled, attempts) = carry(context, &photos, labelled)?;
    write_carry_audit(context, &attempts)?;
    let (labelled, edited) = edit(context, &photos, labelled)?;
    write_edits_audit(context, edited.as_ref())?;
    for number in epochs.clone() {
        write_audit(context, number, &photos[number - 1], &labelled[number - 1])?;
    }
    if until == Until::Labelled {
        epochs
            .clone()
            .try_for_each(|n| write_clouds(context, n, &labelled[n - 1], None))?;
        return Ok(summary(context, Vec::new()));
    }
    let (outlines, facade) = outlined(context, &labelled[0], edited)?;
    let mut pairs = Vec::new();
    for number in epochs.clone().skip(1) {
        pairs.push(measure(context, &photos, &labelled, &facade, number, until)?);
    }
    if until == Until::Matched {
        return Ok(summary(context, pairs));
    }
    let verdict = context.timed("verdict", || write_verdict(context, pairs.len()))?;
    if until < Until::Reported {
        write_run_record(context, &photos, &labelled, &datums(&pairs), &verdict)?;
        return Ok(Summary {
            verdict: Some(verdict),
            ..summary(context, pairs)
        });
    }
    let rows: Vec<&[StoneRow]> = pairs.iter().map(|pair| pair.rows.as_slice()).collect();
    context.timed("evidence", || {
        write_evidence(context, &photos, &labelled, &outlines, &rows)
    })?;
    for number in epochs {
        let rows = if number == 1 {
            pairs.first().map(|pair| pair.rows.as_slice())
        } else {
            None
        };
        write_clouds(context, number, &labelled[number - 1], rows)?;
    }
    if let Some(rows) = rows.first() {
        context.timed("face cloud", || write_face_cloud(context, &labelled[0], rows))?;
    }
    write_series(context, &rows)?;
    write_run_record(context, &photos, &labelled, &datums(&pairs), &verdict)?;
    tell_steps(context);
    context.timed("report", || write_report(&context.out))?;
    context.timed("layers", || write_layers(&context.out))?;
    Ok(Summary {
        verdict: Some(verdict),
        ..summary(context, pairs)
    })
}

/// Stones of the first epoch, before any prescribed motion is applied.
pub(crate) fn first_stones(context: &Context) -> Result<Vec<Stone>> {
    Ok(labelled(context, 1)?.stones)
}

/// The photos of all epochs.
fn all_photos(context: &Context) -> Result<Vec<Segmented>> {
    let epochs = 1..=context.project.epochs.len();
    epochs.map(|n| segment(context, n)).collect()
}

/// All epochs with their stones.
fn all_labelled(context: &Context, ingested: Vec<Ingested>, photos: &[Segmented]) -> Result<Vec<Labelled>> {
    let epochs = ingested.into_iter().zip(photos).zip(1..);
    epochs
        .map(|((ingested, photos), number)| label(context, number, ingested, photos))
        .collect()
}

/// An epoch with its stones.
pub(super) fn labelled(context: &Context, number: usize) -> Result<Labelled> {
    label(
        context,
        number,
        ingest(context, number)?,
        &segment(context, number)?,
    )
}

/// The stones of the first epoch in a later one; it is an error if there are none.
pub(super) fn matched(
    context: &Context,
    first: &Labelled,
    second: &Labelled,
    number: usize,
) -> Result<Matched> {
    let matched = r#match(context, first, second, number)?;
    match matched.pairs().is_empty() {
        false => Ok(matched),
        true => Err(Error::NoMatch {
            epochs: [0, number - 1].map(|e| context.project.epochs[e].name.clone()),
            stones: [first.stones.len(), second.stones.len()],
        }),
    }
}

/// What was measured of a later epoch against the first.
pub(super) struct Measured {
    /// The motions.
    pub registered: Registered,
    /// What is known about the registration of the epoch.
    pub datum: Datum,
    /// One row for each stone of the first epoch.
    pub rows: Vec<StoneRow>,
}

/// Measures the matched stones of a later epoch; the outlines are written.
pub(super) fn measured(
    context: &Context,
    photos: [&Segmented; 2],
    [first, second]: [&Labelled; 2],
    matched: &Matched,
    facade: &Facade,
    number: usize,
) -> Result<Measured> {
    let (mut registered, datum) = register(context, photos, [first, second], matched, number)?;
    drop_contradictions(context, [first, second], &mut registered);
    let datum = datum.against(motion_in_common(first, &registered).as_ref());
    let rows = stone_rows([first, second], matched, &registered, &datum, facade);
    Ok(Measured {
        registered,
        datum,
        rows,
    })
}

/// All epochs.
pub(super) struct Corrected {
    /// Their photos.
    pub photos: Vec<Segmented>,
    /// Their stones, as a person corrected them.
    pub labelled: Vec<Labelled>,
    /// What the corrections did.
    pub edited: Option<Edited>,
}

/// All epochs with their stones, as a person corrected them.
pub(super) fn corrected(context: &Context) -> Result<Corrected> {
    let photos = all_photos(context)?;
    let ingested = (1..=photos.len())
        .map(|n| ingest(context, n))
        .collect::<Result<Vec<_>>>()?;
    let labelled = all_labelled(context, ingested, &photos)?;
    let labelled = join(context, &photos, labelled)?;
    let (labelled, _) = carry(context, &photos, labelled)?;
    let (labelled, edited) = edit(context, &photos, labelled)?;
    Ok(Corrected {
        photos,
        labelled,
        edited,
    })
}

/// Writes the outlines of the first epoch's stones; where each stone lies on the unrolled wall.
pub(super) fn outlined(
    context: &Context,
    first: &Labelled,
    edited: Option<Edited>,
) -> Result<(BTreeMap<u32, StoneOutline>, Facade)> {
    write_stone_outlines(context, first)?;
    let outlines = read_outlines(&context.out)?;
    let facade = match edited {
        Some(edited) => edited.facade,
        None => facade_of(first.stones.iter().map(|s| (s.id.0, s.centroid)), &outlines),
    };
    Ok((outlines, facade))
}

/// Matches, measures and compares one later epoch against the first, and writes its tables.
fn measure(
    context: &Context,
    photos: &[Segmented],
    labelled: &[Labelled],
    facade: &Facade,
    number: usize,
    until: Until,
) -> Result<PairSummary> {
    let (first, second) = (&labelled[0], &labelled[number - 1]);
    let matched = matched(context, first, second, number)?;
    let pair = number - 1;
    let file = |file: PairFile| context.out.join(file.name(pair));
    write_readable_json(&file(PairFile::Matches), &matched.report)?;
    if until == Until::Matched {
        return Ok(PairSummary::default());
    }
    let offsets = label_offsets(context, first, second, &matched, number)?;
    let Measured {
        registered,
        datum,
        rows,
    } = measured(
        context,
        [&photos[0], &photos[number - 1]],
        [first, second],
        &matched,
        facade,
        number,
    )?;
    if datum.state == DatumState::Unknown {
        let epoch = &context.project.epochs[number - 1].name;
        context.warnings.notice("register", epoch, &REGISTRATION_UNKNOWN);
    }
    note_doubts(
        context,
        number,
        [first, second],
        &offsets,
        (&registered, &datum),
        &rows,
    );
    write_stones(&context.out, pair, &rows)?;
    if until == Until::Reported {
        write_tracked_stones(context, number, first, &registered, &datum, &rows)?;
    }
    let record = RegistrationRecord {
        estimator: registered.estimator,
        datum: datum.clone(),
        observers: registered.epoch_errors.as_ref().map(ObserversRecord::from),
    };
    write_readable_json(&file(PairFile::Registration), &record)?;
    if !registered.neighbours.is_empty() {
        write_neighbours(&context.out, pair, &registered.neighbours)?;
    }
    let change = if until > Until::Registered {
        let centres: Vec<Point3<f64>> = photos[0].views.iter().map(View::centre).collect();
        let outward = OutwardReference::Towards(&centres);
        let change = m3c2(context, [&first.ingested, &second.ingested], number, &outward)?;
        let params = &context.project.settings.m3c2;
        let change = with_datum(change, params, &datum, registered.epoch_errors.as_ref());
        let crs = coordinate_system(context.project)?;
        context.timed("write m3c2", || {
            write_m3c2(&context.out, pair, crs.as_ref(), &change)
        })?;
        Some(change)
    } else {
        None
    };
    let evaluation = evaluate(context, &first.stones, &rows, &datum, change.as_ref(), number);
    if let Some(evaluation) = &evaluation {
        write_readable_json(&file(PairFile::Evaluation), evaluation)?;
    }
    Ok(PairSummary {
        rows,
        datum: Some(datum),
        evaluation,
    })
}

/// What is known about the registration of each later epoch.
fn datums(pairs: &[PairSummary]) -> Vec<DatumState> {
    pairs
        .iter()
        .filter_map(|p| p.datum.as_ref())
        .map(|d| d.state)
        .collect()
}

/// Epochs whose clouds lie apart cannot be compared; `ingested`: with their numbers, the reference first.
pub(super) fn check_overlap(context: &Context, ingested: &[(&Ingested, usize)]) -> Result<()> {
    let bounds = |t: &Ingested| {
        (0..t.tiles.tile_count())
            .map(|i| t.tiles.bounds(i))
            .reduce(|a, b| a.union(&b))
    };
    let mut boxes: Vec<(Bounds, usize)> = Vec::new();
    for (epoch, number) in ingested {
        boxes.extend(bounds(epoch).map(|b| (b, *number)));
    }
    let Some((reference, _)) = boxes.first() else {
        return Ok(());
    };
    for (bounds, number) in &boxes[1..] {
        if !reference.intersects(bounds) {
            let names = [0, number - 1].map(|e| &context.project.epochs[e].name);
            return Err(Error::Survey(format!(
                "epochs {:?} and {:?} do not overlap: one reaches from {:.1?} to {:.1?} m, the other from {:.1?} to {:.1?} m; \
                 are they in one frame?",
                names[0],
                names[1],
                reference.min.coords.as_slice(),
                reference.max.coords.as_slice(),
                bounds.min.coords.as_slice(),
                bounds.max.coords.as_slice()
            )));
        }
    }
    Ok(())
}

fn summary(context: &Context, pairs: Vec<PairSummary>) -> Summary {
    Summary {
        warnings: context.warnings.sorted(),
        pairs,
        verdict: None,
    }
}
