//! Measures what the sources of two epochs and stable areas show of the epochs' common error, against the
//! truth.
//!
//! `cargo run --release -p stonewise-core --example measure_epoch_errors -- FOLDER [tls|uav] [stable]`,
//! FOLDER with `truth/epochN_cloud_SENSOR_truth.laz` (stone_id, point_source_id, gps_time) and
//! `truth/stones.csv`.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use nalgebra::{Matrix3, Point3, Vector3};
use std::collections::BTreeMap;
use std::path::Path;
use stonewise_core::cloud::Cloud;
use stonewise_core::geometry::Plane;
use stonewise_core::id::StoneId;
use stonewise_core::progress::Silent;
use stonewise_core::registration::observers::{
    EpochErrorParams, EpochPair, SeenStone, Source, SourcePoints, StablePoints, epoch_errors,
};
use stonewise_core::registration::{
    AdjustmentParams, MemoryPairs, NearPoint, PairPoints, adjust, local_shifts, stone_points,
};

#[allow(dead_code)] // rotations and shared motions are for another example
#[path = "shared/dam_small.rs"]
mod dam_small;

use dam_small::{SurveyPoint, read_points, read_stones};

type Epoch = BTreeMap<u32, Vec<SurveyPoint>>;

fn read(path: &Path) -> Epoch {
    let mut epoch = Epoch::new();
    for p in read_points(path) {
        epoch.entry(p.stone).or_default().push(p);
    }
    epoch
}

