//! What the simulator promises about its clouds, measured back from them.

use nalgebra::{Point3, Vector3};
use stonewise_core::cloud::GridIndex;
use stonewise_core::simulate::{
    FacePoint, Scan, SceneParams, Sensor, SurroundingsParams, Target, TlsParams, UavParams, WallMotion,
    WallParams, Window, World, scan_window, simulate_scans, surroundings,
};

fn small(seed: u64) -> SceneParams {
    let params = SceneParams {
        wall: WallParams {
            width_m: 1.8,
            height_m: 1.4,
            ..WallParams::default()
        },
        ..SceneParams::default()
    };
    params.seeded(seed)
}

fn nothing_around() -> SurroundingsParams {
    SurroundingsParams {
        annex: false,
        railing: false,
        shrubs: 0,
        ..SurroundingsParams::default()
    }
}

/// A scanner without errors of registration, pointing and footprint.
fn plain_tls() -> TlsParams {
    let mut tls = TlsParams {
        stations: 1,
        placement_m: 0.0,
        registration_m: 0.0,
        registration_rad: 0.0,
        ..TlsParams::default()
    };
    tls.beam.pointing_noise_rad = 0.0;
    tls.beam.exit_radius_m = 0.0;
    tls.beam.divergence_rad = 0.0;
    tls
}

fn all_motions() -> Vec<WallMotion> {
    vec![
        WallMotion::Settlement {
            from_m: -0.9,
            to_m: 0.9,
            depth_m: 0.01,
        },
        WallMotion::Bulge {
            centre_m: [0.0, 0.7],
            depth_m: 0.04,
            diameter_m: 1.5,
        },
        WallMotion::Crack {
            along_m: 0.2,
            slope: 0.3,
            d_m: [0.01, 0.0, 0.004],
        },
        WallMotion::Loose {
            share: 0.0,
            at_least: 3,
            shift_m: [0.01, 0.03],
            rotation_rad: 0.035,
        },
    ]
}

fn exact(scan: &Scan, i: usize) -> Point3<f64> {
    scan.cloud.origin() + Vector3::from(scan.exact[i]).cast::<f64>()
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(s, n), v| (s + v * v, n + 1.0));
    f64::sqrt(sum / count)
}

#[test]
fn range_noise_and_its_growth_with_incidence_are_as_stated() {
    let params = SceneParams {
        tls: Some(plain_tls()),
        ..small(3)
    };
    let world = World::new(&params);
    let scan = world.scan(&params, 0).tls.unwrap();
    for (low, high) in [(0.95, 1.0), (0.5, 0.7)] {
        let chosen: Vec<usize> = (0..scan.len())
            .filter(|&i| scan.cos_incidence[i] > low && scan.cos_incidence[i] <= high)
            .collect();
        assert!(
            chosen.len() > 1000,
            "{} points between {low} and {high}",
            chosen.len()
        );
        let measured = rms(chosen
            .iter()
            .map(|&i| (scan.cloud.world(i) - exact(&scan, i)).norm()));
        let stated = rms(chosen
            .iter()
            .map(|&i| 0.0015 / f64::from(scan.cos_incidence[i]).sqrt()));
        assert!(
            (measured / stated - 1.0).abs() < 0.06,
            "{measured} against {stated}"
        );
    }
}

#[test]
fn a_drone_adds_its_own_noise_and_an_error_per_strip() {
    let mut uav = UavParams {
        datum_m: 0.0,
        ..UavParams::default()
    };
    uav.beam.exit_radius_m = 0.0;
    uav.beam.divergence_rad = 0.0;
    let params = SceneParams {
        uav: Some(uav.clone()),
        ..small(3)
    };
    let scan = World::new(&params).scan(&params, 0).uav.unwrap();
    for strip in 0..uav.strips as u16 {
        let errors: Vec<Vector3<f64>> = (0..scan.len())
            .filter(|&i| scan.station[i] == strip && scan.cos_incidence[i] > 0.8)
            .map(|i| scan.cloud.world(i) - exact(&scan, i))
            .collect();
        let n = errors.len() as f64;
        let mean = errors.iter().sum::<Vector3<f64>>() / n;
        // The gradient noise that drives the drift stays under 4 standard deviations.
        assert!(mean.norm() > 1e-4 && mean.amax() < 4.0 * uav.drift_m, "{mean:?}");
        let spread = (errors.iter().map(|e| (e - mean).norm_squared()).sum::<f64>() / n).sqrt();
        // Along the beam 11 mm, up to 1/sqrt(0.8) more at an angle; across it 0.1 mrad at 12 m, twice.
        assert!((0.0108..0.0126).contains(&spread), "{spread}");
    }
}

