//! Measures what is said of the deformation of scanned walls: how often it is claimed of still ones, whether its
//! intervals hold the truth, and which bulges are found.
//!
//! `cargo run --release -p stonewise-lab -- deformation [WORD ...]`. Words: sensors `tls uav` (default both),
//! `walls=N` (of a row, default 100), `first=N` (seed of the first wall), `depth=0,1` (of the bulge, mm, default 0),
//! `across=2` (its diameter, m, default 2), `toward=out,up,along,level` (its direction, default out; level: horizontally
//! out of the battered wall), `size=4x3` (of the wall, m). Every wall has stones, stations or strips and errors of its
//! own; it is scanned twice and adjusted with true labels.
//!
//! Columns: walls of which a deformation is claimed; coverage of the 95 % intervals of `def_*` along, up and out;
//! root mean square of their errors and standard deviations, mm; walls whose bulge has a zone over its middle, and the
//! mean overlap (IoU) of that zone with the stones that moved by more than a quarter of the bulge; detection limit of a
//! zone of 1 and 3 m out of the wall, and of 1 m in its face, mm; mean CRPS along, up and out, mm, over that of a
//! normal distribution as wide as the errors (see [`crate::sharpness`]), and the same ratio of the interval score.

use crate::Outcome;
use crate::figures::{coverage, rms_of_axes};
use crate::sharpness::Sharpness;
use crate::survey::ScannedWall;
use crate::table::Table;
use crate::words::Words;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::BTreeSet;
use stonewise_core::id::StoneId;
use stonewise_core::registration::observers::SeenStone;
use stonewise_simulate::{SceneParams, TlsParams, UavParams, WallMotion, WallParams};

/// Stations or strips of an epoch.
const SOURCES: [u32; 2] = [2, 3];

pub fn run(words: &Words) -> Outcome {
    let walls: u64 = words.number("walls=").unwrap_or(100);
    let first: u64 = words.number("first=").unwrap_or(1);
    let size = words.after("size=").unwrap_or("4x3");
    let size: Vec<f64> = size.split('x').map(|s| s.parse().unwrap()).collect();

    let numbers = |prefix: &str, default: &str| -> Vec<f64> {
        words
            .list(prefix, default)
            .iter()
            .map(|w| w.parse().unwrap())
            .collect()
    };

    let toward = words.list("toward=", "out");
    let table = Table::begin([
        "survey",
        "walls",
        "claimed",
        "held along",
        "up",
        "out",
        "error mm",
        "sd mm",
        "found",
        "IoU",
        "limit 1 m",
        "3 m",
        "in face 1 m",
        "CRPS mm",
        "over calibrated",
        "interval score over calibrated",
        "s",
    ]);

    for sensor in words.chosen(&["tls", "uav"]) {
        for &depth_mm in &numbers("depth=", "0") {
            let diameters = if depth_mm == 0.0 {
                vec![2.0]
            } else {
                numbers("across=", "2")
            };
            for (across_m, toward) in diameters.iter().flat_map(|d| toward.iter().map(move |t| (d, t))) {
                let case = Case {
                    is_tls: sensor == "tls",
                    size: [size[0], size[1]],
                    depth_m: depth_mm / 1e3,
                    across_m: *across_m,
                    toward: toward.clone(),
                };
                let started = std::time::Instant::now();
                let found: Vec<Wall> = (first..first + walls)
                    .into_par_iter()
                    .map(|seed| case.measure(seed))
                    .collect();
                let label = match depth_mm == 0.0 {
                    true => format!("{sensor}, still"),
                    false => format!("{sensor}, {depth_mm} mm {toward} over {across_m} m"),
                };
                table.row(cells(&label, &found, started.elapsed().as_secs_f64()));
            }
        }
    }

    Ok(())
}

struct Case {
    is_tls: bool,
    size: [f64; 2],
    depth_m: f64,
    across_m: f64,
    toward: String,
}

/// What was found of a wall.
struct Wall {
    is_claimed: bool,
    /// Error and standard deviation of each stone along, up and out, metres.
    stones: Vec<[Vector3<f64>; 2]>,
    /// Overlap of the zone over the middle of the bulge with the stones that moved; `None`: no such zone.
    overlap: Option<f64>,
    limits_m: [Option<f64>; 3],
    limits_in_face_m: [Option<f64>; 3],
}

impl Case {
    fn middle(&self) -> [f64; 2] {
        [0.2, 0.5 * self.size[1]]
    }

