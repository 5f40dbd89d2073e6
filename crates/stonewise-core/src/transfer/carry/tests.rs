use super::*;
use crate::cloud::{Cloud, MemoryTiles};
use crate::geometry::{Camera, Rigid3, View};
use crate::id::{ImageId, StoneId};
use crate::progress::Silent;
use crate::stone::Stone;
use crate::transfer::{LabelStore, MemoryLabels, TileLabels};
use nalgebra::{Point3, Vector3};
use std::collections::{BTreeMap, BTreeSet};

/// Stones of 0.4 m x 0.3 m on a face that looks along x; joints of 2 cm between them are 2 cm deep. Stone 1
/// starts at y = 0; stone 2 follows.
const LENGTH: f64 = 0.4;
const JOINT: f64 = 0.02;

fn stone_at(y: f64, z: f64) -> u32 {
    let k = (y / (LENGTH + JOINT)).floor();
    let is_stone = y - k * (LENGTH + JOINT) < LENGTH && (0.0..0.3).contains(&z) && (0.0..3.0).contains(&k);
    if is_stone { k as u32 + 1 } else { 0 }
}

/// Points every 5 mm, in two tiles; `x`: distance of the surface in front of the plane x = 0, by stone.
/// Returns tiles, true labels and the labels that are in use.
fn epoch(
    shift: Vector3<f64>,
    x: impl Fn(u32) -> f64,
    known: impl Fn(u32) -> bool,
) -> (MemoryTiles, Vec<Vec<u32>>, MemoryLabels) {
    let mut tiles: Vec<Vec<Point3<f64>>> = vec![Vec::new(), Vec::new()];
    let mut truth = vec![Vec::new(), Vec::new()];
    for i in -10..270 {
        for j in -10..70 {
            // Off the lattice of the cells, and not on borders.
            let (y, z) = (0.005 * f64::from(i) + 0.0012, 0.005 * f64::from(j) + 0.0017);
            let stone = stone_at(y, z);
            let depth = if stone == 0 {
                -0.02
            } else {
                x(stone) + 0.01 * (12.0 * y).sin()
            };
            let tile = usize::from(y > 0.6);
            tiles[tile].push(Point3::new(depth, y, z) + shift);
            truth[tile].push(stone);
        }
    }

    let mut labels = MemoryLabels::default();
    for (tile, truth) in truth.iter().enumerate() {
        let stone: Vec<u32> = truth.iter().map(|&s| if known(s) { s } else { 0 }).collect();
        let table = TileLabels {
            confidence: vec![1.0; stone.len()],
            seen: vec![true; stone.len()],
            stone,
        };
        labels.write(tile, &table).unwrap();
    }

    let clouds = tiles
        .into_iter()
        .map(|points| Cloud::from_world(Point3::origin(), points));
    (MemoryTiles::new(clouds), truth, labels)
}

fn shapes(stones: &[u32]) -> BTreeMap<StoneId, StoneShape> {
    let (tiles, _, labels) = epoch(Vector3::zeros(), |_| 0.0, |_| true);
    let wanted = stones.iter().map(|&s| (StoneId(s), Vector3::x())).collect();
    stone_shapes(&tiles, &labels, &wanted, &Silent).unwrap()
}

fn carried(
    shapes: &BTreeMap<StoneId, StoneShape>,
    shift: Vector3<f64>,
    epoch: (&MemoryTiles, &MemoryLabels),
) -> (CarryReport, MemoryLabels) {
    carried_into(shapes, shift, epoch, &BTreeMap::new())
}

/// `maybe_merged`: stones of the epoch that may be several, with their points.
fn carried_into(
    shapes: &BTreeMap<StoneId, StoneShape>,
    shift: Vector3<f64>,
    (tiles, labels): (&MemoryTiles, &MemoryLabels),
    maybe_merged: &BTreeMap<StoneId, u64>,
) -> (CarryReport, MemoryLabels) {
    let mut target = labels.clone();
    let stones: Vec<PlacedShape> = shapes
        .values()
        .map(|shape| PlacedShape { shape, shift })
        .collect();
    let params = CarryParams::default();
    let sought = Sought {
        stones: &stones,
        maybe_merged,
        first_new: 100,
        min_points: 30,
    };
    let report = carry_labels(tiles, labels, &mut target, &sought, &params, &Silent).unwrap();
    (report, target)
}