#[test]
fn points_lie_at_the_stated_distance() {
    let params = SceneParams {
        surroundings: nothing_around(),
        uav: Some(UavParams::default()),
        ..small(4)
    };
    let world = World::new(&params);
    let scans = world.scan(&params, 0);
    for (scan, spacing) in [(scans.tls.unwrap(), 0.005), (scans.uav.unwrap(), 0.009)] {
        let inside = (0..scan.len()).filter(|&i| {
            let f = world.wall.face.face_of(&scan.cloud.world(i));
            f.a.abs() < 0.6 && (f.u - 0.7).abs() < 0.4
        });
        let per_point = 1.2 * 0.8 / inside.count() as f64;
        assert!(
            (per_point.sqrt() / spacing - 1.0).abs() < 0.12,
            "{}",
            per_point.sqrt()
        );
    }
}

#[test]
fn every_stone_moves_as_a_rigid_body_and_by_its_true_motion() {
    let params = SceneParams {
        motions: all_motions(),
        ..small(5)
    };
    let world = World::new(&params);
    let (before, after) = (world.scene(0), world.scene(1));
    let mut checked = 0;
    for k in 0..6000 {
        let (a, u) = (
            -0.85 + 1.7 * f64::from(k % 100) / 100.0,
            0.05 + 1.3 * f64::from(k / 100) / 60.0,
        );
        let Some(hit) = after.on_face(a, u) else { continue };
        let Target::Stone(i, _) = hit.target else { continue };
        let second_from_first = &world.motions[i].second_from_first;
        let back = second_from_first.inverse() * hit.point;
        // A ray that comes down where the point was in epoch 1 must meet the same surface there.
        let normal = second_from_first.inverse() * hit.normal;
        let Some(first) = before.trace(&(back + normal * 0.02), &-normal) else {
            continue;
        };
        if first.target.stone() == hit.target.stone() {
            assert!(
                (first.point - back).norm() < 2e-6,
                "{}",
                (first.point - back).norm()
            );
            checked += 1;
        }
    }
    assert!(checked > 3500, "{checked}");
    assert_eq!(world.motions.iter().filter(|m| m.loose).count(), 3);
}

#[test]
fn nothing_behind_the_annex_is_measured() {
    let params = SceneParams {
        tls: Some(plain_tls()),
        ..small(6)
    };
    let world = World::new(&params);
    let scan = world.scan(&params, 0).tls.unwrap();
    let tls = plain_tls();
    let mut station = world.wall.face.world_of(&FacePoint {
        a: 0.0,
        u: 0.0,
        n: tls.distance_m,
    });
    station.z = tls.height_m;
    let props = surroundings(&world.wall, &params.surroundings);
    let hidden = |p: &Point3<f64>| {
        let towards = (station - p).normalize();
        (5..70).any(|k| {
            let on_beam = p + towards * (0.02 * f64::from(k));
            props.iter().any(|b| b.contains(&on_beam))
        })
    };
    let stones = |s: &Scan| -> Vec<usize> { (0..s.len()).filter(|&i| s.stone[i] > 0).collect() };
    let seen = stones(&scan);
    let wrong = seen.iter().filter(|&&i| hidden(&exact(&scan, i))).count();
    // The scanner's height is known to 10 cm only, so the rim of the shadow may differ.
    assert!(wrong < seen.len() / 50, "{wrong} of {} points", seen.len());

    let open = SceneParams {
        surroundings: nothing_around(),
        ..params
    };
    let full = World::new(&open).scan(&open, 0).tls.unwrap();
    let all = stones(&full);
    let behind = all.iter().filter(|&&i| hidden(&exact(&full, i))).count();
    assert!(behind > all.len() / 20, "{behind} of {} points", all.len());
}

#[test]
fn a_dam_scanned_piece_by_piece_is_the_dam_scanned_at_once() {
    let mut uav = UavParams {
        spacing_m: 0.03,
        ..UavParams::default()
    };
    let mut tls = TlsParams {
        stations: 2,
        spacing_m: 0.02,
        ..plain_tls()
    };
    for beam in [&mut uav.beam, &mut tls.beam] {
        beam.pointing_noise_rad = 0.0;
        beam.exit_radius_m = 0.0;
        beam.divergence_rad = 0.0;
    }
    let params = SceneParams {
        wall: WallParams {
            width_m: 18.0,
            height_m: 2.0,
            plan_radius_m: 40.0,
            ..WallParams::default()
        },
        tls: Some(tls),
        uav: Some(uav),
        ..small(9)
    };
    let world = World::new(&params);
    let extent = world.wall.extent();
    let windows = Window::cover(extent);
    assert_eq!(windows.len(), 2);
    let whole = world.scan(&params, 0);
    for (sensor, whole) in [
        (Sensor::Tls, whole.tls.unwrap()),
        (Sensor::Uav, whole.uav.unwrap()),
    ] {
        let known: Vec<Point3<f64>> = (0..whole.len()).map(|i| exact(&whole, i)).collect();
        let index = GridIndex::new(&known, 0.05);
        let (mut count, mut same) = (0usize, 0usize);
        for window in &windows {
            let surface = world.surface(window.surroundings(extent));
            let scan = scan_window(&world.scene_of(&surface, 0), &params, sensor, 0, window).unwrap();
            for i in 0..scan.len() {
                let near = index.nearest(&exact(&scan, i), 0.01);
                count += 1;
                same += usize::from(near.is_some_and(|(j, d)| d < 1e-4 && whole.stone[j] == scan.stone[i]));
            }
        }
        assert!(
            count.abs_diff(whole.len()) * 1000 < whole.len(),
            "{count} of {}",
            whole.len()
        );
        assert!(same * 1000 >= count * 999, "{sensor:?}: {same} of {count}");
    }
}

