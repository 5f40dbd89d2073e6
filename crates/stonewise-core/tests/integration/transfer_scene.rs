//! Transfer of labels on a small scene whose answer is known: a wall of rectangular stones, and boxes in
//! front.

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::{BTreeMap, BTreeSet};
use std::convert::Infallible;
use stonewise_core::cloud::{Cloud, MemoryTiles, TileSource};
use stonewise_core::geometry::{Bounds, Camera, View};
use stonewise_core::id::{ImageId, InstanceId, StoneId};
use stonewise_core::progress::Silent;
use stonewise_core::raster::LabelImage;
use stonewise_core::transfer::{
    AuditEvent, MemoryLabels, StoneParams, Transfer, TransferError, TransferParams, build_stones,
    transfer_labels,
};

/// Columns and rows of stones, pitch and joint, metres; the wall is the plane x = 0, seen from x > 0.
const COLUMNS: u32 = 6;
const ROWS: u32 = 4;
const PITCH: [f64; 2] = [0.35, 0.25];
const JOINT: f64 = 0.03;

/// True stone at a place of the wall, 0 in joints and beyond.
fn stone_at(y: f64, z: f64) -> u32 {
    let (i, j) = ((y / PITCH[0]).floor(), (z / PITCH[1]).floor());
    let inside = (0.0..f64::from(COLUMNS)).contains(&i) && (0.0..f64::from(ROWS)).contains(&j);
    let in_joint = y - i * PITCH[0] > PITCH[0] - JOINT || z - j * PITCH[1] > PITCH[1] - JOINT;
    if inside && !in_joint {
        (j * f64::from(COLUMNS) + i) as u32 + 1
    } else {
        0
    }
}

/// A camera at `centre` that looks at `target`, with the image's top upwards.
fn view(image: u32, centre: Point3<f64>, target: Point3<f64>) -> View {
    let forward = (target - centre).normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    let down = forward.cross(&right);
    let world_from_cam =
        Rotation3::from_matrix_unchecked(nalgebra::Matrix3::from_columns(&[right, down, forward]));
    let world_from_cam = Isometry3::from_parts(
        Translation3::from(centre.coords),
        UnitQuaternion::from_rotation_matrix(&world_from_cam),
    );
    View {
        image: ImageId(image),
        name: format!("photo {image}"),
        camera: Camera::pinhole(640, 480, 900.0),
        cam_from_world: world_from_cam.inverse(),
    }
}

fn middle() -> Point3<f64> {
    Point3::new(
        0.0,
        f64::from(COLUMNS) * PITCH[0] / 2.0,
        f64::from(ROWS) * PITCH[1] / 2.0,
    )
}

fn views() -> Vec<View> {
    [-0.8, -0.3, 0.4, 0.9, 0.1]
        .iter()
        .enumerate()
        .map(|(i, dy)| {
            let centre = middle() + Vector3::new(3.6, *dy, 0.3 * f64::from(i as u32) - 0.5);
            view(i as u32, centre, middle())
        })
        .collect()
}

/// Where a ray meets a box, as a share of the ray.
fn hit(bounds: &Bounds, from: &Point3<f64>, ray: &Vector3<f64>) -> Option<f64> {
    let (mut enter, mut leave) = (0.0f64, f64::INFINITY);
    for a in 0..3 {
        let (p, q) = (
            (bounds.min[a] - from[a]) / ray[a],
            (bounds.max[a] - from[a]) / ray[a],
        );
        enter = enter.max(p.min(q));
        leave = leave.min(p.max(q));
    }
    (enter < leave).then_some(enter)
}

/// The exact mask: `box_labels` of the boxes, or the stones of the wall as `rename` has them.
fn mask(view: &View, boxes: &[(Bounds, u32)], rename: impl Fn(u32, f64) -> u32) -> LabelImage {
    let (width, height) = (view.camera.width, view.camera.height);
    let mut labels = Vec::new();
    for row in 0..height {
        for column in 0..width {
            let (from, ray) = view.ray([f64::from(column) + 0.5, f64::from(row) + 0.5]).unwrap();
            let nearest = boxes
                .iter()
                .filter_map(|(b, label)| Some((hit(b, &from, &ray)?, *label)))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            let place = from - ray * (from.x / ray.x);
            let wall = stone_at(place.y, place.z);
            labels.push(nearest.map_or_else(|| if wall == 0 { 0 } else { rename(wall, place.y) }, |n| n.1));
        }
    }
    LabelImage::from_vec(width, height, labels).unwrap()
}

