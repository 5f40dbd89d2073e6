//! All that a report is made of.

use super::change_points::{DistancePoint, read_csv, read_distance_points};
use super::names::{
    CARRY_AUDIT, EDITS_AUDIT, FACADE, INSTRUMENTS, PairFile, RUN, TRENDS, VERDICT, audit, stones_in,
};
use super::outlines::{StoneOutline, read_outlines};
use super::records::{
    Datum, InstrumentsRecord, RegistrationRecord, Remarks, RunRecord, TrendsRecord, Verdict,
};
use super::stone_table::read_stones;
use super::{Evidence, Facade, RowMotion, StoneCourse, StoneRow, read_courses, read_neighbours};
use nalgebra::{Matrix3, Point2, Point3, Vector3};
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::path::Path;
use stonewise_base::error::Error;
use stonewise_base::files::is_there;
use stonewise_base::thresholds::Thresholds;
use stonewise_core::evaluate::Evaluation;
use stonewise_core::geometry::FaceFrame;
use stonewise_core::stone::NeighbourCovariance;

/// How far a face reaches in front of and behind the plane through its centroid: in sizes of the stone (square
/// roots of its area), and at least in metres.
const FACE_DEPTH_SIZES: f64 = 0.5;
const LEAST_FACE_DEPTH_M: f64 = 0.1;

/// The result files of one pair of epochs, read back; photos and clouds are not needed.
#[derive(Clone, Debug)]
pub struct ResultSet {
    /// Which later epoch is compared with the first: 1 for the second epoch, 2 for the third.
    pub pair: usize,
    /// Number of pairs in the folder.
    pub pairs: usize,
    /// Rows of `stones.parquet` (of the second pair `stones_2.parquet`, and so on), by stone id.
    pub stones: Vec<StoneRow>,
    /// `outlines.json`, by stone id; empty where the file is missing.
    pub outlines: BTreeMap<u32, StoneOutline>,
    /// Core points of `m3c2.csv` with a distance; empty where the file is missing.
    pub distances: Vec<DistancePoint>,
    /// Its core points without one, world: the later epoch has no points in their cylinders.
    pub without_distance: Vec<Point3<f64>>,
    /// `evaluation.json`, where truth is known.
    pub evaluation: Option<Evaluation>,
    /// `run.json`, where there is one.
    pub run: Option<RunRecord>,
    /// `registration.json`, where there is one.
    pub registration: Option<RegistrationRecord>,
    /// `neighbours.parquet`, in the order of the stones' numbers; empty where the file is missing.
    pub neighbours: Vec<NeighbourCovariance>,
    /// `verdict.json`, where there is one.
    pub verdict: Option<Verdict>,
    /// `trends.json`, where there are more than two epochs.
    pub trends: Option<TrendsRecord>,
    /// What stones do over time, by stone, from `trends.parquet`.
    pub courses: BTreeMap<u32, StoneCourse>,
    /// `instruments.json`, where the project names instruments.
    pub instruments: Option<InstrumentsRecord>,
    /// Decisions about mask instances by epoch, from `audit_epochN.csv`: rows of event, photo, instance,
    /// stones, share, points.
    pub decisions: Vec<Vec<Vec<String>>>,
    /// Edits by hand, from `audit_edits.csv`: its head and one row for each edit and epoch; empty where there
    /// are none.
    pub edits: Vec<Vec<String>>,
    /// Stones that were looked for in epochs whose photos do not show them, from `audit_carried.csv`: its head
    /// and one row for each stone and epoch; empty where there are none.
    pub carried: Vec<Vec<String>>,
    /// `remarks.json`; empty where nobody wrote it.
    pub remarks: Remarks,
    /// Whether the signature in it is under these results.
    pub is_signed: bool,
    /// Excerpts of the survey; empty where the folder is missing.
    pub evidence: Evidence,
    /// The unrolled wall.
    pub facade: Facade,
}

impl ResultSet {
    /// Reads the results of the second epoch against the first, or of the only two epochs, in `dir`.
    ///
    /// # Errors
    /// There is no stone table, or a file is damaged.
    pub fn read(dir: &Path) -> Result<Self, Error> {
        Self::read_pair(dir, 1)
    }

    /// Reads the results of one pair of epochs in `dir`; see `pair`.
    ///
    /// # Errors
    /// There is no stone table of this pair, or a file is damaged.
    pub fn read_pair(dir: &Path, pair: usize) -> Result<Self, Error> {
        let remarks = Remarks::read(dir)?;
        Ok(Self {
            is_signed: remarks.is_signed(dir)?,
            remarks,
            verdict: read_json(&dir.join(VERDICT))?,
            trends: read_json(&dir.join(TRENDS))?,
            courses: read_courses(dir)?,
            instruments: read_json(&dir.join(INSTRUMENTS))?,
            decisions: read_decisions(dir)?,
            edits: read_rows(&dir.join(EDITS_AUDIT))?.unwrap_or_default(),
            carried: read_rows(&dir.join(CARRY_AUDIT))?.unwrap_or_default(),
            evidence: Evidence::read(dir, pair + 1)?,
            ..Self::read_measured(dir, pair)?
        })
    }