    fn params(&self, seed: u64) -> SceneParams {
        let wall = WallParams {
            width_m: self.size[0],
            height_m: self.size[1],
            ..WallParams::default()
        };
        let (sin, cos) = wall.batter.atan().sin_cos();
        let direction = match self.toward.as_str() {
            "out" => [0.0, 0.0, 1.0],
            "up" => [0.0, 1.0, 0.0],
            "along" => [1.0, 0.0, 0.0],
            "level" => [0.0, -sin, cos],
            other => panic!("toward={other} is none of out, up, along, level"),
        };
        let bulge = WallMotion::Zone {
            centre_m: self.middle(),
            d_m: direction.map(|d| d * self.depth_m),
            diameter_m: self.across_m,
        };

        SceneParams {
            wall,
            motions: if self.depth_m > 0.0 {
                vec![bulge]
            } else {
                Vec::new()
            },
            tls: self.is_tls.then(|| TlsParams {
                stations: SOURCES[0],
                registration_m: 4e-4,
                datum_m: 3e-4,
                spacing_m: 0.007,
                ..TlsParams::default()
            }),
            uav: (!self.is_tls).then(|| UavParams {
                strips: SOURCES[1],
                datum_m: 2e-3,
                drift_m: 3e-3,
                spacing_m: 0.012,
                ..UavParams::default()
            }),
            ..SceneParams::default()
        }
        .seeded(seed)
    }

    fn measure(&self, seed: u64) -> Wall {
        let wall = ScannedWall::new(&self.params(seed), SOURCES[usize::from(!self.is_tls)]);
        let (found, seen) = wall.deformation();
        let (seen_ids, stones): (Vec<StoneId>, Vec<SeenStone>) = seen.into_iter().unzip();
        let truth = |id: StoneId, k: usize| wall.truth(id, stones[k].centroid);
        let number = |id: StoneId| seen_ids.iter().position(|s| *s == id).unwrap();

        let stone = |s: &stonewise_core::registration::StoneDeformation| {
            let k = number(s.stone);
            let frame = stonewise_core::geometry::FaceFrame::from_normal(&stones[k].normal).face_from_world();
            let error = frame * (s.deformation - truth(s.stone, k));
            let spread = frame * s.covariance * frame.transpose();
            [error, spread.diagonal().map(f64::sqrt)]
        };

        let [along_m, up_m] = self.middle();
        let apart = |k: &usize| (stones[*k].centroid.y - along_m).hypot(stones[*k].centroid.z - up_m);
        let nearest = (0..stones.len())
            .min_by(|a, b| apart(a).total_cmp(&apart(b)))
            .unwrap();
        let moved: BTreeSet<StoneId> = (0..stones.len())
            .filter(|&k| truth(seen_ids[k], k).norm() > 0.25 * self.depth_m)
            .map(|k| seen_ids[k])
            .collect();
        let over = found.zones.iter().find(|z| z.stones.contains(&seen_ids[nearest]));
        let overlap = over.map(|zone| {
            let zone: BTreeSet<StoneId> = zone.stones.iter().copied().collect();
            zone.intersection(&moved).count() as f64 / zone.union(&moved).count().max(1) as f64
        });

        Wall {
            is_claimed: found.is_shown(),
            stones: found.stones.iter().map(stone).collect(),
            overlap,
            limits_m: found.detection_limits_m,
            limits_in_face_m: found.limits_in_face_m,
        }
    }
}

fn cells(label: &str, walls: &[Wall], seconds: f64) -> Vec<String> {
    let count = walls.len() as f64;
    let share = |holds: &dyn Fn(&Wall) -> bool| {
        format!(
            "{:.1} %",
            100.0 * walls.iter().filter(|w| holds(w)).count() as f64 / count
        )
    };

    let stones: Vec<&[Vector3<f64>; 2]> = walls.iter().flat_map(|w| &w.stones).collect();
    let held = |axis: usize| coverage(&stones, axis);
    let of_axes = |part: usize| rms_of_axes(&stones, part);
    let scores = [0, 1, 2].map(|axis| {
        let mut all = Sharpness::default();
        stones
            .iter()
            .for_each(|[e, sd]| all.add(1e3 * e[axis], 1e3 * sd[axis]));
        all
    });
    let score = |digits: usize, of: fn(&Sharpness) -> f64| {
        let axes = scores.each_ref().map(|s| format!("{:.digits$}", of(s)));
        axes.join(" / ")
    };
    let overlaps: Vec<f64> = walls.iter().filter_map(|w| w.overlap).collect();

    let limit = |of: &dyn Fn(&Wall) -> Option<f64>| {
        let known: Vec<f64> = walls.iter().filter_map(of).collect();
        format!(
            "{:.2}",
            1e3 * known.iter().sum::<f64>() / known.len().max(1) as f64
        )
    };

    vec![
        label.to_owned(),
        walls.len().to_string(),
        share(&|w| w.is_claimed),
        held(0),
        held(1),
        held(2),
        of_axes(0),
        of_axes(1),
        share(&|w| w.overlap.is_some()),
        format!(
            "{:.2}",
            overlaps.iter().sum::<f64>() / overlaps.len().max(1) as f64
        ),
        limit(&|w| w.limits_m[0]),
        limit(&|w| w.limits_m[1]),
        limit(&|w| w.limits_in_face_m[0]),
        score(3, Sharpness::crps),
        score(2, Sharpness::crps_ratio),
        score(2, Sharpness::interval_ratio),
        format!("{seconds:.0}"),
    ]
}
