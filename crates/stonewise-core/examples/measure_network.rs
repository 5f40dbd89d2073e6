//! Measures the network adjustment on the simulated dam with true labels.
//!
//! `cargo run -p stonewise-core --example measure_network [CASE [SENSOR]]`, or `scale SENSOR STONES` for time; cases: translation, bulge, combo,
//! crack, still, merged, each with `tls` or `uav`. Prints RMSE in the face (2D) and out of it, percentiles, loose
//! stones, coverage. Skips where the data are absent.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, missing_docs)]

use nalgebra::{Point3, Vector3};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use stonewise_core::cloud::Cloud;
use stonewise_core::geometry::{FaceFrame, Plane};
use stonewise_core::id::StoneId;
use stonewise_core::progress::Silent;
use stonewise_core::registration::{MemoryPairs, NetworkParams, PairPoints, PairSource, adjust};

type Stones = BTreeMap<u32, Vec<Point3<f64>>>;

#[derive(Clone, Debug)]
struct Truth {
    centroid: Point3<f64>,
    normal: Vector3<f64>,
    displacement: Vector3<f64>,
    rotation: Vector3<f64>,
    loose: bool,
    countable: bool,
}

fn data() -> PathBuf {
    std::env::var_os("STONEWISE_SURVEY").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/dam_small"),
        PathBuf::from,
    )
}

fn read_stones(path: &Path) -> Stones {
    let mut reader = las::Reader::from_path(path).unwrap();
    let mut stones = Stones::new();
    for point in reader.read_all().unwrap().points() {
        let point = point.unwrap();
        let id = u32::from_le_bytes(point.extra_bytes[..4].try_into().unwrap());
        if id > 0 {
            stones
                .entry(id)
                .or_default()
                .push(Point3::new(point.x, point.y, point.z));
        }
    }
    stones
}

fn read_truth(path: &Path, sensor: &str) -> BTreeMap<u32, Truth> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| header.iter().position(|h| *h == name).unwrap();
    lines
        .map(|line| {
            let f: Vec<f64> = line.split(',').map(|v| v.parse().unwrap()).collect();
            let vector = |a: &str, b: &str, c: &str| Vector3::new(f[column(a)], f[column(b)], f[column(c)]);
            let truth = Truth {
                centroid: vector("cx", "cy", "cz").into(),
                normal: vector("nx", "ny", "nz"),
                displacement: vector("dx", "dy", "dz"),
                rotation: vector("rx", "ry", "rz"),
                loose: f[column("loose")] > 0.5,
                countable: f[column(&format!("vis_{sensor}"))] >= 0.35 && f[column("edge")] < 0.5,
            };
            (f[column("stone_id")] as u32, truth)
        })
        .collect()
}

fn mean(points: &[Point3<f64>]) -> Point3<f64> {
    (points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / points.len() as f64).into()
}

/// Displacement prescribed at a point of a stone with this epoch-1 centroid.
fn field(case: &str, p: &Point3<f64>, centroid: &Point3<f64>) -> Vector3<f64> {
    match case {
        "translation" => Vector3::new(0.0, 0.02, 0.05),
        "bulge" => {
            let direction = Vector3::new(1.0, 0.0, 0.2).normalize();
            let d = p - Point3::new(-0.2, 0.4, 1.3);
            let r = (d - direction * d.dot(&direction)).norm();
            let depth = if r < 1.125 {
                0.05 * (std::f64::consts::PI * r / 2.25).cos().powi(2)
            } else {
                0.0
            };
            direction * depth
        }
        "crack" if centroid.y > 0.2 => Vector3::new(0.003, 0.008, 0.005),
        _ => Vector3::zeros(),
    }
}