#[test]
fn a_missed_stone_gets_its_points_where_its_neighbours_moved_it() {
    // Stone 2 lies in both tiles; the detector found the others alone. The place is known to 2 mm.
    let shift = Vector3::new(0.01, 0.25, -0.04);
    let (tiles, truth, labels) = epoch(shift, |_| 0.0, |s| s != 2);
    let near = shift + Vector3::new(0.002, -0.002, 0.001);
    let (report, target) = carried(&shapes(&[2]), near, (&tiles, &labels));
    let stone = report.outcomes[0].as_ref().unwrap();
    assert_eq!((stone.stone, report.tiles.len()), (100, 2));
    assert!(stone.same_share > 0.95 && stone.covered_share > 0.95, "{stone:?}");
    let (mut right, mut wrong, mut missed) = (0, 0, 0);
    for (tile, truth) in truth.iter().enumerate() {
        for (i, &truth) in truth.iter().enumerate() {
            let label = target.tiles[tile].stone[i];
            match (truth == 2, label == 100) {
                (true, true) => right += 1,
                (false, true) => wrong += 1,
                (true, false) => missed += 1,
                // Other stones keep their points.
                (false, false) => assert_eq!(label, truth),
            }
            assert_eq!(target.tiles[tile].confidence[i] == 0.0, label == 100);
        }
    }
    assert_eq!(stone.points, right + wrong);
    // 2 mm of the border of a stone of 400 mm x 300 mm.
    assert!(
        wrong * 50 < right && missed * 50 < right,
        "{right} {wrong} {missed}"
    );
}

#[test]
fn a_stone_that_fell_out_or_moved_away_is_not_carried() {
    for depth in [-0.06, -0.3, 0.06] {
        let (tiles, _, labels) = epoch(Vector3::zeros(), |s| if s == 2 { depth } else { 0.0 }, |s| s != 2);
        let (report, target) = carried(&shapes(&[2]), Vector3::zeros(), (&tiles, &labels));
        let why = report.outcomes[0].as_ref().unwrap_err();
        let is_hole = matches!(why, NotCarried::Different { share } if *share < 0.1);
        let is_bare = matches!(why, NotCarried::NotCovered { share } if *share < 0.1);
        assert!(if depth == -0.06 { is_hole } else { is_bare }, "{depth}: {why:?}");
        assert!(report.tiles.is_empty() && target == labels);
    }
}

#[test]
fn points_of_other_stones_stay_theirs() {
    // Stone 2 is a part of a larger stone in the other epoch.
    let (tiles, _, labels) = epoch(Vector3::zeros(), |_| 0.0, |_| true);
    let (report, target) = carried(&shapes(&[2]), Vector3::zeros(), (&tiles, &labels));
    assert_eq!(report.outcomes[0], Err(NotCarried::Different { share: 0.0 }));
    assert_eq!(target, labels);
}

/// In this epoch stones 1 and 2 are merged into number 1; stone 3 is unchanged.
fn merged() -> (MemoryTiles, Vec<u32>, MemoryLabels, u64) {
    let (tiles, truth, mut labels) = epoch(Vector3::new(0.0, 0.3, -0.1), |_| 0.0, |_| true);
    for stone in labels
        .tiles
        .iter_mut()
        .flat_map(|t| &mut t.stone)
        .filter(|s| **s == 2)
    {
        *stone = 1;
    }
    let truth = truth.concat();
    let points = truth.iter().filter(|t| matches!(t, 1 | 2)).count() as u64;
    (tiles, truth, labels, points)
}

#[test]
fn a_stone_without_a_partner_is_divided_into_those_that_another_epoch_shows() {
    let (tiles, truth, labels, points) = merged();
    let alone = BTreeMap::from([(StoneId(1), points), (StoneId(3), 1)]);
    let shift = Vector3::new(0.002, 0.302, -0.1);
    let (report, target) = carried_into(&shapes(&[1, 2]), shift, (&tiles, &labels), &alone);
    assert_eq!(report.divided, BTreeSet::from([StoneId(1)]));
    assert_eq!(report.tiles.len(), 2);
    let found: Vec<u32> = target
        .tiles
        .iter()
        .flat_map(|t| t.stone.iter().copied())
        .collect();
    assert!(!found.contains(&1), "no point keeps the number");
    let right = |(found, truth): &(&u32, &u32)| match truth {
        1 => **found == 100,
        2 => **found == 101,
        truth => found == truth,
    };
    let off = found.iter().zip(&truth).filter(|pair| !right(pair)).count();
    // The shift is wrong by 2 mm along the wall: at most 2 % of the points get the wrong stone.
    assert!(off as u64 * 50 < points, "{off} of {points}");
}

