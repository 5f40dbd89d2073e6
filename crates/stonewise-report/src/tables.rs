//! What the report's tables say, as CSV.

use std::collections::BTreeSet;
use std::path::Path;
use stonewise_base::error::Error;
use stonewise_core::series::{Departure, Word};
use stonewise_io::table::{Table, TableError, write_csv};
use stonewise_results::records::{
    AnswerVerdict, DeformedZone, EpochVerdict, RunRecord, SeriesVerdict, TrendsRecord,
};
use stonewise_results::{Joint, JointMotion, ResultSet, joints};

/// Axes of a path: end of a column's name, and words.
const AXES: [(&str, &str); 3] = [
    ("along", "along the wall"),
    ("up", "up the face"),
    ("out", "out of the face"),
];

/// Writes the tables of a series into their folder; `all`: the results of all later epochs.
///
/// # Errors
/// A file cannot be written.
pub(crate) fn write_tables(folder: &Path, all: &[ResultSet]) -> Result<(), Error> {
    let Some(newest) = all.last() else {
        return Ok(());
    };
    let write = |name: &str, table: &Table, description: &str, key: Option<&str>| {
        write_csv(&folder.join(name), table, description, key)
    };
    let verdict = newest.verdict.as_ref();
    if let (Some(run), Some(verdict)) = (&newest.run, verdict) {
        let table = epochs(run, &verdict.epochs)?;
        write(
            "epochs.csv",
            &table,
            "the epochs of a series and what each shows",
            Some("epoch"),
        )?;
        let table = zones(&verdict.epochs)?;
        write(
            "zones.csv",
            &table,
            "zones of deformation of all later epochs",
            None,
        )?;
    }
    if let Some(found) = verdict.and_then(|v| v.series.as_ref()) {
        let table = answers(found)?;
        write(
            "answers.csv",
            &table,
            "the four answers of a series",
            Some("question"),
        )?;
    }
    write(
        "joints.csv",
        &joint_table(all)?,
        "joints between neighbouring stones in all later epochs",
        None,
    )?;
    if let Some(trends) = &newest.trends {
        write(
            "paths.csv",
            &paths(trends)?,
            "paths of the wall and of its zones",
            None,
        )?;
    }
    Ok(())
}

fn epochs(run: &RunRecord, later: &[EpochVerdict]) -> Result<Table, TableError> {
    let mut table = Table::new();
    let of = |name: &str| later.iter().find(|e| e.epoch == name);
    let all: Vec<Option<&EpochVerdict>> = run.epochs.iter().map(|e| of(&e.name)).collect();
    let texts = |of: &dyn Fn(usize) -> String| (0..all.len()).map(of).collect::<Vec<String>>();
    table.push(
        "epoch",
        "",
        "name of the epoch, the reference first",
        texts(&|i| run.epochs[i].name.clone()),
    )?;
    let date = |i: usize| run.epochs[i].date.clone().unwrap_or_default();
    table.push(
        "date",
        "",
        "date of the survey; empty where the project gives none",
        texts(&date),
    )?;
    let names: BTreeSet<&String> = run.epochs.iter().flat_map(|e| e.conditions.keys()).collect();
    for name in names {
        let values: Vec<Option<f64>> = run
            .epochs
            .iter()
            .map(|e| e.conditions.get(name).copied())
            .collect();
        table.push(name, "", "condition during the survey", values)?;
    }
    let points: Vec<f64> = run.epochs.iter().map(|e| e.points as f64).collect();
    table.push("points", "", "points of the clouds", points)?;
    let photos: Vec<u32> = run.epochs.iter().map(|e| e.photo_count as u32).collect();
    table.push("photos", "", "photos, or views of the clouds", photos)?;
    let datum = |i: usize| {
        run.datum
            .get(&run.epochs[i].name)
            .map_or("", |d| d.word())
            .to_owned()
    };
    table.push(
        "datum",
        "",
        "what the registration is known from; empty for the reference",
        texts(&datum),
    )?;
    let state = |i: usize| all[i].map_or("", |e| e.state.word()).to_owned();
    table.push("state", "", "state of the wall", texts(&state))?;
    let counts = |of: fn(&EpochVerdict) -> usize| -> Vec<Option<u32>> {
        all.iter().map(|e| e.map(|e| of(e) as u32)).collect()
    };
    table.push("stones", "", "stones of the reference", counts(|e| e.wall.stones))?;
    table.push(
        "measured",
        "",
        "those that were measured",
        counts(|e| e.wall.measured),
    )?;
    table.push("moved", "", "those that moved", counts(|e| e.wall.moved))?;
    table.push(
        "loose",
        "",
        "those that move unlike their neighbours",
        counts(|e| e.wall.loose),
    )?;
    table.push(
        "lost",
        "",
        "those that the epoch does not have",
        counts(|e| e.wall.lost),
    )?;
    let reals = |of: fn(&EpochVerdict) -> Option<f64>| -> Vec<Option<f64>> {
        all.iter().map(|e| e.and_then(of)).collect()
    };
    let largest = reals(|e| Some(e.wall.largest?.length_mm));
    table.push(
        "largest_mm",
        "mm",
        "largest motion of a stone that moved",
        largest,
    )?;
    let lower = reals(|e| Some(e.wall.largest?.interval_mm[0]));
    table.push("largest_lower_mm", "mm", "lower end of its 95 % interval", lower)?;
    let upper = reals(|e| Some(e.wall.largest?.interval_mm[1]));
    table.push("largest_upper_mm", "mm", "upper end of its 95 % interval", upper)?;
    let deformed = reals(|e| e.deformation.as_ref()?.largest_mm);
    table.push("deformation_mm", "mm", "largest deformation of a zone", deformed)?;
    let lower = reals(|e| Some(e.deformation.as_ref()?.interval_mm?[0]));
    table.push(
        "deformation_lower_mm",
        "mm",
        "lower end of its 95 % interval",
        lower,
    )?;
    let upper = reals(|e| Some(e.deformation.as_ref()?.interval_mm?[1]));
    table.push(
        "deformation_upper_mm",
        "mm",
        "upper end of its 95 % interval",
        upper,
    )?;
    let limit = reals(|e| Some(e.wall.detection_limit.as_ref()?.median_mm));
    table.push(
        "detection_limit_mm",
        "mm",
        "detection limit of a stone, median",
        limit,
    )?;
    Ok(table)
}