/// Random points on the wall and on the faces of the boxes, with their truth: stones, and 1000 + label on
/// boxes.
fn scan(boxes: &[(Bounds, u32)]) -> (Vec<Point3<f64>>, Vec<u32>) {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut points = Vec::new();
    let mut truth = Vec::new();
    let m = middle();
    for _ in 0..60_000 {
        let (y, z) = (
            m.y + rng.random_range(-1.2..1.2),
            m.z + rng.random_range(-0.7..0.7),
        );
        points.push(Point3::new(0.0, y, z));
        truth.push(stone_at(y, z));
    }
    for (b, label) in boxes {
        let size = b.max - b.min;
        for axis in 0..3 {
            for side in [b.min[axis], b.max[axis]] {
                let area = size.product() / size[axis];
                for _ in 0..(area / 0.008f64.powi(2)) as usize {
                    let mut p = b.min + size.map(|s| s * rng.random_range(0.0..1.0));
                    p[axis] = side;
                    points.push(p);
                    truth.push(1000 + label);
                }
            }
        }
    }
    (points, truth)
}

fn tiles(points: &[Point3<f64>]) -> MemoryTiles {
    // Two tiles, cut through the middle of a stone.
    let cut = middle().y + 0.2;
    let half = |left: bool| {
        let inside = points.iter().filter(move |p| (p.y < cut) == left).copied();
        Cloud::from_world(middle(), inside)
    };
    MemoryTiles::new([half(true), half(false)])
}

/// Numbers in the order of [`tiles`].
fn in_tile_order<T: Copy>(points: &[Point3<f64>], values: &[T]) -> Vec<T> {
    let cut = middle().y + 0.2;
    let half = |left: bool| {
        points
            .iter()
            .zip(values)
            .filter(move |p| (p.0.y < cut) == left)
            .map(|p| *p.1)
    };
    half(true).chain(half(false)).collect()
}

struct Outcome {
    stone: Vec<u32>,
    seen: Vec<bool>,
    labels: MemoryLabels,
    transfer: Transfer,
}

fn run(points: &[Point3<f64>], views: &[View], masks: &BTreeMap<ImageId, LabelImage>) -> Outcome {
    let mut labels = MemoryLabels::default();
    let transfer = transfer_labels(
        &tiles(points),
        views,
        |image| Ok::<_, Infallible>(masks.get(&image).cloned()),
        &mut labels,
        &TransferParams::default(),
        &Silent,
    )
    .unwrap();
    Outcome {
        stone: labels.tiles.iter().flat_map(|t| t.stone.clone()).collect(),
        seen: labels.tiles.iter().flat_map(|t| t.seen.clone()).collect(),
        labels,
        transfer,
    }
}

/// Share of the points of each true stone that carry its most frequent label, and how many labels serve two
/// stones.
fn compare(found: &[u32], truth: &[u32]) -> (BTreeMap<u32, f64>, usize) {
    let mut counts: BTreeMap<u32, BTreeMap<u32, usize>> = BTreeMap::new();
    for (f, t) in found.iter().zip(truth) {
        *counts.entry(*t).or_default().entry(*f).or_default() += 1;
    }
    counts.remove(&0);
    let mut main = Vec::new();
    let shares = counts
        .iter()
        .map(|(t, labels)| {
            let (label, n) = labels
                .iter()
                .filter(|l| *l.0 != 0)
                .max_by_key(|l| l.1)
                .unwrap_or((&0, &0));
            main.push(*label);
            (*t, *n as f64 / labels.values().sum::<usize>() as f64)
        })
        .collect();
    let distinct: BTreeSet<_> = main.iter().collect();
    (shares, main.len() - distinct.len())
}

#[test]
fn exact_masks_label_every_stone_and_only_stones() {
    let (points, truth) = scan(&[]);
    let truth = in_tile_order(&points, &truth);
    let views = views();
    // Every photo numbers its instances in its own way; one photo has no mask.
    let masks = views[..4]
        .iter()
        .map(|v| (v.image, mask(v, &[], |s, _| (s * 7 + v.image.0) % 97 + 1)))
        .collect();
    let out = run(&points, &views, &masks);
    let (shares, shared) = compare(&out.stone, &truth);
    assert_eq!((shares.len(), shared), (24, 0));
    assert!(shares.values().all(|s| *s > 0.97), "{shares:?}");
    assert_eq!(out.transfer.stones.len(), 24);
    assert!(out.transfer.audit.is_empty(), "{:?}", out.transfer.audit);
    assert!(!out.transfer.photos[4].masked);
    let wrong = out
        .stone
        .iter()
        .zip(&truth)
        .filter(|(f, t)| **t == 0 && **f != 0)
        .count();
    let joints = truth.iter().filter(|t| **t == 0).count();
    assert!((wrong as f64) < 0.03 * joints as f64, "{wrong} of {joints}");
    // Joints are seen as background, not unseen.
    let seen = out
        .seen
        .iter()
        .zip(&truth)
        .filter(|(s, t)| **t == 0 && **s)
        .count();
    assert!(seen as f64 > 0.9 * joints as f64);
}

