//! Run-length masks, polygons, outlines and components against pycocotools, OpenCV and brute force.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;
use std::collections::BTreeMap;
use stonewise_core::geometry::signed_area;
use stonewise_core::raster::{
    LabelImage, Raster, Ring, Rle, RleError, connected_components, fill_polygon, label_outlines,
};

#[derive(Deserialize)]
struct Fixture {
    runs: Vec<Runs>,
    polygons: Vec<Polygons>,
    filled: Vec<Polygons>,
    parts: Vec<Parts>,
}

#[derive(Deserialize)]
struct Runs {
    rows: Vec<String>,
    counts: Vec<u32>,
    compressed: String,
}

#[derive(Deserialize)]
struct Polygons {
    width: u32,
    height: u32,
    polygons: Vec<Vec<f64>>,
    compressed: String,
}

#[derive(Deserialize)]
struct Parts {
    rows: Vec<String>,
    areas: BTreeMap<u32, Vec<u32>>,
}

fn fixture() -> Fixture {
    serde_json::from_str(include_str!("../../../../testdata/masks/masks.json")).unwrap()
}

fn from_rows(rows: &[String]) -> LabelImage {
    let data = rows.concat().bytes().map(|b| u32::from(b - b'0')).collect();
    Raster::from_vec(rows[0].len() as u32, rows.len() as u32, data).unwrap()
}

fn from_runs(rle: &Rle) -> LabelImage {
    let mut mask = Raster::filled(rle.width(), rle.height(), 0);
    rle.for_each_run(|x, y, length| {
        for y in y..y + length {
            let pixel = mask.get_mut(x, y).unwrap();
            assert_eq!(*pixel, 0);
            *pixel = 1;
        }
    });
    mask
}

#[test]
fn runs_agree_with_pycocotools() {
    let cases = fixture().runs;
    assert_eq!(cases.len(), 7);
    for case in cases {
        let mask = from_rows(&case.rows);
        let (width, height) = (mask.width(), mask.height());
        let plain = Rle::from_counts(width, height, case.counts).unwrap();
        let compressed = Rle::from_compressed(width, height, &case.compressed).unwrap();
        assert_eq!(plain, compressed);
        assert_eq!(from_runs(&plain), mask);
        assert_eq!(Rle::of_label(&mask, 1, 0..width, 0..height), plain);
        let inside = (0..width).flat_map(|x| (0..height).map(move |y| [x, y]));
        let inside: Vec<[u32; 2]> = inside.filter(|&[x, y]| mask.get(x, y) == Some(&1)).collect();
        let [columns, rows] = [0, 1].map(|a| {
            let ends = inside.iter().map(|p| p[a]);
            ends.clone().min().unwrap_or(0)..ends.max().map_or(0, |last| last + 1)
        });
        assert_eq!(Rle::of_label(&mask, 1, columns, rows), plain);
        assert_eq!(plain.to_compressed(), case.compressed);
        assert_eq!(
            plain.area(),
            mask.data().iter().map(|&v| u64::from(v)).sum::<u64>()
        );
    }
}

#[test]
fn broken_runs_are_refused() {
    assert!(matches!(
        Rle::from_counts(3, 3, vec![4, 4]),
        Err(RleError::WrongLength { covered: 8, .. })
    ));
    assert!(Rle::from_counts(3, 3, vec![u32::MAX, u32::MAX, 11]).is_err());
    let good = Rle::from_counts(3, 3, vec![1, 2, 3, 3]).unwrap().to_compressed();
    assert!(Rle::from_compressed(3, 3, &good).is_ok());
    for bad in [
        &good[..good.len() - 1],
        "P",
        "!",
        "oooooooooooooooooooo",
        "~~~",
        "\u{e4}",
    ] {
        assert!(Rle::from_compressed(3, 3, bad).is_err(), "{bad}");
    }
}

/// Each ring filled on its own, then joined.
fn filled(case: &Polygons) -> LabelImage {
    let mut mask = Raster::filled(case.width, case.height, 0);
    for polygon in &case.polygons {
        let ring = polygon.chunks(2).map(|p| [p[0], p[1]]).collect();
        paint(&[ring], &mut mask);
    }
    mask
}

fn paint(rings: &[Ring], mask: &mut LabelImage) {
    let width = mask.width();
    fill_polygon(rings, width, mask.height(), |y, begin, end| {
        let row = (y * width) as usize;
        mask.data_mut()[row + begin as usize..row + end as usize].fill(1);
    });
}

fn overlap(a: &LabelImage, b: &LabelImage) -> f64 {
    let pairs = || a.data().iter().zip(b.data());
    let both = pairs().filter(|&(&a, &b)| a + b == 2).count();
    let either = pairs().filter(|&(&a, &b)| a + b > 0).count();
    both as f64 / either as f64
}

#[test]
fn filled_polygons_agree_with_opencv_and_pycocotools() {
    let fixture = fixture();
    assert_eq!((fixture.filled.len(), fixture.polygons.len()), (7, 7));
    for (cases, least) in [(fixture.filled, 0.995), (fixture.polygons, 0.99)] {
        for case in cases {
            let rle = Rle::from_compressed(case.width, case.height, &case.compressed).unwrap();
            let expected = from_runs(&rle);
            let ours = filled(&case);
            let iou = overlap(&expected, &ours);
            println!("{iou:.5} {} px", rle.area());
            assert!(iou > least, "{iou} {:?}", case.polygons);
        }
    }
}

