//! Simulated walls, scanned twice and adjusted with true labels.

use super::points::{Points, SurveyPoint, pairs, places, seen_stone};
use nalgebra::{Point3, Vector3};
use std::collections::BTreeMap;
use stonewise_core::id::StoneId;
use stonewise_core::progress::Silent;
use stonewise_core::registration::observers::{
    EpochErrorParams, EpochPair, Response, SeenStone, Source, epoch_errors,
};
use stonewise_core::registration::{
    AdjustmentParams, AdjustmentReport, Deformation, MemoryPairs, adjust, deformation,
};
use stonewise_simulate::{Scan, SceneParams, World};

/// Points that a stone needs in each epoch.
const LEAST_POINTS: usize = 60;

/// A wall whose stones were measured by one sensor in two epochs.
pub struct ScannedWall {
    world: World,
    epochs: [Points; 2],
    /// Stations or strips of each epoch.
    count: usize,
    pub report: AdjustmentReport,
}

impl ScannedWall {
    /// `count`: stations or strips of each epoch.
    pub fn new(params: &SceneParams, count: u32) -> Self {
        Self::later(params, count, 1)
    }

    /// The wall whose later epoch is the one of this number, 1 for the second, with the errors of that epoch. `count`:
    /// stations or strips of each epoch.
    pub fn later(params: &SceneParams, count: u32, epoch: usize) -> Self {
        let world = World::new(params);
        let epochs = [0, epoch].map(|e| {
            let scans = world.scan(params, e);
            by_stone(&scans.tls.or(scans.uav).unwrap())
        });
        let is_seen = |id: &&u32| {
            epochs
                .iter()
                .all(|e| e.get(id).is_some_and(|p| p.len() >= LEAST_POINTS))
        };
        let ids: Vec<u32> = epochs[0].keys().filter(is_seen).copied().collect();
        let pairs = pairs(
            &epochs.each_ref().map(|e| places(e, &ids)),
            |_| Some(Vector3::x()),
            0.0,
        );
        let report = adjust(&MemoryPairs::new(pairs), &AdjustmentParams::default(), &Silent).unwrap();
        Self {
            world,
            epochs,
            count: count as usize,
            report,
        }
    }

    pub fn sources(&self) -> Vec<Source> {
        sources(self.count)
    }

    /// The larger noise of the two epochs, metres.
    pub fn sigma_m(&self) -> f64 {
        self.report.sigma_m[0].max(self.report.sigma_m[1])
    }

    /// A stone as the sources of both epochs show it.
    pub fn seen(&self, stone: StoneId) -> SeenStone {
        let number = |epoch, source| epoch * self.count + source;
        seen_stone(&self.epochs, stone.0, &Vector3::x(), number).unwrap()
    }

    /// How the wall deformed, with the errors of stations or strips; and the stones that both epochs show.
    pub fn deformation(&self) -> (Deformation, BTreeMap<StoneId, SeenStone>) {
        let sources = self.sources();
        let measured = self.report.results.iter().filter(|r| r.motion.is_ok());
        let seen: BTreeMap<StoneId, SeenStone> = measured.map(|r| (r.first, self.seen(r.first))).collect();
        let stones: Vec<SeenStone> = seen.values().cloned().collect();
        let ids: Vec<StoneId> = seen.keys().copied().collect();
        let pair = EpochPair {
            response: self.report.joint.as_ref().map(|motions| Response {
                motions,
                stones: &ids,
            }),
            ..EpochPair::new(&sources, &stones, self.sigma_m())
        };
        let errors = epoch_errors(&pair, &EpochErrorParams::default(), &Silent).unwrap();
        let errors = errors.joint.as_ref().map(|e| (e, ids.as_slice()));
        let found = deformation(self.report.joint.as_ref().unwrap(), errors, &Silent).unwrap();
        (found, seen)
    }

    /// True displacement of a stone at a place.
    pub fn truth(&self, stone: StoneId, at: Point3<f64>) -> Vector3<f64> {
        self.world.motions[stone.0 as usize - 1].second_from_first * at - at
    }
}

/// The sources of two epochs with as many stations or strips each.
pub fn sources(count: usize) -> Vec<Source> {
    let source = |s| Source {
        name: format!("{}/{}", s / count, s % count),
        epoch: s / count,
        has_times: true,
        same_as: None,
    };
    (0..2 * count).map(source).collect()
}

fn by_stone(scan: &Scan) -> Points {
    let mut stones = Points::new();
    for (i, &id) in scan.stone.iter().enumerate().filter(|(_, id)| **id > 0) {
        stones.entry(id).or_default().push(SurveyPoint {
            place: scan.cloud.world(i),
            source: scan.source[i] as usize - 1,
            time_s: scan.time[i],
        });
    }
    stones
}