#[test]
fn the_stone_table_follows_from_points_and_labels() {
    let (points, _) = scan(&[]);
    let views = views();
    let masks = views.iter().map(|v| (v.image, mask(v, &[], |s, _| s))).collect();
    let out = run(&points, &views, &masks);
    let shift = Vector3::new(0.01, 0.02, 0.05);
    let moved: Vec<_> = points.iter().map(|p| p + shift).collect();
    // The moved points keep the order of the tiles they were labelled in.
    let cut = middle().y + 0.2 + shift.y;
    let half = |left: bool| moved.iter().filter(move |p| (p.y < cut) == left).copied();
    let moved = MemoryTiles::new([
        Cloud::from_world(middle(), half(true)),
        Cloud::from_world(middle(), half(false)),
    ]);
    let table = |tiles: &MemoryTiles| {
        let params = StoneParams::default();
        build_stones(tiles, &out.labels, &views, &out.transfer.stones, &params, &Silent).unwrap()
    };
    let (before, after) = (table(&tiles(&points)), table(&moved));
    assert_eq!(before.len(), 24);
    let area = (PITCH[0] - JOINT) * (PITCH[1] - JOINT);
    for (a, b) in before.iter().zip(&after) {
        assert!((b.centroid - a.centroid - shift).norm() < 1e-6);
        assert!((a.area_m2 / area - 1.0).abs() < 0.06, "{a:?}");
        assert!(a.normal.dot(&Vector3::x()) > 0.999, "{a:?}");
        assert_eq!((a.points, a.photos), (b.points, 5));
        assert!(a.confidence > 0.9, "{a:?}");
        let s = stone_at(a.centroid.y, a.centroid.z) - 1;
        let (i, j) = (f64::from(s % COLUMNS), f64::from(s / COLUMNS));
        let centre = Point3::new(
            0.0,
            i * PITCH[0] + (PITCH[0] - JOINT) / 2.0,
            j * PITCH[1] + (PITCH[1] - JOINT) / 2.0,
        );
        assert!((a.centroid - centre).norm() < 0.006, "{a:?}");
    }
}

#[test]
fn a_box_hides_what_is_behind_it() {
    let m = middle();
    let near = Bounds {
        min: m + Vector3::new(1.2, -0.2, -0.2),
        max: m + Vector3::new(1.5, 0.2, 0.2),
    };
    let far = Bounds {
        min: m + Vector3::new(0.4, -0.25, -0.35),
        max: m + Vector3::new(0.7, 0.45, 0.1),
    };
    let boxes = [(near, 50), (far, 60)];
    let (points, truth) = scan(&boxes);
    let view = view(0, m + Vector3::new(4.0, 0.2, 0.1), m);
    let masks = BTreeMap::from([(view.image, mask(&view, &boxes, |s, _| s))]);
    let out = run(&points, std::slice::from_ref(&view), &masks);
    let stone_of: BTreeMap<InstanceId, StoneId> = out
        .transfer
        .stones
        .iter()
        .map(|s| (s.instances[0].1, s.stone))
        .collect();
    let ordered = in_tile_order(&points, &points);
    let truth = in_tile_order(&points, &truth);
    let (mut hidden, mut hidden_seen, mut open, mut open_right) = (0, 0, 0, 0);
    for i in 0..ordered.len() {
        let from = view.centre();
        let ray = ordered[i] - from;
        let first = boxes
            .iter()
            .filter_map(|(b, _)| hit(b, &from, &ray))
            .fold(1.0, f64::min);
        // Nearer than 3 cm to a surface in front it may count as that surface.
        if first * ray.norm() < ray.norm() - 0.15 {
            hidden += 1;
            hidden_seen += usize::from(out.seen[i]);
        } else if first > 0.999 && truth[i] != 0 {
            let instance = InstanceId(truth[i] % 1000 + if truth[i] == 1000 { 1000 } else { 0 });
            open += 1;
            open_right += usize::from(stone_of.get(&instance).map_or(0, |s| s.0) == out.stone[i]);
        }
    }
    assert!(hidden > 10_000 && open > 20_000, "{hidden} {open}");
    assert!(
        (hidden_seen as f64) < 0.02 * f64::from(hidden),
        "{hidden_seen} of {hidden} hidden points vote"
    );
    assert!(
        open_right as f64 > 0.93 * f64::from(open),
        "{open_right} of {open}"
    );
}