#[test]
fn a_stone_with_a_partner_or_of_one_part_is_not_divided() {
    let (tiles, _, labels, points) = merged();
    let shift = Vector3::new(0.0, 0.3, -0.1);
    let alone = BTreeMap::from([(StoneId(1), points)]);
    for (parts, alone) in [
        ([1, 2].as_slice(), BTreeMap::new()),
        (&[1], alone.clone()),
        (&[1, 3], alone.clone()),
        // Both parts together hold half of its points.
        (&[1, 2], BTreeMap::from([(StoneId(1), 2 * points)])),
    ] {
        let (report, target) = carried_into(&shapes(parts), shift, (&tiles, &labels), &alone);
        assert!(report.divided.is_empty(), "{parts:?} {alone:?}");
        assert_eq!(target, labels);
    }
}

/// Carries these shapes, in order, into the epoch in which stones 1 and 2 are merged.
fn into_merged(stones: &[(&StoneShape, Vector3<f64>)]) -> (CarryReport, bool) {
    let (tiles, _, labels, points) = merged();
    let mut placed = Vec::new();
    for (shape, off) in stones {
        let shift = Vector3::new(0.0, 0.3, -0.1) + off;
        placed.push(PlacedShape { shape, shift });
    }
    let sought = Sought {
        stones: &placed,
        maybe_merged: &BTreeMap::from([(StoneId(1), points)]),
        first_new: 100,
        min_points: 30,
    };
    let mut target = labels.clone();
    let params = CarryParams::default();
    let report = carry_labels(&tiles, &labels, &mut target, &sought, &params, &Silent).unwrap();
    (report, target == labels)
}

#[test]
fn one_part_that_two_epochs_show_divides_nothing() {
    let shapes = shapes(&[1]);
    let part = (&shapes[&StoneId(1)], Vector3::zeros());
    let (report, is_same) = into_merged(&[part, part]);
    assert!(report.divided.is_empty() && is_same, "{report:?}");
}

#[test]
fn a_stone_of_which_one_part_cannot_be_carried_stays_whole() {
    let shapes = shapes(&[1, 2]);
    let first = (&shapes[&StoneId(1)], Vector3::zeros());
    // 12 cm farther along the wall, stone 2 lies on the merged stone with 70 % of its cells, and on stone 3.
    let second = (&shapes[&StoneId(2)], Vector3::new(0.0, 0.12, 0.0));
    let (report, is_same) = into_merged(&[first, second]);
    assert!(report.outcomes[1].is_err());
    assert!(report.divided.is_empty() && is_same, "{report:?}");
}

#[test]
fn of_two_stones_at_one_place_the_first_is_carried() {
    let (tiles, _, labels) = epoch(Vector3::zeros(), |_| 0.0, |_| false);
    let twice = shapes(&[1, 2]);
    let shape = &twice[&StoneId(2)];
    let stones = [shape, shape].map(|shape| PlacedShape {
        shape,
        shift: Vector3::zeros(),
    });
    let mut target = labels.clone();
    let params = CarryParams::default();
    let sought = Sought {
        stones: &stones,
        maybe_merged: &BTreeMap::new(),
        first_new: 7,
        min_points: 30,
    };
    let report = carry_labels(&tiles, &labels, &mut target, &sought, &params, &Silent).unwrap();
    assert_eq!(report.outcomes[0].as_ref().unwrap().stone, 7);
    assert_eq!(report.outcomes[1], Err(NotCarried::Different { share: 0.0 }));
}

#[test]
fn photos_from_behind_beside_or_along_the_face_do_not_see_a_place() {
    // Looks along world x from the origin.
    let axes = nalgebra::Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0);
    let rotation = nalgebra::UnitQuaternion::from_matrix(&axes);
    let view = View {
        image: ImageId(0),
        name: String::new(),
        camera: Camera::pinhole(640, 480, 900.0),
        cam_from_world: Rigid3::from_parts(nalgebra::Translation3::identity(), rotation),
    };
    let sees = |place: [f64; 3], outward: [f64; 3]| {
        photos_facing(
            std::slice::from_ref(&view),
            &Point3::from(place),
            &Vector3::from(outward),
            1.4,
        )
    };
    assert_eq!(sees([5.0, 0.0, 0.0], [-1.0, 0.0, 0.0]), 1);
    assert_eq!(sees([5.0, 0.0, 0.0], [1.0, 0.0, 0.0]), 0);
    assert_eq!(sees([5.0, 0.0, 0.0], [-0.1, 1.0, 0.0]), 0);
    assert_eq!(sees([-5.0, 0.0, 0.0], [1.0, 0.0, 0.0]), 0);
    assert_eq!(sees([5.0, 3.0, 0.0], [-1.0, 0.0, 0.0]), 0);
}