fn build(case: &str, sensor: &str) -> (Vec<PairPoints>, BTreeMap<u32, Truth>) {
    let folder = data()
        .join(if case.starts_with("combo") {
            "combo"
        } else {
            "split"
        })
        .join("truth");
    let first = read_stones(&folder.join(format!("epoch1_cloud_{sensor}_truth.laz")));
    let mut second = read_stones(&folder.join(format!("epoch2_cloud_{sensor}_truth.laz")));
    let mut truth = read_truth(&folder.join("stones.csv"), sensor);
    let mut centroids = BTreeMap::new();
    for (id, t) in &mut truth {
        let Some(points) = first.get(id) else { continue };
        let c = mean(points);
        centroids.insert(*id, c);
        if case == "combo_datum" {
            let turn = nalgebra::Rotation3::new(t.rotation).inverse();
            for p in second.get_mut(id).into_iter().flatten() {
                *p = t.centroid + turn * (*p - t.centroid - t.displacement);
            }
            t.displacement = Vector3::zeros();
            t.loose = false;
        } else if case.starts_with("combo") {
            let turn = nalgebra::Rotation3::new(t.rotation);
            t.displacement += turn * (c - t.centroid) - (c - t.centroid);
        } else {
            t.displacement = field(case, &c, &c);
            t.rotation = Vector3::zeros();
            if let Some(points) = second.get_mut(id) {
                points.iter_mut().for_each(|p| *p += field(case, p, &c));
            }
        }
    }
    if case.ends_with("masks") {
        spoil(&mut second, &mut truth);
    }
    let pairs = first
        .iter()
        .filter_map(|(id, points)| {
            let other = second.get(id)?;
            if points.len() < 10 || other.len() < 10 {
                return None;
            }
            let centroid = mean(points);
            let mut normal = Plane::fit(points)?.normal;
            if normal.dot(&truth[id].normal) < 0.0 {
                normal = -normal;
            }
            Some(PairPoints {
                first: StoneId(*id),
                second: StoneId(*id),
                centroid,
                centroid_second: mean(other),
                normal,
                points_first: Cloud::from_world(centroid, points.iter().copied()),
                points_second: Cloud::from_world(centroid, other.iter().copied()),
            })
        })
        .collect();
    (pairs, truth)
}

/// Merges, halves and swaps the second epoch's masks of 15 % of the stones; those swapped must not be reported.
fn spoil(second: &mut Stones, truth: &mut BTreeMap<u32, Truth>) {
    let ids: Vec<u32> = second.keys().copied().collect();
    for (k, id) in ids.iter().enumerate().filter(|(k, _)| k % 7 == 3) {
        let next = ids[(k + 1) % ids.len()];
        match (k / 7) % 3 {
            0 => {
                let extra = second[&next].clone();
                second.get_mut(id).unwrap().extend(extra);
            }
            1 => {
                let c = mean(&second[id]);
                second.get_mut(id).unwrap().retain(|p| p.y > c.y);
            }
            _ => {
                let (a, b) = (second[id].clone(), second[&next].clone());
                second.insert(*id, b);
                second.insert(next, a);
                for id in [id, &next] {
                    truth.get_mut(id).unwrap().countable = false;
                }
            }
        }
    }
}

fn rms(v: impl Iterator<Item = f64>) -> f64 {
    let v: Vec<f64> = v.collect();
    (v.iter().map(|x| x * x).sum::<f64>() / v.len().max(1) as f64).sqrt()
}

fn percentile(v: impl Iterator<Item = f64>, q: f64) -> f64 {
    let mut v: Vec<f64> = v.collect();
    v.sort_by(f64::total_cmp);
    v.get(((v.len() as f64 * q) as usize).min(v.len().max(1) - 1))
        .copied()
        .unwrap_or(f64::NAN)
}

