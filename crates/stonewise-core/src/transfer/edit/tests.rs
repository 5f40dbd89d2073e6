//! A wall of nine stones, known to the point.

use super::*;
use crate::cloud::{Cloud, MemoryTiles};
use crate::id::StoneId;
use crate::progress::Silent;
use crate::transfer::{MemoryLabels, TileLabels};
use nalgebra::{Point2, Point3, Vector3};
use std::collections::{BTreeMap, BTreeSet};

/// Stones of 0.4 x 0.2 m in three courses, joints of 2 cm, a point every centimetre; the face leans back.
const PITCH: [f64; 2] = [0.42, 0.22];

/// (along, up) of the points, in two tiles, and the stone of each: 1 to 9, column by column of a course; 0 in
/// joints.
fn wall() -> (Vec<Vec<Point2<f64>>>, Vec<TileLabels>) {
    let (mut places, mut labels) = (vec![Vec::new(); 2], vec![TileLabels::default(); 2]);
    for i in 0..126 {
        for j in 0..66 {
            let place = Point2::new(f64::from(i) * 0.01 + 0.005, f64::from(j) * 0.01 + 0.005);
            let cell = [place.x / PITCH[0], place.y / PITCH[1]];
            let within = [cell[0].fract() * PITCH[0], cell[1].fract() * PITCH[1]];
            let is_stone = within[0] < 0.4 && within[1] < 0.2;
            let stone = 1 + cell[0] as u32 + 3 * cell[1] as u32;
            // Tiles end within the stones of the middle column.
            let tile = usize::from(place.x > 0.6);
            places[tile].push(place);
            labels[tile].stone.push(if is_stone { stone } else { 0 });
            labels[tile].confidence.push(0.9);
            labels[tile].seen.push(true);
        }
    }
    (places, labels)
}

fn lean() -> Vector3<f64> {
    Vector3::new(0.0, 0.98, -0.199)
}

/// The report, and the number of points of each stone after the edits.
fn edited(edits: &[LabelEdit]) -> (EditReport, BTreeMap<u32, usize>, Vec<TileLabels>) {
    let (places, labels) = wall();
    let world = |p: &Point2<f64>| Point3::new(p.x, 0.0, 0.0) + lean() * p.y;
    let cloud = |places: &Vec<Point2<f64>>| {
        let offsets = places.iter().map(|p| world(p).coords.cast::<f32>().into());
        Cloud::new(Point3::origin(), offsets.collect())
    };
    let tiles = MemoryTiles::new(places.iter().map(cloud));
    let labels = MemoryLabels { tiles: labels };
    let mut target = labels.clone();
    let place = |p: &Point3<f64>| Point3::new(p.x, p.coords.dot(&lean()), p.z + p.y * 0.199 / 0.98);
    let wall = EditedWall {
        place: &place,
        stones: &(1..=9).map(StoneId).collect(),
        min_points: 30,
        first_new: 10,
    };
    let report = edit_labels(&tiles, &labels, &mut target, &wall, edits, &Silent).unwrap();
    let mut points: BTreeMap<u32, usize> = BTreeMap::new();
    for stone in target.tiles.iter().flat_map(|t| &t.stone) {
        *points.entry(*stone).or_default() += 1;
    }
    (report, points, target.tiles)
}

/// A place in a stone, by its number.
fn at(stone: u32) -> Point2<f64> {
    let (column, course) = (f64::from((stone - 1) % 3), f64::from((stone - 1) / 3));
    Point2::new(column * PITCH[0] + 0.15, course * PITCH[1] + 0.12)
}

fn boxed(x: [f64; 2], y: [f64; 2]) -> Vec<Point2<f64>> {
    [[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]]
        .map(Point2::from)
        .to_vec()
}

fn effect(report: &EditReport, edit: usize) -> (Vec<u32>, Vec<u32>, u64) {
    let effect = report.effects[edit].clone().unwrap();
    (effect.before, effect.after, effect.points)
}

#[test]
fn without_edits_nothing_changes() {
    let (report, points, _) = edited(&[]);
    assert_eq!(report, EditReport::default());
    assert_eq!(points[&5], 800);
}

#[test]
fn two_stones_become_one_across_tiles_and_others_keep_their_points() {
    for edit in [
        LabelEdit::Merge(vec![at(5), at(6)]),
        LabelEdit::MergeInside(boxed([0.38, 1.3], [0.2, 0.45])),
    ] {
        let (report, points, _) = edited(&[edit]);
        assert_eq!(effect(&report, 0), (vec![5, 6], vec![5], 800));
        assert_eq!(points.get(&6), None);
        assert_eq!(points[&5], 1600);
        assert_eq!((points[&4], points[&8]), (800, 800));
        assert_eq!(report.origins, BTreeMap::from([(5, BTreeSet::from([5, 6]))]));
        assert_eq!(report.gone, BTreeSet::from([6]));
        assert_eq!(report.edited_by, BTreeMap::from([(5, 0)]));
    }
}

