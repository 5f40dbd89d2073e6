//! All that a report is made of.

use super::change_points::{DistancePoint, read_distance_points};
use super::outlines::{StoneOutline, read_outlines};
use super::stone_table::read_stones;
use super::{Facade, ReportError, StoneRow};
use nalgebra::{Point2, Vector3};
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use stonewise_core::evaluate::Evaluation;

/// The result files of one run, read back; photos and clouds are not needed.
#[derive(Clone, Debug)]
pub struct ResultSet {
    /// Rows of `stones.parquet`, by stone id.
    pub stones: Vec<StoneRow>,
    /// `outlines.json`, by stone id; empty where the file is missing.
    pub outlines: BTreeMap<u32, StoneOutline>,
    /// `m3c2.csv`; empty where the file is missing.
    pub distances: Vec<DistancePoint>,
    /// `evaluation.json`, where truth is known.
    pub evaluation: Option<Evaluation>,
    /// `run.json`; null where the file is missing.
    pub run: Value,
    /// `registration.json`; null where the file is missing.
    pub registration: Value,
    /// Decisions about mask instances, by epoch and kind, from `audit_epochN.csv`.
    pub decisions: Vec<BTreeMap<String, usize>>,
    /// The unrolled wall.
    pub facade: Facade,
}

impl ResultSet {
    /// Reads the results in `dir`.
    ///
    /// # Errors
    /// There is no stone table, or a file is damaged.
    pub fn read(dir: &Path) -> Result<Self, ReportError> {
        let path = dir.join("stones.parquet");
        if !path.exists() {
            return Err(ReportError::NoResults(dir.into()));
        }
        let mut stones = read_stones(&path)?;
        stones.sort_by_key(|s| s.stone_id);
        let outlines = read_outlines(dir)?;
        Ok(Self {
            facade: facade_of(&stones, &outlines),
            stones,
            outlines,
            distances: read_distance_points(dir)?,
            evaluation: read_json(&dir.join("evaluation.json"))?,
            run: read_json(&dir.join("run.json"))?.unwrap_or(Value::Null),
            registration: read_json(&dir.join("registration.json"))?.unwrap_or(Value::Null),
            decisions: read_decisions(dir)?,
        })
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

/// The facade of the stones; where outlines are missing, of the mean plane through the centroids.
fn facade_of(stones: &[StoneRow], outlines: &BTreeMap<u32, StoneOutline>) -> Facade {
    let mut known: Vec<_> = stones
        .iter()
        .filter_map(|s| outlines.get(&s.stone_id).map(|o| (s.centroid, o.normal)))
        .collect();
    if known.is_empty() {
        let centroids: Vec<_> = stones.iter().map(|s| s.centroid).collect();
        let normal = stonewise_core::geometry::Plane::fit(&centroids).map_or(Vector3::x(), |p| p.normal);
        known = centroids.into_iter().map(|c| (c, normal)).collect();
    }
    Facade::new(&known)
}

fn read_json<T: DeserializeOwned>(path: &Path) -> Result<Option<T>, ReportError> {
    match std::fs::read(path) {
        Ok(text) => serde_json::from_slice(&text)
            .map(Some)
            .map_err(|e| ReportError::Content {
                path: path.into(),
                message: e.to_string(),
            }),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(e) => Err(ReportError::io("reading results", path)(e)),
    }
}

/// Rows of `audit_epoch1.csv`, `audit_epoch2.csv`, ... counted by their first cell, the kind of decision.
fn read_decisions(dir: &Path) -> Result<Vec<BTreeMap<String, usize>>, ReportError> {
    let mut epochs = Vec::new();
    loop {
        let path = dir.join(format!("audit_epoch{}.csv", epochs.len() + 1));
        let text = match std::fs::read_to_string(&path) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(epochs),
            Err(e) => return Err(ReportError::io("reading results", path)(e)),
        };
        let mut kinds = BTreeMap::new();
        for kind in text
            .lines()
            .skip(1)
            .filter_map(|l| l.split(',').next())
            .filter(|k| !k.is_empty())
        {
            *kinds.entry(kind.to_owned()).or_insert(0) += 1;
        }
        epochs.push(kinds);
    }
}