    /// Reads a pair without the verdict, the series, the decisions about masks and the excerpts of the survey.
    ///
    /// # Errors
    /// As [`Self::read_pair`].
    pub fn read_measured(dir: &Path, pair: usize) -> Result<Self, Error> {
        let core = read_distance_points(&dir.join(PairFile::M3c2Csv.place(pair)))?;
        Ok(Self {
            distances: core.distances,
            without_distance: core.without_distance,
            evaluation: read_json(&dir.join(PairFile::Evaluation.place(pair)))?,
            neighbours: read_neighbours(dir, pair)?,
            ..Self::read_motions(dir, pair)?
        })
    }

    /// Reads the stones of a pair with their outlines and registration, and the record of the run.
    ///
    /// # Errors
    /// As [`Self::read_pair`].
    pub(super) fn read_motions(dir: &Path, pair: usize) -> Result<Self, Error> {
        let path = dir.join(PairFile::StonesParquet.place(pair));
        if !is_there(&path)? {
            stones_in(dir)?;
            return Err(Error::NoResults(dir.into()));
        }
        let mut stones = read_stones(&path)?;
        stones.sort_by_key(|s| s.stone_id);
        let outlines = read_outlines(dir)?;
        let facade: Option<Facade> = read_json(&dir.join(FACADE))?;
        let facade =
            facade.unwrap_or_else(|| facade_of(stones.iter().map(|s| (s.stone_id, s.centroid)), &outlines));
        Ok(Self {
            pair,
            pairs: pairs_in(dir)?,
            run: read_json(&dir.join(RUN))?,
            registration: read_json(&dir.join(PairFile::Registration.place(pair)))?,
            ..Self::of_stones(stones, outlines, facade)
        })
    }

    /// Stones by their ids, with their outlines and the unrolled wall, of which nothing else is known.
    pub fn of_stones(stones: Vec<StoneRow>, outlines: BTreeMap<u32, StoneOutline>, facade: Facade) -> Self {
        Self {
            facade,
            stones,
            outlines,
            pair: 1,
            pairs: 0,
            distances: Vec::new(),
            without_distance: Vec::new(),
            evaluation: None,
            run: None,
            registration: None,
            neighbours: Vec::new(),
            verdict: None,
            trends: None,
            courses: BTreeMap::new(),
            instruments: None,
            decisions: Vec::new(),
            edits: Vec::new(),
            carried: Vec::new(),
            remarks: Remarks::default(),
            is_signed: false,
            evidence: Evidence::default(),
        }
    }

    /// What is known about the registration of the later epoch; `None` where `registration.json` is missing.
    pub fn datum(&self) -> Option<&Datum> {
        self.registration.as_ref().map(|r| &r.datum)
    }

    /// The thresholds of the verdict; none where there is no verdict.
    pub fn thresholds(&self) -> Thresholds {
        let verdict = self.verdict.as_ref();
        verdict.map(|v| v.thresholds.clone()).unwrap_or_default()
    }

    /// Measured stones with their motion.
    pub fn measured(&self) -> Vec<(&StoneRow, &RowMotion)> {
        self.stones
            .iter()
            .filter_map(|s| s.motion.as_ref().map(|m| (s, m)))
            .collect()
    }

    /// Outward normal of a stone's face; of the wall at its place where the outline is missing.
    pub fn normal(&self, stone: &StoneRow) -> Vector3<f64> {
        let own = self.outlines.get(&stone.stone_id).map(|o| o.normal);
        own.unwrap_or_else(|| self.facade.frame_at(&stone.centroid).out)
    }

    /// Covariance of a stone's displacement as (along, up, out), m^2.
    pub fn face_covariance(&self, stone: &StoneRow, motion: &RowMotion) -> Matrix3<f64> {
        let world = self.world_from_face(stone);
        world.transpose() * motion.covariance * world
    }

    /// Takes (along, up, out) of a stone's face to world axes.
    pub fn world_from_face(&self, stone: &StoneRow) -> Matrix3<f64> {
        FaceFrame::from_normal(&self.normal(stone))
            .face_from_world()
            .transpose()
    }

