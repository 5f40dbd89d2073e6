//! Results of a run against a table of true stones.

use crate::error::{Error, Result};
use crate::files::write_readable_json;
use crate::results::names::EVALUATION_TRUTH;
use crate::results::records::Datum;
use crate::results::{ResultSet, StoneRow};
use nalgebra::{Matrix3, Vector3};
use std::fs;
use std::path::Path;
use stonewise_core::evaluate::{
    Evaluation, EvaluationParams, Ranks, RotationEstimate, StoneOutcome, TrueStone, owned_by_nearest,
    score_against_truth, score_neighbours, score_rotations,
};
use stonewise_core::id::StoneId;
use stonewise_io::table::{CsvError, CsvFile};

/// Columns that a table of true stones must have.
const NEEDED: [&str; 11] = [
    "stone_id", "cx", "cy", "cz", "dx", "dy", "dz", "rx", "ry", "rz", "loose",
];

/// Scores the stones of a finished run against true stones, and writes `evaluation_truth.json` beside its
/// results.
///
/// `truth`: CSV with the columns `stone_id, cx, cy, cz` (centroid in epoch 1), `dx, dy, dz`, `rx, ry, rz`,
/// `loose`, and, where known, `nx, ny, nz` (face normal), `edge` and `visible` (share of the face that both
/// epochs measured) or `vis_tls` and `vis_uav` (the same of two scanners, of which the better one counts). A
/// row of the results belongs to the true stone whose centroid is nearest.
///
/// # Errors
/// The results or the truth cannot be read, a column is missing, a value is no number.
pub fn evaluate_truth(results: &Path, truth: &Path, params: &EvaluationParams) -> Result<Evaluation> {
    let set = ResultSet::read(results)?;
    let stones = read_truth(truth)?;
    let outcomes = owned_by_nearest(outcomes(&set), &stones, params);
    let mut evaluation = Evaluation::new(truth.display().to_string(), params);
    evaluation.external = Some(score_against_truth(&outcomes, &stones, params));
    evaluation.rotations = score_rotations(&outcomes, &stones, params);
    evaluation.neighbours = score_neighbours(&outcomes, &stones, &set.neighbours, params);
    write_readable_json(&results.join(EVALUATION_TRUTH), &evaluation)?;
    Ok(evaluation)
}

/// Ranks of true stones in what a finished run states of them; `truth` as in [`evaluate_truth`].
pub(crate) fn ranks_of_truth(results: &Path, truth: &Path, params: &EvaluationParams) -> Result<Ranks> {
    let set = ResultSet::read(results)?;
    let stones = read_truth(truth)?;
    let outcomes = owned_by_nearest(outcomes(&set), &stones, params);
    Ok(Ranks::of(&outcomes, &stones, &set.neighbours, params))
}

/// The stones of a run as the evaluation takes them.
pub(crate) fn outcomes(set: &ResultSet) -> Vec<StoneOutcome> {
    let normal = |row: &StoneRow| set.outlines.get(&row.stone_id).map_or(Vector3::x(), |o| o.normal);
    let rows = set.stones.iter();
    rows.map(|row| outcome(row, normal(row), set.datum())).collect()
}

/// A row as the evaluation takes it; `datum`: what is known about the registration of its epoch.
pub(crate) fn outcome(row: &StoneRow, normal: Vector3<f64>, datum: Option<&Datum>) -> StoneOutcome {
    let motion = row.motion.as_ref();
    let registration = datum.and_then(|d| d.covariance_at(&row.centroid));
    let turn = datum.and_then(Datum::rotation_covariance).unwrap_or_default();
    StoneOutcome {
        stone: StoneId(row.stone_id),
        centroid: row.centroid,
        normal,
        displacement: motion.map(|m| m.displacement),
        covariance: motion.map(|m| m.covariance),
        covariance_without_datum: motion.map(|m| m.covariance - registration.unwrap_or_else(Matrix3::zeros)),
        rotation: motion.map(|m| RotationEstimate {
            rotation: m.rotation,
            covariance: m.rotation_covariance,
            covariance_without_datum: m.rotation_covariance - turn,
        }),
        datum_known: registration.is_some(),
        detection_limit_m: motion.map(|m| m.detection_limit_m),
        significant: motion.map(|m| m.significant),
        loose: motion.map(|m| m.loose),
    }
}

