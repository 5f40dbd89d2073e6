//! Surveys of the project's own simulator, another wall for each seed.

use super::bound;
use super::trial::{Crack, Trial, Truth};
use super::{Case, Options};
use crate::survey::{Places, mean};
use nalgebra::{Point3, Vector3};
use std::collections::BTreeMap;
use stonewise_core::evaluate::MotionField;
use stonewise_core::progress::Silent;
use stonewise_simulate::{
    Scan, SceneParams, SeenCells, TlsParams, UavParams, WallMotion, WallParams, World, stone_truths,
};

const CRACK_AT: f64 = 0.2;

pub fn build(case: Case, sensor: &str, seed: u64, options: &Options) -> Trial {
    let params = params(case, sensor, options).seeded(seed);
    let world = World::new(&params);
    let scan = |epoch: usize| {
        let scans = world.scan(&params, epoch);
        scans.tls.or(scans.uav).unwrap()
    };
    let first = scan(0);
    let truths = stone_truths(&world, &Silent).unwrap();
    let shares = |scan: &Scan, epoch: usize| {
        let mut cells = SeenCells::new(&world, epoch);
        cells.add(scan);
        cells.shares(&truths)
    };
    let mut seen = shares(&first, 0);

    let (halves, exact) = if case.is_split() {
        let field = prescribed(case);
        let (one, two) = split(&first, seed);
        // Joints go with their side of the crack.
        let shared = world.motions.iter().map(|m| m.shared);
        let of_joints = shared
            .max_by(|a, b| a.norm().total_cmp(&b.norm()))
            .unwrap_or_default();
        let mut moved = Places::new();
        for (id, points) in two {
            let rigid = world
                .motions
                .get((id as usize).wrapping_sub(1))
                .map(|m| m.second_from_first);
            let there = points.into_iter().map(|p| match (&field, rigid) {
                (Some(field), _) => field.apply(&p),
                (None, Some(motion)) => motion * p,
                (None, None) if p.y > CRACK_AT => p + of_joints,
                (None, None) => p,
            });
            moved.insert(id, there.collect());
        }
        ([one, moved], [0, 1].map(|_| exact(&world, &first, 0, 2)))
    } else {
        let second = scan(1);
        for (a, b) in seen.iter_mut().zip(shares(&second, 1)) {
            *a = a.min(b);
        }
        let mut exact = [exact(&world, &first, 0, 1), exact(&world, &second, 1, 1)];
        if let Some(mix) = &options.mix {
            for (epoch, exact) in exact.iter_mut().enumerate() {
                exact.weight *= mix.share(epoch);
                exact.noise_m = mix.noise_m(epoch);
            }
        }
        let mut epochs = [by_stone(&first), by_stone(&second)];
        if let Some(mix) = &options.mix {
            for (epoch, places) in epochs.iter_mut().enumerate() {
                mix.apply(epoch, seed, places);
            }
        }
        (epochs, exact)
    };

    let field = prescribed(case);
    let mut truth = BTreeMap::new();
    for ((t, motion), seen) in truths.iter().zip(&world.motions).zip(&seen) {
        let Some(points) = halves[0].get(&t.id.0) else {
            continue;
        };
        let c = mean(points);
        truth.insert(
            t.id.0,
            Truth {
                normal: t.normal,
                displacement: match &field {
                    Some(field) => field.displacement_at(&c),
                    None => motion.second_from_first * c - c,
                },
                shared: t.shared,
                loose: t.loose,
                countable: !t.edge && *seen >= 0.35,
                spoilt: false,
            },
        );
    }

    let beam = params
        .tls
        .as_ref()
        .map(|p| (&p.beam, p.distance_m))
        .or(params.uav.as_ref().map(|p| (&p.beam, p.distance_m)));
    let bounds = beam.map_or_else(BTreeMap::new, |(beam, distance)| {
        let sigma = beam.range_noise_m + beam.range_noise_per_m * (distance - 10.0).max(0.0);
        bound::bounds(&world, &exact, sigma)
    });

    Trial {
        stones: halves,
        truth,
        crack: (case == Case::Crack).then_some(Crack {
            across: Vector3::y(),
            at: CRACK_AT,
        }),
        bounds,
    }
}

