//! The same figures from scanned walls and the whole adjustment: slow, and a check of the small walls.

use super::errors::{Kind, Sensor};
use super::small_wall::{Case, Survey};
use crate::survey::{Points, SurveyPoint, pairs, places, seen_stone};
use nalgebra::Vector3;
use stonewise_core::progress::Silent;
use stonewise_core::registration::observers::Source;
use stonewise_core::registration::{AdjustmentParams, MemoryPairs, adjust};
use stonewise_simulate::{
    Scan, SceneParams, StripDrift, TlsParams, UavParams, WallMotion, WallParams, World,
};

/// Points that a stone needs in each epoch.
const LEAST_POINTS: usize = 60;

fn params(case: &Case, seed: u64) -> SceneParams {
    let uav = UavParams {
        strips: case.sources,
        datum_m: 2e-3,
        drift_m: 3e-3,
        drift: match case.kind {
            Kind::Walk => StripDrift::RandomWalk,
            Kind::Sine => StripDrift::Sine,
            Kind::Jump => StripDrift::Jump,
            _ => StripDrift::Smooth,
        },
        adjusted: case.kind == Kind::Adjusted,
        spacing_m: 0.012,
        ..UavParams::default()
    };
    let tls = TlsParams {
        stations: case.sources,
        registration_m: 4e-4,
        datum_m: 3e-4,
        scale_error: if case.kind == Kind::Scale { 5e-5 } else { 0.0 },
        spacing_m: 0.007,
        ..TlsParams::default()
    };
    let bulge = WallMotion::Bulge {
        centre_m: [0.2, 1.0],
        depth_m: 0.02,
        diameter_m: 1.5,
    };
    SceneParams {
        wall: WallParams::sized([3.0, 2.0]),
        motions: vec![bulge],
        tls: (case.sensor == Sensor::Tls).then_some(tls),
        uav: (case.sensor == Sensor::Uav).then_some(uav),
        ..SceneParams::default()
    }
    .seeded(seed)
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

pub fn simulate(case: &Case, seed: u64) -> Survey {
    let params = params(case, seed);
    let world = World::new(&params);
    let count = case.sources as usize;
    let epochs = [0, 1].map(|e| {
        let scans = world.scan(&params, e);
        by_stone(&scans.tls.or(scans.uav).unwrap())
    });
    let is_seen = |id: &&u32| {
        epochs
            .iter()
            .all(|e| e.get(id).is_some_and(|p| p.len() >= LEAST_POINTS))
    };
    let ids: Vec<u32> = epochs[0].keys().filter(is_seen).copied().collect();
    let outward = Vector3::x();
    let pairs = pairs(
        &epochs.each_ref().map(|e| places(e, &ids)),
        |_| Some(outward),
        0.0,
    );
    let report = adjust(&MemoryPairs::new(pairs), &AdjustmentParams::default(), &Silent).unwrap();
    let mut survey = Survey {
        sources: (0..2 * count)
            .map(|s| Source {
                name: format!("{}/{}", s / count, s % count),
                epoch: s / count,
                has_times: true,
                same_as: None,
            })
            .collect(),
        stones: Vec::new(),
        stable: Vec::new(),
        sigma_m: report.sigma_m[0].max(report.sigma_m[1]),
        seeming: Vec::new(),
        measured: Vec::new(),
        noise: Vec::new(),
    };
    for result in &report.results {
        let Ok(motion) = &result.motion else { continue };
        let id = result.first.0;
        let stone = seen_stone(&epochs, id, &outward, |epoch, source| epoch * count + source).unwrap();
        let rigid = world.motions[id as usize - 1].second_from_first;
        let truth = rigid * stone.centroid - stone.centroid;
        survey.measured.push(motion.displacement - truth);
        survey.seeming.push(motion.displacement - truth);
        survey
            .noise
            .push(motion.covariance.fixed_view::<3, 3>(0, 0).into_owned());
        survey.stones.push(stone);
    }
    survey
}
