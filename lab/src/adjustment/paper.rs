//! The paper's estimator and M3C2 on the same survey.

use super::trial::Trial;
use crate::figures::rms;
use nalgebra::{Point3, Vector3};
use stonewise_core::change::{CorePoint, M3c2Params, m3c2};
use stonewise_core::cloud::{Cloud, GridIndex};
use stonewise_core::geometry::FaceFrame;
use stonewise_core::registration::{
    GicpBlock, GicpParams, GicpStone, MemoryPairs, align, relate_to_neighbours,
};
use stonewise_core::stone::PairResult;

/// Every stone by plane-to-plane ICP with everything within 60 cm, joints and surroundings included.
pub fn gicp(trial: &Trial, pairs: &MemoryPairs) -> Vec<PairResult> {
    let params = GicpParams::default();
    let origin = pairs.pairs().first().map_or(Point3::origin(), |p| p.centroid);
    let [first, second] = [0, 1].map(|e| {
        let points = trial.stones[e].values().flatten().copied();
        GicpBlock::new(&Cloud::from_world(origin, points), &params)
    });
    let mut next = 0;
    let mut start = std::collections::BTreeMap::new();

    for (id, points) in &trial.stones[0] {
        start.insert(*id, next);
        next += points.len() as u32;
    }

    let stones: Vec<GicpStone> = pairs
        .pairs()
        .iter()
        .map(|p| {
            let (id, from) = (p.first.0, start[&p.first.0]);
            GicpStone {
                first: p.first,
                second: p.second,
                centroid: p.centroid,
                centroid_second: p.centroid_second,
                points: (from..from + trial.stones[0][&id].len() as u32).collect(),
                points_second: trial.stones[1][&id].len(),
            }
        })
        .collect();

    let results = align(&first, &second, &stones, &params);
    let mut placed: Vec<_> = stones.iter().map(|s| s.centroid).zip(results).collect();
    relate_to_neighbours(&mut placed, &params);
    placed.into_iter().map(|(_, result)| result).collect()
}

/// RMSE of M3C2 at the stones' centroids along the true normal of the face: in the face (2D), out of it,
/// millimetres.
pub fn m3c2_errors(trial: &Trial, pairs: &MemoryPairs) -> [f64; 2] {
    let params = M3c2Params::default();
    let [first, second] = [0, 1].map(|e| {
        let points: Vec<Point3<f64>> = trial.stones[e].values().flatten().copied().collect();
        GridIndex::new(&points, params.cylinder_radius_m)
    });
    let counted: Vec<_> = pairs
        .pairs()
        .iter()
        .filter_map(|p| Some((p.centroid, trial.truth.get(&p.first.0).filter(|t| t.countable)?)))
        .collect();
    let core = counted.iter().map(|(position, truth)| CorePoint {
        position: *position,
        normal: Some(truth.normal),
    });
    let found = m3c2(&first, &second, &core.collect::<Vec<_>>(), &params);
    let errors: Vec<Vector3<f64>> = found
        .points
        .iter()
        .zip(&counted)
        .filter_map(|(p, (_, t))| {
            let face = FaceFrame::from_normal(&t.normal).face_from_world();
            Some(face * (p.displacement()? - t.displacement) * 1e3)
        })
        .collect();
    [
        rms(errors.iter().map(|e| e.x.hypot(e.y))),
        rms(errors.iter().map(|e| e.z)),
    ]
}
