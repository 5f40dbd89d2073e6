//! The same figures from scanned walls and the whole adjustment: slow, and a check of the small walls.

use crate::errors::{Kind, Sensor};
use crate::survey::{Case, Survey};
use nalgebra::{Point3, Vector3};
use std::collections::BTreeMap;
use stonewise_core::cloud::Cloud;
use stonewise_core::geometry::Plane;
use stonewise_core::id::StoneId;
use stonewise_core::progress::Silent;
use stonewise_core::registration::observers::{SeenStone, Source, SourcePoints};
use stonewise_core::registration::{
    AdjustmentParams, MemoryPairs, NearPoint, PairPoints, adjust, local_shifts, stone_points,
};
use stonewise_core::simulate::{
    Scan, SceneParams, StripDrift, TlsParams, UavParams, WallMotion, WallParams, World,
};

/// Points that a stone needs in each epoch.
const LEAST_POINTS: usize = 60;

struct Point {
    place: Point3<f64>,
    source: usize,
    time_s: f64,
}

type Stones = BTreeMap<u32, Vec<Point>>;

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
        wall: WallParams {
            width_m: 3.0,
            height_m: 2.0,
            ..WallParams::default()
        },
        motions: vec![bulge],
        tls: (case.sensor == Sensor::Tls).then_some(tls),
        uav: (case.sensor == Sensor::Uav).then_some(uav),
        ..SceneParams::default()
    }
    .seeded(seed)
}

fn by_stone(scan: &Scan, first_source: usize) -> Stones {
    let mut stones = Stones::new();
    for (i, &id) in scan.stone.iter().enumerate().filter(|(_, id)| **id > 0) {
        stones.entry(id).or_default().push(Point {
            place: scan.cloud.world(i),
            source: first_source + scan.source[i] as usize - 1,
            time_s: scan.time[i],
        });
    }
    stones
}

fn mean(points: &[Point]) -> Point3<f64> {
    Point3::from(points.iter().map(|p| p.place.coords).sum::<Vector3<f64>>() / points.len() as f64)
}

pub fn simulate(case: &Case, seed: u64) -> Survey {
    let params = params(case, seed);
    let world = World::new(&params);
    let count = case.sources as usize;
    let epochs = [0, 1].map(|e| {
        let scans = world.scan(&params, e);
        by_stone(&scans.tls.or(scans.uav).unwrap(), e * count)
    });
    let is_seen = |id: &&u32| {
        epochs
            .iter()
            .all(|e| e.get(id).is_some_and(|p| p.len() >= LEAST_POINTS))
    };
    let ids: Vec<u32> = epochs[0].keys().filter(is_seen).copied().collect();
    let stones: Vec<SeenStone> = ids.iter().map(|id| seen(&epochs, *id)).collect();
    let report = adjust(
        &pairs(&epochs, &ids, &stones),
        &AdjustmentParams::default(),
        &Silent,
    )
    .unwrap();
    let mut survey = Survey {
        sources: (0..2 * count)
            .map(|s| Source {
                name: format!("{}/{}", s / count, s % count),
                epoch: s / count,
                has_times: true,
            })
            .collect(),
        stones: Vec::new(),
        stable: Vec::new(),
        sigma_m: report.sigma_m[0].max(report.sigma_m[1]),
        seeming: Vec::new(),
        measured: Vec::new(),
        noise: Vec::new(),
    };
    let of_id: BTreeMap<u32, SeenStone> = ids.iter().copied().zip(stones).collect();
    for result in &report.results {
        let Ok(motion) = &result.motion else { continue };
        let stone = of_id[&result.first.0].clone();
        let rigid = world.motions[result.first.0 as usize - 1].second_from_first;
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

fn normal(points: &[Point]) -> Vector3<f64> {
    let places: Vec<Point3<f64>> = points.iter().map(|p| p.place).collect();
    let n = Plane::fit(&places).unwrap().normal;
    n * n.x.signum()
}

fn seen(epochs: &[Stones; 2], id: u32) -> SeenStone {
    let centroid = mean(&epochs[0][&id]);
    let mut sights: BTreeMap<usize, Vec<&Point>> = BTreeMap::new();
    for p in epochs.iter().flat_map(|e| &e[&id]) {
        sights.entry(p.source).or_default().push(p);
    }
    let sight = |(source, points): (usize, Vec<&Point>)| SourcePoints {
        source,
        count: points.len() as u64,
        time_s: points.iter().map(|p| p.time_s).sum::<f64>() / points.len() as f64,
        points: Cloud::from_world(centroid, points.iter().map(|p| p.place)),
    };
    SeenStone {
        centroid,
        normal: normal(&epochs[0][&id]),
        sights: sights.into_iter().map(sight).collect(),
    }
}

fn pairs(epochs: &[Stones; 2], ids: &[u32], stones: &[SeenStone]) -> MemoryPairs {
    let centroids: Vec<Point3<f64>> = stones.iter().map(|s| s.centroid).collect();
    let moved: Vec<Vector3<f64>> = ids
        .iter()
        .zip(&centroids)
        .map(|(id, c)| mean(&epochs[1][id]) - c)
        .collect();
    let shifts = local_shifts(&centroids, &moved);
    let pair = |k: usize| {
        let near = |epoch: usize| -> Vec<NearPoint> {
            epochs[epoch][&ids[k]]
                .iter()
                .map(|p| NearPoint {
                    offset: (p.place - centroids[k]).cast::<f32>().into(),
                    labelled: true,
                })
                .collect()
        };
        let chosen = stone_points([&near(0), &near(1)], &stones[k].normal, &shifts[k], 0.0);
        PairPoints {
            first: StoneId(ids[k]),
            second: StoneId(ids[k]),
            centroid: centroids[k],
            centroid_second: mean(&epochs[1][&ids[k]]),
            normal: stones[k].normal,
            points_first: Cloud::new(centroids[k], chosen.first),
            points_second: Cloud::new(centroids[k], chosen.second),
            nearby_second: Cloud::new(centroids[k], chosen.nearby_second),
            window: chosen.window.map(std::sync::Arc::new),
        }
    };
    MemoryPairs::new((0..ids.len()).map(pair).collect())
}