#[test]
fn incidence_follows_from_where_the_station_stands() {
    let params = SceneParams {
        surroundings: nothing_around(),
        wall: WallParams {
            width_m: 12.0,
            height_m: 2.0,
            relief: 0.3,
            ..WallParams::default()
        },
        tls: Some(TlsParams {
            distance_m: 4.0,
            spacing_m: 0.02,
            ..plain_tls()
        }),
        ..small(10)
    };
    let world = World::new(&params);
    let scan = world.scan(&params, 0).tls.unwrap();
    let place = world.wall.face.world_of(&FacePoint {
        a: 0.0,
        u: 0.0,
        n: 4.0,
    });
    // The scanner's height is known to 10 cm.
    let station = Point3::new(place.x, place.y, 1.7);
    let out = world.wall.face.frame(0.0).out;
    for (low, high) in [(0.0, 1.0), (2.5, 3.5), (5.0, 6.0)] {
        let inside =
            (0..scan.len()).filter(|&i| scan.stone[i] > 0 && (low..high).contains(&exact(&scan, i).y.abs()));
        let (mut stated, mut plane, mut n) = (0.0, 0.0, 0.0);
        for i in inside {
            stated += f64::from(scan.cos_incidence[i]);
            plane += (station - exact(&scan, i)).normalize().dot(&out);
            n += 1.0;
        }
        assert!(n > 1000.0, "{n}");
        // Relief, facets and rounded edges turn faces by some 20 degrees: seen square on that costs a few hundredths of the
        // cosine, seen at an angle faces turn towards the beam as well as away.
        let ratio = stated / plane;
        assert!(
            (0.88..1.2).contains(&ratio),
            "{low}: {} and {}",
            stated / n,
            plane / n
        );
    }
}

#[test]
fn a_station_scans_no_further_than_it_reaches() {
    let params = SceneParams {
        surroundings: nothing_around(),
        wall: WallParams {
            width_m: 12.0,
            height_m: 1.5,
            ..WallParams::default()
        },
        tls: Some(TlsParams {
            stations: 4,
            reach_m: 3.0,
            spacing_m: 0.02,
            distance_m: 5.0,
            placement_m: 0.0,
            ..TlsParams::default()
        }),
        ..small(11)
    };
    let world = World::new(&params);
    let scan = world.scan(&params, 0).tls.unwrap();
    for i in 0..scan.len() {
        let station = -4.5 + 3.0 * f64::from(scan.station[i]);
        assert!((exact(&scan, i).y - station).abs() < 3.01);
    }
    // Two stations see each place but for the ends; square on the merged spacing is as asked.
    let middle = (0..scan.len()).filter(|&i| {
        let f = world.wall.face.face_of(&scan.cloud.world(i));
        f.a.abs() < 1.5 && (0.4..1.2).contains(&f.u)
    });
    let spacing = (3.0 * 0.8 / middle.count() as f64).sqrt();
    assert!((spacing / 0.02 - 1.0).abs() < 0.2, "{spacing}");
}

#[test]
fn the_number_of_threads_changes_nothing_and_the_seed_does() {
    let params = SceneParams {
        motions: all_motions(),
        uav: Some(UavParams::default()),
        ..small(7)
    };
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| simulate_scans(&params).1)
    };
    let (one, two) = (run(1), run(2));
    for (a, b) in one.iter().zip(&two) {
        let ((a_tls, b_tls), (a_uav, b_uav)) = ((&a.tls, &b.tls), (&a.uav, &b.uav));
        assert_eq!(a_tls.as_ref().unwrap().cloud, b_tls.as_ref().unwrap().cloud);
        assert_eq!(a_uav.as_ref().unwrap().cloud, b_uav.as_ref().unwrap().cloud);
        assert_eq!(a_tls.as_ref().unwrap().stone, b_tls.as_ref().unwrap().stone);
    }
    let other = simulate_scans(&small(8)).1;
    assert_ne!(
        other[0].tls.as_ref().unwrap().cloud,
        one[0].tls.as_ref().unwrap().cloud
    );
}