#[test]
fn a_line_splits_the_stones_that_it_crosses_and_the_larger_part_keeps_the_number() {
    // Through stone 5 a quarter from its left end, from joint to joint.
    let x = PITCH[0] + 0.1;
    let line = |y: [f64; 2]| LabelEdit::Split(vec![Point2::new(x, y[0]), Point2::new(x, y[1])]);
    let (report, points, _) = edited(&[line([0.21, 0.43])]);
    assert_eq!(effect(&report, 0), (vec![5], vec![5, 10], 200));
    assert_eq!((points[&5], points[&10]), (600, 200));
    assert_eq!(report.origins[&10], BTreeSet::from([5]));
    // Drawn too far, the line ends in the stones above and below, which stay whole.
    let (report, points, _) = edited(&[line([0.15, 0.5])]);
    assert_eq!(effect(&report, 0).0, [5]);
    assert_eq!((points[&2], points[&8]), (800, 800));
    // A line over the whole wall splits the column.
    let (report, _, _) = edited(&[line([-0.1, 0.8])]);
    assert_eq!(
        effect(&report, 0),
        (vec![2, 5, 8], vec![2, 5, 8, 10, 11, 12], 600)
    );
    // One that ends in the middle of the stone splits nothing, nor does one in a joint.
    let (report, _, _) = edited(&[
        line([0.21, 0.32]),
        LabelEdit::Split(vec![Point2::new(0.0, 0.21), Point2::new(1.2, 0.21)]),
    ]);
    assert_eq!(
        report.effects,
        [Err(NoEffect::NotCrossed), Err(NoEffect::NotCrossed)]
    );
    assert!(report.tiles.is_empty());
}

#[test]
fn an_outline_cuts_a_part_out_and_small_parts_are_refused() {
    let x = 2.0 * PITCH[0];
    let (report, points, _) = edited(&[
        LabelEdit::CutOut(boxed([x - 0.01, x + 0.3], [-0.01, 0.21])),
        LabelEdit::CutOut(boxed([0.0, 0.03], [0.0, 0.05])),
    ]);
    assert_eq!(effect(&report, 0), (vec![3], vec![3, 10], 200));
    assert_eq!((points[&3], points[&10]), (600, 200));
    let small = NoEffect::SmallPart {
        stone: 1,
        points: 15,
        needed: 30,
    };
    assert_eq!(report.effects[1], Err(small));
}

#[test]
fn a_deleted_stone_comes_back_as_an_added_one_within_its_outline() {
    let outline = boxed([PITCH[0] - 0.008, PITCH[0] + 0.2], [0.2, 0.5]);
    let (report, points, labels) = edited(&[LabelEdit::Delete(vec![at(5)]), LabelEdit::Add(outline)]);
    assert_eq!(effect(&report, 0), (vec![5], vec![], 800));
    // By hand: 20 columns of the stone with two rows of either joint, and one column of the joint to the left
    // over all 30 rows; the stone above keeps its own.
    let (_, after, count) = effect(&report, 1);
    assert_eq!(after, [10]);
    assert_eq!(points[&10] as u64, count);
    assert_eq!(count, 20 * 24 + 30);
    assert_eq!(
        (points[&8], points[&4]),
        (800, 800),
        "neighbours keep their points"
    );
    assert_eq!(report.gone, BTreeSet::from([5]));
    assert!(report.origins[&10].is_empty(), "no photo voted for it");
    let added = labels.iter().flat_map(|t| t.stone.iter().zip(&t.confidence));
    assert!(added.filter(|a| *a.0 == 10).all(|a| *a.1 == 0.0));
    let (report, ..) = edited(&[LabelEdit::Add(boxed([0.1, 0.3], [0.05, 0.15]))]);
    assert_eq!(
        report.effects,
        [Err(NoEffect::FewPoints {
            points: 0,
            needed: 30
        })]
    );
}

#[test]
fn an_ignored_area_ends_stones_at_its_outline() {
    // All of stone 1, half of stone 2, all but 1 cm of stone 4.
    let (report, points, _) = edited(&[LabelEdit::Ignore(vec![
        Point2::new(-0.1, -0.1),
        Point2::new(PITCH[0] + 0.2, -0.1),
        Point2::new(PITCH[0] + 0.2, 0.21),
        Point2::new(0.41, 0.21),
        Point2::new(0.41, 0.41),
        Point2::new(-0.1, 0.41),
    ])]);
    assert_eq!(effect(&report, 0).0, [1, 2, 4]);
    assert_eq!(effect(&report, 0).1, [2, 4]);
    assert_eq!(points.get(&1), None);
    assert_eq!((points[&2], points[&4], points[&5]), (400, 40, 800));
}

#[test]
fn edits_follow_each_other_and_what_is_not_there_is_named() {
    let (report, points, _) = edited(&[
        LabelEdit::Merge(vec![at(1), at(2)]),
        LabelEdit::Merge(vec![at(2), at(3)]),
        LabelEdit::Delete(vec![at(9)]),
        LabelEdit::Merge(vec![at(1), at(3)]),
        LabelEdit::Delete(vec![at(9)]),
        LabelEdit::Delete(vec![Point2::new(5.0, 5.0)]),
        LabelEdit::Ignore(boxed([5.0, 6.0], [0.0, 1.0])),
        LabelEdit::DeleteInside(boxed([0.0, 0.4], [0.22, 0.34])),
    ]);
    assert_eq!(points[&1], 2400);
    assert_eq!(report.edited_by, BTreeMap::from([(1, 1)]));
    assert_eq!(report.effects[3], Err(NoEffect::OneStone { stone: 1 }));
    assert_eq!(report.effects[4], Err(NoEffect::NoStone { at: at(9) }));
    let message = report.effects[5].clone().unwrap_err().to_string();
    assert_eq!(message, "no stone at (5.00, 5.00) m");
    assert_eq!(report.effects[6], Err(NoEffect::NothingInside));
    assert_eq!(effect(&report, 7).0, [4]);
    assert_eq!(report.gone, BTreeSet::from([2, 3, 4, 9]));
}