fn measure(case: &str, sensor: &str) {
    let (pairs, truth) = build(case, sensor);
    let start = std::time::Instant::now();
    let source = MemoryPairs::new(pairs);
    let report = adjust(&source, &NetworkParams::default(), &Silent).unwrap();
    let seconds = start.elapsed().as_secs_f64();
    let mut rows = Vec::new();
    let (mut failed, mut found, mut called, mut right) = (Vec::new(), 0, 0, 0);
    for (result, pair) in report.results.iter().zip(source.pairs()) {
        let t = &truth[&result.first.0];
        let motion = match &result.motion {
            Ok(m) => m,
            Err(e) => {
                failed.push(format!(
                    "{}{}: {e}",
                    result.first.0,
                    if t.countable { "" } else { " (not countable)" }
                ));
                continue;
            }
        };
        if !t.countable {
            continue;
        }
        let face = FaceFrame::from_normal(&t.normal).face_from_world();
        let error = face * (motion.displacement - t.displacement);
        let covariance = face * motion.covariance.fixed_view::<3, 3>(0, 0) * face.transpose();
        rows.push((
            pair.centroid,
            error,
            covariance,
            t.loose,
            motion.loose,
            result.first.0,
        ));
        found += usize::from(t.loose);
        called += usize::from(motion.loose);
        right += usize::from(t.loose && motion.loose);
    }
    let n = rows.len() as f64;
    let bias = rows.iter().map(|r| r.1).sum::<Vector3<f64>>() / n;
    let mm = 1e3;
    let plane = |e: &Vector3<f64>| e.x.hypot(e.y) * mm;
    println!(
        "{case:12} {sensor} n {:3} | in {:6.3} out {:6.3} | no datum in {:6.3} out {:6.3} | axes {:.3} {:.3} | median {:.3} p95 {:.3} max {:.2} | >1cm {}",
        rows.len(),
        rms(rows.iter().map(|r| plane(&r.1))),
        rms(rows.iter().map(|r| r.1.z * mm)),
        rms(rows.iter().map(|r| plane(&(r.1 - bias)))),
        rms(rows.iter().map(|r| (r.1 - bias).z * mm)),
        rms(rows.iter().map(|r| r.1.x * mm)),
        rms(rows.iter().map(|r| r.1.y * mm)),
        percentile(rows.iter().map(|r| plane(&r.1)), 0.5),
        percentile(rows.iter().map(|r| plane(&r.1)), 0.95),
        percentile(rows.iter().map(|r| r.1.norm() * mm), 1.0),
        rows.iter().filter(|r| r.1.norm() > 0.01).count(),
    );
    if case == "crack" {
        let near = rows.iter().filter(|r| (r.0.y - 0.2).abs() < 0.4);
        println!(
            "   within 0.4 m of the crack: in {:.3}",
            rms(near.map(|r| plane(&r.1)))
        );
    }
    let relative: Vec<Vector3<f64>> = rows
        .iter()
        .map(|r| {
            let mut near: Vec<_> = rows.iter().map(|o| ((o.0 - r.0).norm(), o.1)).collect();
            near.sort_by(|a, b| a.0.total_cmp(&b.0));
            let near = &near[1..near.len().min(25)];
            r.1 - near.iter().map(|o| o.1).sum::<Vector3<f64>>() / near.len() as f64
        })
        .collect();
    let coverage = |e: &dyn Fn(usize) -> Vector3<f64>| -> Vec<f64> {
        (0..3)
            .map(|a| {
                (0..rows.len())
                    .filter(|&i| e(i)[a].abs() <= 1.96 * rows[i].2[(a, a)].sqrt())
                    .count() as f64
                    / n
            })
            .collect()
    };
    let chi: Vec<f64> = rows
        .iter()
        .map(|r| {
            let e = r.1 - bias;
            r.2.try_inverse().map_or(f64::NAN, |i| (e.transpose() * i * e)[0])
        })
        .collect();
    println!(
        "   cover {:.2?} neighbour-relative {:.2?} | chi2 median/2.366 {:.2} mean/3 {:.2} | sd {:.3?} | loose true {found} called {called} right {right} | breaks {} | {} failed | {} iterations {} {seconds:.1} s",
        coverage(&|i| rows[i].1 - bias),
        coverage(&|i| relative[i]),
        percentile(chi.iter().copied(), 0.5) / 2.366,
        chi.iter().sum::<f64>() / n / 3.0,
        (0..3)
            .map(|a| percentile(rows.iter().map(|r| r.2[(a, a)].sqrt() * mm), 0.5))
            .collect::<Vec<_>>(),
        report.breaks.len(),
        failed.len(),
        report.iterations,
        if report.converged { "" } else { "NOT CONVERGED" },
    );
    if std::env::var_os("DETAIL").is_some() {
        println!(
            "   {:?} sigma {:?} roughness {} cell {} f {} bias {:.2?}",
            report.components,
            report.sigma_m,
            report.roughness_m,
            report.cell_m,
            report.correlation_factor,
            bias * mm
        );
        let mut worst = rows.clone();
        worst.sort_by(|a, b| (b.1 - bias).norm().total_cmp(&(a.1 - bias).norm()));
        for r in worst.iter().take(8) {
            println!(
                "   stone {} at {:.2?} error {:.2?} sd {:.2?} loose {} called {}",
                r.5,
                r.0.coords.as_slice(),
                (r.1 * mm).as_slice(),
                (0..3).map(|a| r.2[(a, a)].sqrt() * mm).collect::<Vec<_>>(),
                r.3,
                r.4
            );
        }
        for f in failed {
            println!("   failed {f}");
        }
    }
}