fn params(case: Case, sensor: &str, options: &Options) -> SceneParams {
    let width_m = options.width_m;
    let crack = WallMotion::Crack {
        along_m: CRACK_AT,
        slope: 0.0,
        d_m: [0.008, 0.005, 0.003],
    };
    let settlement = WallMotion::Settlement {
        from_m: -0.5 * width_m,
        to_m: 0.5 * width_m,
        depth_m: 0.015,
    };
    let bulge = WallMotion::Bulge {
        centre_m: [0.4, 1.3],
        depth_m: 0.05,
        diameter_m: 2.25,
    };

    let edge = WallMotion::Bulge {
        centre_m: [0.5 * width_m - 0.7, 0.8],
        depth_m: 0.02,
        diameter_m: 2.25,
    };
    let loose = WallMotion::Loose {
        share: 0.03,
        at_least: 6,
        shift_m: [0.005, 0.03],
        rotation_rad: 0.035,
    };
    let exact = options.exact;

    SceneParams {
        wall: WallParams::sized([width_m, options.height_m]),
        motions: match case {
            Case::Still | Case::Translation | Case::Bulge | Case::Datum => Vec::new(),
            Case::Edge => vec![edge],
            Case::Crack => vec![crack],
            Case::Settlement => vec![settlement],
            Case::Loose => vec![loose],
            Case::Combo => vec![settlement, bulge, loose],
        },
        tls: (sensor == "tls").then(|| TlsParams {
            registration_m: if exact { 0.0 } else { 3e-4 },
            registration_rad: if exact { 0.0 } else { 2e-5 },
            spacing_m: options.spacing(0.005),
            ..TlsParams::default()
        }),
        uav: (sensor == "uav").then(|| UavParams {
            datum_m: if exact { 0.0 } else { 1.5e-3 },
            drift_m: if exact { 0.0 } else { 1.5e-3 },
            spacing_m: options.spacing(0.009),
            ..UavParams::default()
        }),
        ..SceneParams::default()
    }
}

/// The field that moves the points of the second half.
fn prescribed(case: Case) -> Option<MotionField> {
    match case {
        Case::Translation => MotionField::translation(Vector3::new(0.0, 0.02, 0.05)).ok(),
        Case::Bulge => {
            let direction = Vector3::new(1.0, 0.0, 0.2);
            MotionField::bulge(Point3::new(-0.2, 0.4, 1.3), 0.05, 2.25, direction).ok()
        }
        _ => None,
    }
}

fn by_stone(scan: &Scan) -> Places {
    let mut stones = Places::new();
    for (i, &id) in scan.stone.iter().enumerate() {
        stones.entry(id).or_default().push(scan.cloud.world(i));
    }
    stones
}

/// Points of a scan at random into two halves (a hash of their number).
fn split(scan: &Scan, seed: u64) -> (Places, Places) {
    let mut halves = (Places::new(), Places::new());
    for (i, &id) in scan.stone.iter().enumerate() {
        let mut x =
            (i as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ seed.wrapping_mul(0xd1b5_4a32_d192_ed03);
        x = (x ^ (x >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let half = if (x >> 40) & 1 == 0 {
            &mut halves.0
        } else {
            &mut halves.1
        };
        half.entry(id).or_default().push(scan.cloud.world(i));
    }
    halves
}

/// One in [`bound::STEP`] points of the stones where they truly lie on the unmoved wall. `share`: parts that the scan
/// is cut into.
fn exact(world: &World, scan: &Scan, epoch: usize, share: usize) -> bound::Exact {
    let origin = scan.cloud.origin();
    let step = bound::STEP;
    let points = (0..scan.len())
        .step_by(step)
        .filter(|&i| scan.stone[i] > 0)
        .map(|i| {
            let p = origin + Vector3::from(scan.exact[i]).cast::<f64>();
            let stone = scan.stone[i];
            let moved = &world.motions[stone as usize - 1].second_from_first;
            let home = if epoch == 0 { p } else { moved.inverse() * p };
            (stone, home, f64::from(scan.cos_incidence[i]))
        })
        .collect();
    bound::Exact {
        points,
        weight: step as f64 / share as f64,
        noise_m: 0.0,
    }
}