#[test]
fn filling_agrees_with_a_test_of_every_pixel_centre() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for _ in 0..200 {
        // Rings that cross themselves, each other and the border; often with vertices on pixel centres.
        let rings: Vec<Ring> = (0..rng.random_range(1..4))
            .map(|_| {
                let vertices = rng.random_range(0..9);
                (0..vertices)
                    .map(|_| [0, 1].map(|_| f64::from(rng.random_range(-10..60)) / 2.0))
                    .collect()
            })
            .collect();
        let mut ours = Raster::filled(23, 19, 0);
        paint(&rings, &mut ours);
        for y in 0..19 {
            for x in 0..23 {
                let centre = [f64::from(x) + 0.5, f64::from(y) + 0.5];
                let crossings: usize = rings.iter().map(|ring| crossings_at_or_left(ring, centre)).sum();
                let expected = (crossings % 2) as u32;
                assert_eq!(ours.get(x, y), Some(&expected), "{x} {y} {rings:?}");
            }
        }
    }
}

fn crossings_at_or_left(ring: &Ring, [x, y]: [f64; 2]) -> usize {
    let crosses = |i: usize| {
        let (a, b) = (ring[i], ring[(i + 1) % ring.len()]);
        let spans = (a[1] <= y) != (b[1] <= y);
        spans && a[0] + (y - a[1]) * (b[0] - a[0]) / (b[1] - a[1]) <= x
    };
    // Vertices are halves, so a crossing is either clearly off the centre or exactly on it.
    (0..ring.len()).filter(|&i| crosses(i)).count()
}

#[test]
fn neighbours_that_share_an_edge_share_no_pixel_and_leave_no_gap() {
    let corner = [[3.3, 2.1], [17.9, 4.6], [15.2, 13.7], [1.4, 12.2]];
    let middle = [9.4, 8.3];
    let mut count: LabelImage = Raster::filled(20, 16, 0);
    let mut whole = count.clone();
    paint(&[corner.to_vec()], &mut whole);
    for i in 0..4 {
        let triangle = vec![corner[i], corner[(i + 1) % 4], middle];
        fill_polygon(&[triangle], 20, 16, |y, begin, end| {
            (begin..end).for_each(|x| *count.get_mut(x, y).unwrap() += 1);
        });
    }
    assert_eq!(count, whole);
}

#[test]
fn huge_and_non_finite_coordinates_are_harmless() {
    let big = vec![[-1e300, -1e300], [1e300, -1e300], [1e300, 1e300], [-1e300, 1e300]];
    let mut mask = Raster::filled(5, 4, 0);
    paint(&[vec![[0.0, 0.0], [f64::NAN, 3.0], [3.0, 3.0]]], &mut mask);
    assert!(mask.data().iter().all(|&v| v == 0));
    paint(&[big], &mut mask);
    assert!(mask.data().iter().all(|&v| v == 1));
}

/// Noise with as many labels as given, 0 included.
fn noise(width: u32, height: u32, labels: u32, seed: u64) -> LabelImage {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let data = (0..width * height).map(|_| rng.random_range(0..labels)).collect();
    Raster::from_vec(width, height, data).unwrap()
}

#[test]
fn outlines_fill_back_to_the_same_pixels() {
    for seed in 0..60 {
        let labels = noise(
            1 + seed as u32 % 17,
            1 + seed as u32 % 13,
            2 + seed as u32 % 3,
            seed,
        );
        let outlines = label_outlines(&labels);
        for label in 1..2 + seed as u32 % 3 {
            let is_label = |&v: &u32| u32::from(v == label);
            let data: Vec<u32> = labels.data().iter().map(is_label).collect();
            let expected = Raster::from_vec(labels.width(), labels.height(), data).unwrap();
            let rings = outlines.get(&label).cloned().unwrap_or_default();
            let mut ours = Raster::filled(labels.width(), labels.height(), 0);
            paint(&rings, &mut ours);
            assert_eq!(ours, expected);
            let area: f64 = rings.iter().map(|ring| signed_area(ring)).sum();
            assert_eq!(area, f64::from(expected.data().iter().sum::<u32>()));
            let (_, parts) = connected_components(&expected);
            let outer = rings.iter().filter(|ring| signed_area(ring) > 0.0).count();
            assert_eq!(outer, parts.len());
        }
    }
}

#[test]
fn a_frame_has_an_outer_ring_and_a_hole() {
    let mut labels = Raster::filled(6, 5, 0);
    for y in 1..5 {
        for x in 1..5 {
            *labels.get_mut(x, y).unwrap() = u32::from(x == 1 || x == 4 || y == 1 || y == 4) * 9;
        }
    }
    let outlines = label_outlines(&labels);
    assert_eq!(outlines.len(), 1);
    let outer = vec![[5.0, 1.0], [5.0, 5.0], [1.0, 5.0], [1.0, 1.0]];
    let hole = vec![[2.0, 4.0], [4.0, 4.0], [4.0, 2.0], [2.0, 2.0]];
    assert_eq!(outlines[&9], [outer, hole]);
}

#[test]
fn components_agree_with_opencv() {
    let cases = fixture().parts;
    assert_eq!(cases.len(), 3);
    for case in cases {
        let labels = from_rows(&case.rows);
        let (numbers, parts) = connected_components(&labels);
        let mut areas: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for part in &parts {
            areas.entry(part.label).or_default().push(part.area);
        }
        areas.values_mut().for_each(|list| list.sort_unstable());
        assert_eq!(areas, case.areas);
        let mut next = 1;
        for (&number, &label) in numbers.data().iter().zip(labels.data()) {
            assert_eq!(number == 0, label == 0);
            assert!(number <= next);
            next += u32::from(number == next);
            if number > 0 {
                assert_eq!(parts[number as usize - 1].label, label);
            }
        }
    }
}