/// The split survey set side by side many times: a long wall, read copy by copy.
struct LongWall {
    pairs: Vec<PairPoints>,
    copies: usize,
}

impl PairSource for LongWall {
    type Error = std::convert::Infallible;

    fn batch_count(&self) -> usize {
        self.copies
    }

    fn load(&self, batch: usize) -> Result<Vec<PairPoints>, Self::Error> {
        let per_row = (self.copies as f64 * 4.0).sqrt().ceil() as usize;
        let shift = Vector3::new(
            0.0,
            4.0 * (batch % per_row) as f64,
            3.0 * (batch / per_row) as f64,
        );
        let moved = |c: &Cloud| Cloud::new(c.origin() + shift, c.offsets().to_vec());
        Ok(self
            .pairs
            .iter()
            .map(|p| PairPoints {
                first: StoneId(p.first.0 + 1000 * batch as u32),
                second: StoneId(p.second.0 + 1000 * batch as u32),
                centroid: p.centroid + shift,
                centroid_second: p.centroid_second + shift,
                normal: p.normal,
                points_first: moved(&p.points_first),
                points_second: moved(&p.points_second),
            })
            .collect())
    }
}

/// Time of the whole adjustment for about this many stones.
fn measure_scale(sensor: &str, stones: usize) {
    let (pairs, _) = build("bulge", sensor);
    let copies = stones.div_ceil(pairs.len());
    let count = copies * pairs.len();
    let start = std::time::Instant::now();
    let report = adjust(&LongWall { pairs, copies }, &NetworkParams::default(), &Silent).unwrap();
    println!(
        "{count} stones, {sensor}: {:.0} s, {} iterations, converged {}, loose {}",
        start.elapsed().as_secs_f64(),
        report.iterations,
        report.converged,
        report.loose
    );
}

fn main() {
    if !data().is_dir() {
        println!("skipped: no survey data");
        return;
    }
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    if let [first, sensor, stones] = &wanted[..]
        && first == "scale"
    {
        measure_scale(sensor, stones.parse().unwrap());
        return;
    }
    for case in [
        "translation",
        "bulge",
        "combo",
        "combo_datum",
        "crack",
        "still",
        "still_masks",
        "combo_masks",
    ] {
        for sensor in ["tls", "uav"] {
            if wanted.iter().all(|w| w == case || w == sensor) {
                measure(case, sensor);
            }
        }
    }
}