fn read_truth(path: &Path) -> Result<Vec<TrueStone>> {
    let bytes = fs::read(path).map_err(Error::io("reading", path))?;
    let bad = |message: String| Error::Input {
        path: path.to_path_buf(),
        message,
    };
    let in_table = |e: CsvError| bad(e.said());
    let file = CsvFile::parse(path, bytes).map_err(in_table)?;
    let find = |name: &str| file.column(name);
    if let Some(missing) = NEEDED.iter().find(|n| find(n).is_none()) {
        return Err(bad(format!("no column {missing:?} in the table of true stones")));
    }
    let visible: Vec<usize> = match find("visible") {
        Some(column) => vec![column],
        None => ["vis_tls", "vis_uav"].iter().filter_map(|n| find(n)).collect(),
    };
    file.rows()
        .map(|row| {
            let row = row.map_err(in_table)?;
            let at = |column: usize| {
                let number = row.number(column).map_err(in_table)?;
                number.ok_or_else(|| in_table(row.error_in(column, "empty: give a number")))
            };
            let value = |name: &str, absent: f64| find(name).map_or(Ok(absent), at);
            let vector = |x, y, z, absent| {
                Ok::<_, Error>(Vector3::new(value(x, absent)?, value(y, 0.0)?, value(z, 0.0)?))
            };
            Ok(TrueStone {
                stone_id: StoneId(value("stone_id", 0.0)? as u32),
                centroid: vector("cx", "cy", "cz", 0.0)?.into(),
                normal: vector("nx", "ny", "nz", 1.0)?,
                displacement: vector("dx", "dy", "dz", 0.0)?,
                rotation: vector("rx", "ry", "rz", 0.0)?,
                loose: value("loose", 0.0)? != 0.0,
                edge: value("edge", 0.0)? != 0.0,
                visible_share: visible
                    .iter()
                    .map(|&column| at(column))
                    .reduce(|a, b| Ok(a?.max(b?)))
                    .unwrap_or(Ok(1.0))?,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(columns: &str, row: &str) -> Vec<f64> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("stones.csv");
        fs::write(
            &path,
            format!("{},{columns}\n{}{row}\n", NEEDED.join(","), "0,".repeat(11)),
        )
        .unwrap();
        let stones = read_truth(&path).unwrap();
        stones.iter().map(|s| s.visible_share).collect()
    }

    #[test]
    fn mistakes_are_named_with_line_and_column() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("stones.csv");
        let row = "1".to_owned() + &";0,5".repeat(10);
        let table = |row: &str| format!("\u{feff}{}\r\n{row}\r\n", NEEDED.join(";"));
        fs::write(&path, table(&row)).unwrap();
        assert_eq!(read_truth(&path).unwrap()[0].displacement, Vector3::repeat(0.5));
        for (text, message) in [
            (
                table(&row.replacen("0,5", "x", 1)),
                "line 2, column cx: \"x\" is no number",
            ),
            (table(&row.replacen("0,5", "", 1)), "line 2, column cx: empty"),
            (table("1;2"), "line 2: 2 cells"),
            ("stone_id,cx\n".to_owned(), "no column \"cy\""),
        ] {
            fs::write(&path, text).unwrap();
            let found = read_truth(&path).unwrap_err().to_string();
            assert!(found.contains(message) && found.contains("stones.csv"), "{found}");
        }
    }

    #[test]
    fn a_stone_is_as_visible_as_to_the_scanner_that_saw_it_best() {
        assert_eq!(read("vis_tls,vis_uav", "0,0.8"), vec![0.8]);
        assert_eq!(read("vis_tls,vis_uav", "0.9,0"), vec![0.9]);
        assert_eq!(read("vis_uav", "0.7"), vec![0.7]);
        assert_eq!(read("vis_tls,visible", "0.9,0.4"), vec![0.4]);
        assert_eq!(read("edge", "0"), vec![1.0]);
    }
}
