//! What the simulator promises about its clouds, measured back from them.

use nalgebra::{Matrix3, Point3, Vector3};
use stonewise_core::cloud::GridIndex;
use stonewise_simulate::{
    BeamParams, EpochScans, FacePoint, Scan, SceneParams, Sensor, StationPlace, SurroundingsParams, Target,
    TlsParams, UavParams, WallMotion, WallParams, Window, World, scan_window, surroundings,
};

fn small(seed: u64) -> SceneParams {
    let params = SceneParams {
        wall: WallParams::sized([1.8, 1.4]),
        ..SceneParams::default()
    };
    params.seeded(seed)
}

fn scans(params: &SceneParams) -> [EpochScans; 2] {
    let world = World::new(params);
    [0, 1].map(|epoch| world.scan(params, epoch))
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
    for strip in 1..=uav.strips {
        let errors: Vec<Vector3<f64>> = (0..scan.len())
            .filter(|&i| scan.source[i] == strip && scan.cos_incidence[i] > 0.8)
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
        surroundings: SurroundingsParams::none(),
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
        surroundings: SurroundingsParams::none(),
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
fn stated_stations_stand_in_their_places_with_their_own_instruments() {
    let beam = |range_noise_m: f64| BeamParams {
        range_noise_m,
        ..plain_tls().beam
    };
    let places = vec![
        StationPlace {
            along_m: -0.4,
            distance_m: 5.0,
            step_rad: 2e-3,
            beam: beam(0.001),
            ..StationPlace::default()
        },
        StationPlace {
            along_m: 2.6,
            distance_m: 8.0,
            height_m: 3.0,
            step_rad: 1e-3,
            beam: beam(0.004),
            ..StationPlace::default()
        },
    ];
    let params = SceneParams {
        surroundings: SurroundingsParams::none(),
        tls: Some(TlsParams {
            places: places.clone(),
            ..plain_tls()
        }),
        ..small(12)
    };
    let world = World::new(&params);
    let scan = world.scan(&params, 0).tls.unwrap();
    for (number, stated) in places.iter().enumerate() {
        let of_station: Vec<usize> = (0..scan.len())
            .filter(|&i| scan.source[i] as usize == number + 1 && scan.stone[i] > 0)
            .collect();
        // Noise lies along the beams, so that they meet where the station stands: its height is known to 10 cm.
        let (mut matrix, mut side) = (Matrix3::zeros(), Vector3::zeros());
        let mut noise = Vec::new();
        for &i in &of_station {
            let error = scan.cloud.world(i) - exact(&scan, i);
            // Too little noise shows no direction.
            let Some(along) = error.try_normalize(1e-5) else {
                continue;
            };
            let across = Matrix3::identity() - along * along.transpose();
            let weight = error.norm_squared();
            matrix += weight * across;
            side += weight * across * exact(&scan, i).coords;
            noise.push(error.norm() * f64::from(scan.cos_incidence[i]).sqrt());
        }
        let station = Point3::from(matrix.lu().solve(&side).unwrap());
        let at = world.wall.face.world_of(&FacePoint {
            a: stated.along_m,
            u: 0.0,
            n: stated.distance_m,
        });
        let place = Point3::new(at.x, at.y, stated.height_m);
        assert!((station - place).norm() < 0.15, "{station} {place}");
        let noise = rms(noise.into_iter());
        assert!((noise / stated.beam.range_noise_m - 1.0).abs() < 0.05, "{noise}");
        // As many beams as the angle that the stones fill holds.
        let solid: f64 = { of_station.iter() }
            .map(|&i| (exact(&scan, i) - station).norm_squared())
            .map(|square| square * stated.step_rad.powi(2))
            .sum();
        let (area, cos) = (
            1.8 * 1.4,
            of_station.iter().map(|&i| f64::from(scan.cos_incidence[i])),
        );
        let cos = cos.sum::<f64>() / of_station.len() as f64;
        let share = solid / (area * cos);
        assert!((0.6..1.1).contains(&share), "{share}");
    }
}

#[test]
fn incidence_follows_from_where_the_station_stands() {
    let params = SceneParams {
        surroundings: SurroundingsParams::none(),
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
        // Relief, facets and rounded edges turn faces by some 20 degrees: seen square on that costs a few
        // hundredths of the cosine, seen at an angle faces turn towards the beam as well as away.
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
        surroundings: SurroundingsParams::none(),
        wall: WallParams::sized([12.0, 1.5]),
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
        let station = -4.5 + 3.0 * f64::from(scan.source[i] - 1);
        assert!((exact(&scan, i).y - station).abs() < 3.01);
    }
    // Two stations see each place but for the ends; square on the merged spacing is the one that was set.
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
    let run = |threads: usize| stonewise_testing::on_threads(threads, || scans(&params));
    let (one, two) = (run(1), run(2));
    for (a, b) in one.iter().zip(&two) {
        let ((a_tls, b_tls), (a_uav, b_uav)) = ((&a.tls, &b.tls), (&a.uav, &b.uav));
        assert_eq!(a_tls.as_ref().unwrap().cloud, b_tls.as_ref().unwrap().cloud);
        assert_eq!(a_uav.as_ref().unwrap().cloud, b_uav.as_ref().unwrap().cloud);
        assert_eq!(a_tls.as_ref().unwrap().stone, b_tls.as_ref().unwrap().stone);
        assert_eq!(a_tls.as_ref().unwrap().time, b_tls.as_ref().unwrap().time);
    }
    // The seed of the scene alone: measurements and motions change, the wall does not.
    let reseeded = SceneParams {
        seed: 8,
        ..params.clone()
    };
    for (a, b) in scans(&reseeded).iter().zip(&one) {
        assert_ne!(a.tls.as_ref().unwrap().cloud, b.tls.as_ref().unwrap().cloud);
        assert_ne!(a.uav.as_ref().unwrap().cloud, b.uav.as_ref().unwrap().cloud);
    }
    let [first, second] = [&params, &reseeded].map(World::new);
    let places = |world: &World| world.wall.stones.iter().map(|s| s.middle).collect::<Vec<_>>();
    assert!(places(&first) == places(&second) && first.motions != second.motions);
}

/// The points of each source in turn: the source, and the places of its points in the scan.
fn sources(scan: &Scan) -> Vec<(u32, Vec<usize>)> {
    let mut found: Vec<(u32, Vec<usize>)> = Vec::new();
    for (i, &source) in scan.source.iter().enumerate() {
        match found.iter_mut().find(|(s, _)| *s == source) {
            Some((_, points)) => points.push(i),
            None => found.push((source, vec![i])),
        }
    }
    found
}

#[test]
fn every_source_has_a_number_and_its_times_rise_and_follow_the_scan() {
    let params = SceneParams {
        tls: Some(TlsParams {
            stations: 3,
            ..TlsParams::default()
        }),
        uav: Some(UavParams::default()),
        ..small(12)
    };
    let world = World::new(&params);
    let mut last = 0.0;
    for epoch in 0..2 {
        let scans = world.scan(&params, epoch);
        let (tls, uav) = (scans.tls.unwrap(), scans.uav.unwrap());
        for scan in [&tls, &uav] {
            let sources = sources(scan);
            assert_eq!(sources.iter().map(|(s, _)| *s).collect::<Vec<_>>(), [1, 2, 3]);
            for (_, points) in sources {
                let times: Vec<f64> = points.iter().map(|&i| scan.time[i]).collect();
                assert!(times[0] > last, "sources come one after the other");
                assert!(times.windows(2).all(|w| w[0] < w[1]));
                last = times[times.len() - 1];
            }
        }
        // A strip is flown at an even speed: its points' places along the face are linear in time but for the
        // width of a fan.
        for (_, points) in sources(&uav) {
            let mean = |get: &dyn Fn(usize) -> f64| {
                points.iter().map(|&i| get(i)).sum::<f64>() / points.len() as f64
            };
            let (t0, y0) = (mean(&|i| uav.time[i]), mean(&|i| exact(&uav, i).y));
            let moment = |p: &dyn Fn(usize) -> f64, q: &dyn Fn(usize) -> f64| mean(&|i| p(i) * q(i));
            let (t, y) = (|i: usize| uav.time[i] - t0, |i: usize| exact(&uav, i).y - y0);
            let (tt, yy, ty) = (moment(&t, &t), moment(&y, &y), moment(&t, &y));
            assert!(ty / (tt * yy).sqrt() > 0.99, "{}", ty / (tt * yy).sqrt());
        }
    }
}

/// Errors of the ranges of a scan without registration errors, with the range and the cosine of the
/// incidence.
fn range_errors(world: &World, params: &SceneParams, source: u32) -> Vec<[f64; 3]> {
    let scan = world.scan(params, 0).tls.unwrap();
    let tls = params.tls.as_ref().unwrap();
    let apart = 1.8 / f64::from(tls.stations);
    let a = -0.9 + apart * (f64::from(source) - 0.5);
    let n = tls.distance_m;
    let mut station = world.wall.face.world_of(&FacePoint { a, u: 0.0, n });
    // The scanner's height is known to 10 cm.
    station.z = tls.height_m;
    (0..scan.len())
        .filter(|&i| scan.source[i] == source)
        .map(|i| {
            let beam = exact(&scan, i) - station;
            let error = (scan.cloud.world(i) - exact(&scan, i)).dot(&beam.normalize());
            [error, beam.norm(), f64::from(scan.cos_incidence[i])]
        })
        .collect()
}

#[test]
fn scales_differ_between_stations_and_lengthen_ranges_in_proportion() {
    let tls = |scale_error: f64| {
        let mut tls = TlsParams {
            stations: 2,
            scale_error,
            ..plain_tls()
        };
        tls.beam.range_noise_m = 0.0;
        tls.beam.range_noise_per_m = 0.0;
        tls
    };
    let params = |scale_error: f64| SceneParams {
        tls: Some(tls(scale_error)),
        ..small(13)
    };
    let world = World::new(&params(0.0));
    let mut scales = Vec::new();
    for station in [1, 2] {
        let with: Vec<f64> = range_errors(&world, &params(1e-3), station)
            .iter()
            .map(|[error, range, _]| error / range)
            .collect();
        let scale = with.iter().sum::<f64>() / with.len() as f64;
        let spread = rms(with.iter().map(|s| s - scale));
        assert!(spread < 1e-2 * scale.abs() + 1e-7, "{scale} {spread}");
        scales.push(scale);
        assert!(rms(range_errors(&world, &params(0.0), station).iter().map(|e| e[0])) < 1e-6);
    }
    assert!(
        scales.iter().all(|s| (1e-5..4e-3).contains(&s.abs())),
        "{scales:?}"
    );
    assert!((scales[0] - scales[1]).abs() > 1e-5, "{scales:?}");
}

#[test]
fn ranges_err_by_incidence_and_on_dark_surfaces_as_stated() {
    let params = |incidence_m: f64, darkness_m: f64| {
        let mut tls = plain_tls();
        tls.beam.range_noise_m = 0.0;
        tls.beam.incidence_m = incidence_m;
        tls.beam.darkness_m = darkness_m;
        SceneParams {
            tls: Some(tls),
            ..small(14)
        }
    };
    let world = World::new(&params(0.0, 0.0));
    for [error, _, cos_incidence] in range_errors(&world, &params(0.004, 0.0), 1) {
        assert!(
            (error - 0.004 * (1.0 - cos_incidence)).abs() < 2e-5,
            "{error} {cos_incidence}"
        );
    }
    let dark = range_errors(&world, &params(0.0, 0.001), 1);
    // Reflectances lie between 0.004 and 0.9, so the error between log2(0.25 / 0.9) and log2(0.25 / 0.004)
    // millimetres.
    assert!(dark.iter().all(|[error, ..]| (-1.9e-3..6.0e-3).contains(error)));
    let mean = dark.iter().map(|d| d[0]).sum::<f64>() / dark.len() as f64;
    assert!(rms(dark.iter().map(|d| d[0] - mean)) > 3e-4, "surfaces differ");
}

#[test]
fn stations_share_the_datum_of_their_epoch() {
    let params = |datum_m: f64| {
        let mut tls = TlsParams {
            stations: 2,
            datum_m,
            ..plain_tls()
        };
        tls.beam.range_noise_m = 0.0;
        SceneParams {
            tls: Some(tls),
            ..small(15)
        }
    };
    let world = World::new(&params(0.0));
    let datum = |epoch: usize| {
        let scan = world.scan(&params(0.005), epoch).tls.unwrap();
        let errors: Vec<Vector3<f64>> = (0..scan.len())
            .map(|i| scan.cloud.world(i) - exact(&scan, i))
            .collect();
        assert!(errors.iter().all(|e| (e - errors[0]).norm() < 2e-6));
        errors[0]
    };
    let (first, second) = (datum(0), datum(1));
    assert!(
        (0.001..0.03).contains(&first.norm()) && (first - second).norm() > 1e-3,
        "{first} {second}"
    );
}