fn zones(later: &[EpochVerdict]) -> Result<Table, TableError> {
    let of = |e: &EpochVerdict| {
        e.deformation
            .iter()
            .flat_map(|d| d.zones.clone())
            .collect::<Vec<_>>()
    };
    let all: Vec<_> = later
        .iter()
        .flat_map(|e| of(e).into_iter().map(move |z| (&e.epoch, z)))
        .collect();
    let mut table = Table::new();
    let epochs: Vec<String> = all.iter().map(|z| z.0.clone()).collect();
    table.push("epoch", "", "name of the later epoch", epochs)?;
    let ids: Vec<u32> = all.iter().map(|z| z.1.zone_id).collect();
    table.push(
        "zone_id",
        "",
        "zone of deformation, as in the stone table of the epoch",
        ids,
    )?;
    let kinds: Vec<String> = all.iter().map(|z| z.1.kind.word().to_owned()).collect();
    table.push("kind", "", "what it resembles", kinds)?;
    let states: Vec<String> = all.iter().map(|z| z.1.state.word().to_owned()).collect();
    table.push("state", "", "its state", states)?;
    let against: Vec<String> = all.iter().map(|z| z.1.against.word().to_owned()).collect();
    table.push("against", "", "what its motion counts from", against)?;
    let diameters: Vec<Option<f64>> = all.iter().map(|z| z.1.diameter_m).collect();
    table.push("diameter_m", "m", "diameter of a round zone", diameters)?;
    type Column = (&'static str, &'static str, &'static str, fn(&DeformedZone) -> f64);
    let columns: [Column; 8] = [
        ("along_m", "m", "middle along the unrolled wall", |z| z.along_m),
        ("up_m", "m", "middle up the unrolled wall", |z| z.up_m),
        ("length_m", "m", "length", |z| z.length_m),
        ("width_m", "m", "width", |z| z.width_m),
        ("area_m2", "m2", "area of the faces of its stones", |z| z.area_m2),
        ("largest_mm", "mm", "largest deformation of a stone", |z| {
            z.largest_mm
        }),
        ("lower_mm", "mm", "lower end of its 95 % interval", |z| {
            z.interval_mm[0]
        }),
        ("upper_mm", "mm", "upper end of its 95 % interval", |z| {
            z.interval_mm[1]
        }),
    ];
    for (name, unit, meaning, of) in columns {
        let values: Vec<f64> = all.iter().map(|z| of(&z.1)).collect();
        table.push(name, unit, meaning, values)?;
    }
    Ok(table)
}

fn answers(found: &SeriesVerdict) -> Result<Table, TableError> {
    let all = [
        ("as_predicted", &found.as_predicted),
        ("as_in_the_past", &found.as_in_the_past),
        ("trend", &found.trend),
        ("anomaly", &found.anomaly),
    ];
    let mut table = Table::new();
    table.push(
        "question",
        "",
        "as in verdict.json",
        all.map(|a| a.0.to_owned()).to_vec(),
    )?;
    let word = |a: &AnswerVerdict| match a.answer.answer {
        Word::Yes => "yes",
        Word::No => "no",
        Word::CannotTell => "cannot tell",
    };
    table.push(
        "answer",
        "",
        "yes, no or cannot tell",
        all.map(|a| word(a.1).to_owned()).to_vec(),
    )?;
    let tested = all.map(|a| a.1.answer.tested as u32).to_vec();
    table.push("tested", "", "stones that were tested", tested)?;
    let named = all.map(|a| a.1.answer.stones.len() as u32).to_vec();
    table.push("stones", "", "stones that are named", named)?;
    let largest = |of: fn(&Departure) -> f64| all.map(|a| a.1.answer.largest.as_ref().map(of)).to_vec();
    let unit = "mm or mm/a";
    table.push(
        "length",
        unit,
        "of the stone that does most among them",
        largest(|d| d.length_mm),
    )?;
    table.push(
        "lower",
        unit,
        "lower end of its 95 % interval",
        largest(|d| d.interval_mm[0]),
    )?;
    table.push(
        "upper",
        unit,
        "upper end of its 95 % interval",
        largest(|d| d.interval_mm[1]),
    )?;
    let smallest = all.map(|a| a.1.answer.smallest_q).to_vec();
    table.push("smallest_q", "", "smallest q value of a stone", smallest)?;
    table.push("text", "", "in words", all.map(|a| a.1.text.clone()).to_vec())?;
    Ok(table)
}

/// The joints of all pairs of epochs whose stones were both measured.
fn joint_table(all: &[ResultSet]) -> Result<Table, TableError> {
    let of = |results: &ResultSet| -> Vec<(String, [u32; 2], Joint)> {
        let epoch = results.run.as_ref().and_then(|run| run.epochs.get(results.pair));
        let epoch = epoch.map_or(String::new(), |e| e.name.clone());
        let id = |i: usize| results.stones[i].stone_id;
        let moved = joints(results).into_iter().filter(|j| j.motion.is_some());
        moved.map(|j| (epoch.clone(), j.stones.map(id), j)).collect()
    };
    let rows: Vec<(String, [u32; 2], Joint)> = all.iter().flat_map(of).collect();
    let mut table = Table::new();
    table.push(
        "epoch",
        "",
        "name of the later epoch",
        rows.iter().map(|r| r.0.clone()).collect::<Vec<_>>(),
    )?;
    for (k, name) in ["stone_1", "stone_2"].into_iter().enumerate() {
        let ids: Vec<u32> = rows.iter().map(|r| r.1[k]).collect();
        table.push(name, "", "stone beside the joint", ids)?;
    }
    let middle = |j: &Joint| nalgebra::center(&j.line[0], &j.line[1]);
    table.push(
        "along_m",
        "m",
        "middle along the unrolled wall",
        rows.iter().map(|r| middle(&r.2).x).collect::<Vec<f64>>(),
    )?;
    table.push(
        "up_m",
        "m",
        "middle up the unrolled wall",
        rows.iter().map(|r| middle(&r.2).y).collect::<Vec<f64>>(),
    )?;
    let of = |pick: fn(&JointMotion) -> f64| -> Vec<Option<f64>> {
        rows.iter().map(|r| r.2.motion.as_ref().map(pick)).collect()
    };
    table.push(
        "opening_m",
        "m",
        "motion of the stones apart, across the joint",
        of(|m| m.opening_m),
    )?;
    table.push(
        "sd_opening_m",
        "m",
        "standard deviation of the opening",
        of(|m| m.opening_sigma_m),
    )?;
    table.push(
        "sliding_m",
        "m",
        "motion of the second stone along the joint against the first",
        of(|m| m.sliding_m),
    )?;
    table.push(
        "step_out_m",
        "m",
        "motion of the second stone out of the face against the first",
        of(|m| m.step_m),
    )?;
    Ok(table)
}

fn paths(trends: &TrendsRecord) -> Result<Table, TableError> {
    let groups = trends.wall.iter().chain(&trends.zones);
    let rows: Vec<_> = groups
        .flat_map(|z| z.path.iter().map(move |p| (z.zone_id, p)))
        .collect();
    let mut table = Table::new();
    table.push(
        "zone_id",
        "",
        "zone, as in trends.json; 0 for the wall",
        rows.iter().map(|r| r.0).collect::<Vec<u32>>(),
    )?;
    table.push(
        "epoch",
        "",
        "name of the epoch",
        rows.iter().map(|r| r.1.epoch.clone()).collect::<Vec<_>>(),
    )?;
    table.push(
        "date",
        "",
        "its date",
        rows.iter().map(|r| r.1.date.clone()).collect::<Vec<_>>(),
    )?;
    for (axis, (end, words)) in AXES.into_iter().enumerate() {
        let meaning = format!("mean deformation of its stones since the reference, {words}");
        let values: Vec<Option<f64>> = rows.iter().map(|r| r.1.measured.map(|m| m.value[axis])).collect();
        table.push(&format!("{end}_m"), "m", &meaning, values)?;
        let values: Vec<Option<f64>> = rows.iter().map(|r| r.1.measured.map(|m| m.sd[axis])).collect();
        table.push(&format!("sd_{end}_m"), "m", "its standard deviation", values)?;
        let values: Vec<f64> = rows.iter().map(|r| r.1.model.value[axis]).collect();
        table.push(
            &format!("model_{end}_m"),
            "m",
            "what the model says of it",
            values,
        )?;
        let values: Vec<f64> = rows.iter().map(|r| r.1.model.sd[axis]).collect();
        table.push(
            &format!("sd_model_{end}_m"),
            "m",
            "standard deviation of the model",
            values,
        )?;
    }
    Ok(table)
}