    /// Whether a point, world, lies about as deep as the stone's face: not on what stands in front of the wall,
    /// such as a railing, or behind its crest.
    pub fn is_at_face(&self, stone: &StoneRow, p: &Point3<f64>) -> bool {
        let normal = match self.outlines.get(&stone.stone_id) {
            Some(outline) => outline.normal,
            None => self.facade.frame_at(&stone.centroid).out,
        };
        let reach_m = (FACE_DEPTH_SIZES * stone.area_m2.sqrt()).max(LEAST_FACE_DEPTH_M);
        normal.dot(&(p - stone.centroid)).abs() <= reach_m
    }

    /// Outline of a stone in the unrolled facade, metres; a square of its area where the outline is missing.
    pub fn unrolled(&self, stone: &StoneRow) -> Vec<Point2<f64>> {
        match self.outlines.get(&stone.stone_id) {
            Some(o) => o
                .ring
                .iter()
                .map(|p| self.facade.place_in_stone(p, &stone.centroid, &o.normal))
                .collect(),
            None => {
                let half = stone.area_m2.max(1e-4).sqrt() / 2.0;
                let c = self.facade.place(&stone.centroid);
                let corner = |x: f64, y: f64| Point2::new(c.x + x * half, c.y + y * half);
                vec![
                    corner(-1.0, -1.0),
                    corner(1.0, -1.0),
                    corner(1.0, 1.0),
                    corner(-1.0, 1.0),
                ]
            }
        }
    }
}

/// The facade of stones, by their ids and centroids; where outlines are missing, of the mean plane through
/// the centroids.
pub fn facade_of(
    stones: impl Iterator<Item = (u32, Point3<f64>)>,
    outlines: &BTreeMap<u32, StoneOutline>,
) -> Facade {
    let stones: Vec<(u32, Point3<f64>)> = stones.collect();
    let mut known: Vec<_> = stones
        .iter()
        .filter_map(|(id, centroid)| outlines.get(id).map(|o| (*centroid, o.normal)))
        .collect();
    if known.is_empty() {
        let centroids: Vec<_> = stones.iter().map(|s| s.1).collect();
        let normal = stonewise_core::geometry::Plane::fit(&centroids).map_or(Vector3::x(), |p| p.normal);
        known = centroids.into_iter().map(|c| (c, normal)).collect();
    }
    Facade::new(&known)
}

/// Number of pairs of epochs that have a stone table.
fn pairs_in(dir: &Path) -> Result<usize, Error> {
    let mut pairs = 0;
    while is_there(&dir.join(PairFile::StonesParquet.place(pairs + 1)))? {
        pairs += 1;
    }
    Ok(pairs)
}

fn read_json<T: DeserializeOwned>(path: &Path) -> Result<Option<T>, Error> {
    match std::fs::read(path) {
        Ok(text) => serde_json::from_slice(&text)
            .map(Some)
            .map_err(|e| Error::Results {
                path: path.into(),
                message: e.to_string(),
            }),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(e) => Err(Error::io("reading results", path)(e)),
    }
}

/// Rows of `audit_epoch1.csv`, `audit_epoch2.csv`, ... without the head, as cells.
fn read_decisions(dir: &Path) -> Result<Vec<Vec<Vec<String>>>, Error> {
    let mut epochs = Vec::new();
    while let Some(rows) = read_rows(&dir.join(audit(epochs.len() + 1)))? {
        let rows = rows.into_iter().skip(1).filter(|c| !c[0].is_empty());
        epochs.push(rows.collect());
    }
    Ok(epochs)
}

/// Rows of a CSV file, the head first, as cells; `None` where there is no such file.
fn read_rows(path: &Path) -> Result<Option<Vec<Vec<String>>>, Error> {
    let Some(file) = read_csv(path)? else {
        return Ok(None);
    };
    let mut rows = vec![file.head().to_vec()];
    for row in file.rows() {
        let row = row.map_err(|e| Error::results(path, e.said()))?;
        rows.push((0..file.head().len()).map(|i| row.text(i).to_owned()).collect());
    }
    Ok(Some(rows))
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_io::table::{Table, write_csv};

    #[test]
    fn rows_are_those_that_were_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("audit.csv");
        assert_eq!(read_rows(&path).unwrap(), None);
        let mut table = Table::new();
        let words = ["b, \"c\"", "", "=d"].map(str::to_owned).to_vec();
        table.push("why, who", "", "text", words).unwrap();
        table
            .push("points", "", "number", vec![Some(1_u32), Some(2), None])
            .unwrap();
        write_csv(&path, &table, "", None).unwrap();
        let expected = [["why, who", "points"], ["b, \"c\"", "1"], ["", "2"], ["'=d", ""]];
        assert_eq!(read_rows(&path).unwrap().unwrap(), expected);
        std::fs::write(&path, "a,b\n1\n").unwrap();
        let damaged = read_rows(&path).unwrap_err().to_string();
        assert!(
            damaged.contains("line 2: 1 cells") && damaged.contains("audit.csv"),
            "{damaged}"
        );
    }
}