fn mean(points: &[SurveyPoint]) -> Point3<f64> {
    Point3::from(points.iter().map(|p| p.place.coords).sum::<Vector3<f64>>() / points.len() as f64)
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let folder = Path::new(&args[0]).join("truth");
    let sensor = args.get(1).map_or("tls", String::as_str);
    let with_stable = args.iter().any(|a| a == "stable");
    let epochs = [1, 2].map(|n| read(&folder.join(format!("epoch{n}_cloud_{sensor}_truth.laz"))));
    let truth = read_stones(&folder.join("stones.csv"), sensor);
    let ids: Vec<u32> = truth
        .keys()
        .copied()
        .filter(|id| epochs.iter().all(|e| e.get(id).is_some_and(|p| p.len() >= 10)))
        .collect();
    let centroids: Vec<Point3<f64>> = ids.iter().map(|id| mean(&epochs[0][id])).collect();
    let normals: Vec<Vector3<f64>> = ids
        .iter()
        .map(|id| {
            let places: Vec<Point3<f64>> = epochs[0][id].iter().map(|p| p.place).collect();
            let n = Plane::fit(&places).unwrap().normal;
            n * n.dot(&truth[id].normal).signum()
        })
        .collect();
    let sources: Vec<Source> = [0, 1]
        .into_iter()
        .flat_map(|epoch| {
            let mut found: Vec<u16> = epochs[epoch].values().flatten().map(|p| p.source).collect();
            found.sort_unstable();
            found.dedup();
            found.into_iter().map(move |s| Source {
                name: format!("{epoch}/{s}"),
                epoch,
                has_times: true,
            })
        })
        .collect();
    let index = |epoch: usize, source: u16| {
        let name = format!("{epoch}/{source}");
        sources.iter().position(|s| s.name == name).unwrap()
    };
    let stones: Vec<SeenStone> = ids
        .iter()
        .zip(&centroids)
        .zip(&normals)
        .map(|((id, centroid), normal)| {
            let mut sights: BTreeMap<usize, Vec<&SurveyPoint>> = BTreeMap::new();
            for epoch in [0, 1] {
                for p in &epochs[epoch][id] {
                    sights.entry(index(epoch, p.source)).or_default().push(p);
                }
            }
            let sight = |(source, points): (usize, Vec<&SurveyPoint>)| SourcePoints {
                source,
                count: points.len() as u64,
                time_s: points.iter().map(|p| p.time_s).sum::<f64>() / points.len() as f64,
                points: Cloud::from_world(*centroid, points.iter().map(|p| p.place)),
            };
            SeenStone {
                centroid: *centroid,
                normal: *normal,
                sights: sights.into_iter().map(sight).collect(),
            }
        })
        .collect();
    let mut stable: Vec<StablePoints> = Vec::new();
    if with_stable {
        for epoch in [0, 1] {
            let mut parts: BTreeMap<usize, Vec<&SurveyPoint>> = BTreeMap::new();
            for p in epochs[epoch]
                .get(&0)
                .into_iter()
                .flatten()
                .filter(|p| is_stable(&p.place))
            {
                parts.entry(index(epoch, p.source)).or_default().push(p);
            }
            stable.extend(parts.into_iter().map(|(source, points)| StablePoints {
                area: 0,
                source,
                points: Cloud::from_world(Point3::origin(), points.iter().map(|p| p.place)),
                times_s: points.iter().map(|p| p.time_s).collect(),
            }));
        }
    }
    let moved: Vec<Vector3<f64>> = ids
        .iter()
        .zip(&centroids)
        .map(|(id, c)| mean(&epochs[1][id]) - c)
        .collect();
    let shifts = local_shifts(&centroids, &moved);
    let pairs: Vec<PairPoints> = (0..ids.len())
        .map(|k| {
            let near = |epoch: usize| -> Vec<NearPoint> {
                epochs[epoch][&ids[k]]
                    .iter()
                    .map(|p| NearPoint {
                        offset: (p.place - centroids[k]).cast::<f32>().into(),
                        labelled: true,
                    })
                    .collect()
            };
            let chosen = stone_points([&near(0), &near(1)], &normals[k], &shifts[k], 0.0);
            PairPoints {
                first: StoneId(ids[k]),
                second: StoneId(ids[k]),
                centroid: centroids[k],
                centroid_second: mean(&epochs[1][&ids[k]]),
                normal: normals[k],
                points_first: Cloud::new(centroids[k], chosen.first),
                points_second: Cloud::new(centroids[k], chosen.second),
                nearby_second: Cloud::new(centroids[k], chosen.nearby_second),
                window: chosen.window.map(std::sync::Arc::new),
            }
        })
        .collect();
    let report = adjust(&MemoryPairs::new(pairs), &AdjustmentParams::default(), &Silent).unwrap();
    println!("sigma {:?}", report.sigma_m);
    let started = std::time::Instant::now();
    let same: Vec<usize> = (0..sources.len()).collect();
    let pair = EpochPair {
        sources: &sources,
        same_as: &same,
        stones: &stones,
        neighbours: &[],
        stable: &stable,
        offered: &[],
        sigma_m: report.sigma_m[0].max(report.sigma_m[1]),
    };
    let found = epoch_errors(&pair, &EpochErrorParams::default());
    println!("{:?} in {:.1} s", found.datum, started.elapsed().as_secs_f64());
    println!(
        "{:#?} significance {:.1} observations {:?}",
        found.components, found.significance, found.observations
    );
    println!("stretch {:?}", found.stretch);
    for s in &found.sources {
        println!(
            "{} {} +- {} mm",
            s.name,
            text(&(1e3 * s.against_epoch)),
            text(&(1e3 * s.sd))
        );
    }
    let mut raw = Vec::new();
    let mut left = Vec::new();
    let mut inside = [0; 3];
    let mut chi = 0.0;
    for (k, r) in report.results.iter().enumerate() {
        let Ok(m) = &r.motion else { continue };
        let t = &truth[&ids[k]];
        if !t.countable {
            continue;
        }
        let error = m.displacement - t.displacement;
        let rest = error - found.at[k].mean;
        let c: Matrix3<f64> = m.covariance.fixed_view::<3, 3>(0, 0) + found.at[k].covariance;
        for a in 0..3 {
            inside[a] += usize::from(rest[a].abs() < 1.96 * c[(a, a)].sqrt());
        }
        chi += rest.dot(&(c.try_inverse().unwrap() * rest));
        raw.push(error);
        left.push(rest);
        if k % 20 == 0 {
            println!(
                "{:4} error {} predicted {} sd {} mm",
                ids[k],
                text(&(1e3 * error)),
                text(&(1e3 * found.at[k].mean)),
                text(&(1e3 * c.diagonal().map(f64::sqrt)))
            );
        }
    }
    let n = raw.len() as f64;
    let rms = |list: &[Vector3<f64>]| {
        let s: Vector3<f64> = list.iter().map(|e| e.component_mul(e)).sum::<Vector3<f64>>() / n;
        1e3 * s.map(f64::sqrt)
    };
    println!("rms before {} after {} mm", text(&rms(&raw)), text(&rms(&left)));
    println!(
        "coverage x y z {:.2} {:.2} {:.2}, chi-square {:.1}",
        inside[0] as f64 / n,
        inside[1] as f64 / n,
        inside[2] as f64 / n,
        chi / n
    );
}

fn text(v: &Vector3<f64>) -> String {
    format!("{:6.2} {:6.2} {:6.2}", v.x, v.y, v.z)
}

/// The ground and the small building in front of the wall.
fn is_stable(p: &Point3<f64>) -> bool {
    p.x > 0.35 && p.z < 2.6
}