/// Masks of five photos: photo 1 shows stones 8 and 9 as one, photo 2 shows stone 15 in two pieces, photo 3
/// misses stone 3.
fn imperfect(views: &[View]) -> BTreeMap<ImageId, LabelImage> {
    views
        .iter()
        .map(|v| {
            let rename = |s: u32, y: f64| match (v.image.0, s) {
                (1, 9) => 8,
                (2, 15) if y < 2.0 * PITCH[0] + 0.12 => 500,
                (3, 3) => 0,
                _ => s,
            };
            (v.image, mask(v, &[], rename))
        })
        .collect()
}

#[test]
fn the_majority_splits_merged_and_joins_fragmented_instances() {
    let (points, truth) = scan(&[]);
    let truth = in_tile_order(&points, &truth);
    let views = views();
    let out = run(&points, &views, &imperfect(&views));
    let (shares, shared) = compare(&out.stone, &truth);
    assert_eq!(shared, 0);
    assert!(shares.values().all(|s| *s > 0.97), "{shares:?}");
    assert_eq!(out.transfer.stones.len(), 24);
    let split = out.transfer.audit.iter().any(|e| {
        matches!(e, AuditEvent::SplitInstance { photo: ImageId(1), instance: InstanceId(8), stones } if stones.len() == 2)
    });
    let joined = out.transfer.audit.iter().any(|e| {
        matches!(
            e,
            AuditEvent::JoinedFragment {
                photo: ImageId(2),
                instance: InstanceId(15 | 500),
                ..
            }
        )
    });
    assert!(split && joined, "{:?}", out.transfer.audit);
}

#[test]
fn a_majority_that_merges_two_stones_wins() {
    let (points, truth) = scan(&[]);
    let truth = in_tile_order(&points, &truth);
    let views = views();
    let masks = views
        .iter()
        .map(|v| {
            (
                v.image,
                mask(v, &[], |s, _| if s == 9 && v.image.0 != 2 { 8 } else { s }),
            )
        })
        .collect();
    let out = run(&points, &views, &masks);
    let (shares, shared) = compare(&out.stone, &truth);
    assert_eq!(shared, 1);
    assert_eq!(out.transfer.stones.len(), 23);
    assert!(shares.values().all(|s| *s > 0.97), "{shares:?}");
}

#[test]
fn the_order_of_the_photos_does_not_matter() {
    let (points, _) = scan(&[]);
    let views = views();
    let masks = imperfect(&views);
    let partition = |views: &[View]| -> Vec<u32> {
        let out = run(&points, views, &masks);
        let mut names: BTreeMap<u32, u32> = BTreeMap::from([(0, 0)]);
        out.stone
            .iter()
            .map(|s| {
                let next = names.len() as u32;
                *names.entry(*s).or_insert(next)
            })
            .collect()
    };
    let first = partition(&views);
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for _ in 0..3 {
        let mut shuffled = views.clone();
        shuffled.shuffle(&mut rng);
        assert!(partition(&shuffled) == first);
    }
}

#[test]
fn labels_do_not_depend_on_the_number_of_threads() {
    let (points, _) = scan(&[]);
    let views = views();
    let masks = imperfect(&views);
    let with = |threads| stonewise_testing::on_threads(threads, || run(&points, &views, &masks).labels);
    assert!(with(1) == with(4));
}

#[test]
fn wrong_inputs_are_named() {
    let (points, _) = scan(&[]);
    let views = views();
    let small = LabelImage::filled(320, 240, 0);
    let try_masks = |answer: Option<LabelImage>| {
        let mut labels = MemoryLabels::default();
        let params = TransferParams::default();
        let give = |_| Ok::<_, Infallible>(answer.clone());
        transfer_labels(&tiles(&points), &views, give, &mut labels, &params, &Silent)
    };
    let message = try_masks(Some(small)).unwrap_err().to_string();
    assert!(
        message.contains("photo 0") && message.contains("320x240"),
        "{message}"
    );
    assert!(matches!(
        try_masks(None),
        Err(TransferError::NoMasks { photos: 5 })
    ));
    let out = try_masks(Some(LabelImage::filled(640, 480, 0))).unwrap();
    assert!(out.stones.is_empty());
    assert_eq!(tiles(&points).tile_count(), 2);
}