#[test]
fn a_face_of_a_few_cells_is_not_carried() {
    let (tiles, _, labels) = epoch(Vector3::zeros(), |_| 0.0, |_| false);
    let corner: Vec<Point3<f64>> = (0..64)
        .map(|i| {
            Point3::new(
                0.0,
                0.1 + 0.006 * f64::from(i % 8),
                0.1 + 0.006 * f64::from(i / 8),
            )
        })
        .collect();
    let shape = StoneShape::of(&corner, &Vector3::x()).unwrap();
    let small = BTreeMap::from([(StoneId(9), shape)]);
    let (report, target) = carried(&small, Vector3::zeros(), (&tiles, &labels));
    assert!(
        matches!(
            report.outcomes[0],
            Err(NotCarried::Small {
                cells: 4..9,
                needed: 9
            })
        ),
        "{report:?}"
    );
    assert_eq!(target, labels);
}

/// A stone with this number of points, shown by this number of photos.
fn shown(id: u32, points: usize, photos: u32) -> Stone {
    Stone {
        id: StoneId(id),
        centroid: Point3::origin(),
        normal: Vector3::x(),
        area_m2: 0.1,
        points: points as u32,
        photos,
        confidence: 1.0,
    }
}

/// Joins stones 1 and 2, which another epoch shows as one in `photos` photos and misses in `missed`. Stone 1 lies
/// `step` in front of where it was; returns the parts of new stones and all labels.
fn joined(step: f64, parts: [u32; 2], [photos, missed]: [u32; 2]) -> (JoinReport, Vec<u32>, Vec<u32>) {
    let (tiles, _, mut one) = epoch(Vector3::zeros(), |_| 0.0, |_| true);
    for stone in one
        .tiles
        .iter_mut()
        .flat_map(|t| &mut t.stone)
        .filter(|s| **s == 1)
    {
        *stone = 2;
    }

    let wanted = BTreeMap::from([(StoneId(2), Vector3::x())]);
    let shapes = stone_shapes(&tiles, &one, &wanted, &Silent).unwrap();
    let shift = Vector3::new(0.0, 0.3, -0.1);
    let whole = Whole {
        placed: PlacedShape {
            shape: &shapes[&StoneId(2)],
            shift,
        },
        shown: Shown { photos, missed },
    };
    let (tiles, truth, labels) = epoch(shift, |s| if s == 1 { step } else { 0.0 }, |_| true);
    let truth = truth.concat();
    let count = |id: u32| truth.iter().filter(|t| **t == id).count();
    let stones = [
        shown(1, count(1), parts[0]),
        shown(2, count(2), parts[1]),
        shown(3, count(3), 9),
    ];

    let mut target = labels.clone();
    let wholes = [whole, whole];
    let report = join_parts(&tiles, &labels, &mut target, &wholes, &stones, 0.25, &Silent).unwrap();
    let found = target.tiles.iter().flat_map(|t| t.stone.iter().copied());
    (report, found.collect(), truth)
}

#[test]
fn parts_of_a_stone_that_more_photos_show_whole_become_one() {
    let (report, found, truth) = joined(0.004, [4, 5], [6, 2]);
    assert_eq!(report.joined.len(), 1, "the second whole finds no parts left");
    let Joined { parts, shown } = &report.joined[0];
    let number = parts[0].0;
    assert_eq!(BTreeSet::from([1, 2]), parts.iter().map(|s| s.0).collect());
    assert_eq!(*shown, Shown { photos: 6, missed: 2 });
    assert_eq!(report.tiles.len(), 2);
    for (found, truth) in found.iter().zip(&truth) {
        let expected = if matches!(truth, 1 | 2) { number } else { *truth };
        assert_eq!(*found, expected);
    }
}

#[test]
fn parts_stay_apart_where_as_many_photos_show_them_or_one_moved() {
    // As many photos; as many with a quarter of those that do not show the whole; one part is 20 mm in front.
    for (step, parts, votes) in [
        (0.0, [4, 6], [6, 0]),
        (0.0, [5, 4], [6, 4]),
        (0.02, [1, 1], [6, 0]),
    ] {
        let (report, found, truth) = joined(step, parts, votes);
        assert_eq!(report, JoinReport::default());
        assert_eq!(found, truth);
    }
}
