//! One edit after the other.

use super::effect::{EditEffect, NoEffect};
use super::label_edit::LabelEdit;
use super::line::DividingLine;
use super::touched::{FACE_REACH_M, Touched};
use crate::geometry::{Plane, ring_contains};
use nalgebra::{Point2, Point3};
use std::collections::BTreeSet;

/// Points further than this from the face of the stones around do not belong to an added stone, metres. 0.15:
/// where the transfer takes a step in depth for the silhouette of another object.
const FACE_DEPTH_M: f64 = 0.15;
/// Rounds in which points far from the face are left out of its plane: two, as one far point bends the first.
const FACE_ROUNDS: usize = 3;

/// Applies an edit; `next`: the number of the next new stone.
pub(super) fn apply(
    touched: &mut Touched,
    edit: &LabelEdit,
    min_points: u32,
    next: &mut u32,
) -> Result<EditEffect, NoEffect> {
    match edit {
        LabelEdit::Merge(at) => merge(touched, stones_at(touched, at)?),
        LabelEdit::MergeInside(outline) => merge(touched, stones_inside(touched, outline)?),
        LabelEdit::Delete(at) => Ok(delete(touched, stones_at(touched, at)?)),
        LabelEdit::DeleteInside(outline) => Ok(delete(touched, stones_inside(touched, outline)?)),
        LabelEdit::Split(line) => split(touched, line, min_points, next),
        LabelEdit::CutOut(outline) => cut_out(touched, outline, min_points, next),
        LabelEdit::Add(outline) => add(touched, outline, min_points, next),
        LabelEdit::Ignore(outline) => ignore(touched, outline, min_points),
    }
}

/// The stones at these places.
fn stones_at(touched: &Touched, at: &[Point2<f64>]) -> Result<BTreeSet<u32>, NoEffect> {
    let stones: BTreeSet<u32> = at.iter().filter_map(|p| touched.stone_at(p)).collect();
    match stones.is_empty() {
        true => Err(NoEffect::NoStone {
            at: at.first().copied().unwrap_or_default(),
        }),
        false => Ok(stones),
    }
}

/// The stones that lie inside an outline by more than half of their points.
fn stones_inside(touched: &Touched, outline: &[Point2<f64>]) -> Result<BTreeSet<u32>, NoEffect> {
    let is_inside = |i: &&usize| ring_contains(outline, &touched.points[**i].place);
    let stones = touched.by_stone().into_iter();
    let inside = stones.filter(|(_, points)| 2 * points.iter().filter(is_inside).count() > points.len());
    let inside: BTreeSet<u32> = inside.map(|(stone, _)| stone).collect();
    match inside.is_empty() {
        true => Err(NoEffect::NothingInside),
        false => Ok(inside),
    }
}

fn merge(touched: &mut Touched, stones: BTreeSet<u32>) -> Result<EditEffect, NoEffect> {
    let kept = stones.first().copied().unwrap_or(0);
    if stones.len() < 2 {
        return Err(NoEffect::OneStone { stone: kept });
    }
    let points = relabel(touched, |p| stones.contains(&p) && p != kept, kept);
    Ok(EditEffect {
        before: stones.into_iter().collect(),
        after: vec![kept],
        points,
    })
}

fn delete(touched: &mut Touched, stones: BTreeSet<u32>) -> EditEffect {
    let points = relabel(touched, |p| stones.contains(&p), 0);
    EditEffect {
        before: stones.into_iter().collect(),
        after: Vec::new(),
        points,
    }
}

/// Gives all points of some stones to another; how many.
fn relabel(touched: &mut Touched, of: impl Fn(u32) -> bool, to: u32) -> u64 {
    let mut count = 0;
    for p in touched.points.iter_mut().filter(|p| p.stone != 0 && of(p.stone)) {
        p.stone = to;
        count += 1;
    }
    count
}

fn split(
    touched: &mut Touched,
    line: &[Point2<f64>],
    min_points: u32,
    next: &mut u32,
) -> Result<EditEffect, NoEffect> {
    let line = DividingLine::new(line).ok_or(NoEffect::NotCrossed)?;
    let mut effect = EditEffect {
        before: Vec::new(),
        after: Vec::new(),
        points: 0,
    };
    let mut reason = NoEffect::NotCrossed;

    for (stone, points) in touched.by_stone() {
        if !line.crosses(points.iter().map(|&i| &touched.points[i].place)) {
            continue;
        }
        let parts = points
            .into_iter()
            .partition(|&i| line.is_left(&touched.points[i].place));
        match divide(touched, stone, parts, min_points, next) {
            Ok((new, count)) => {
                effect.before.push(stone);
                effect.after.extend([stone, new]);
                effect.points += count;
            }
            // A line along the border of a stone is not worth a warning.
            Err(NoEffect::SmallPart { points: 0, .. }) => {}
            Err(why) => reason = why,
        }
    }

    effect.after.sort_unstable();
    match effect.before.is_empty() {
        true => Err(reason),
        false => Ok(effect),
    }
}

fn cut_out(
    touched: &mut Touched,
    outline: &[Point2<f64>],
    min_points: u32,
    next: &mut u32,
) -> Result<EditEffect, NoEffect> {
    let inside = |i: &usize| ring_contains(outline, &touched.points[*i].place);
    let parts = touched.by_stone().into_iter().map(|(stone, points)| {
        let parts: (Vec<usize>, Vec<usize>) = points.into_iter().partition(inside);
        (stone, parts)
    });
    // Of equally many points the lower number, which comes first.
    let most = parts
        .filter(|(_, parts)| !parts.0.is_empty())
        .reduce(|a, b| if b.1.0.len() > a.1.0.len() { b } else { a });
    let (stone, parts) = most.ok_or(NoEffect::NothingInside)?;
    let (new, points) = divide(touched, stone, parts, min_points, next)?;
    Ok(EditEffect {
        before: vec![stone],
        after: vec![stone, new],
        points,
    })
}

/// Gives the part of a stone with fewer points a new number; the number and the points of the part.
fn divide(
    touched: &mut Touched,
    stone: u32,
    parts: (Vec<usize>, Vec<usize>),
    min_points: u32,
    next: &mut u32,
) -> Result<(u32, u64), NoEffect> {
    let smaller = if parts.0.len() < parts.1.len() {
        parts.0
    } else {
        parts.1
    };
    if smaller.len() < min_points as usize {
        return Err(NoEffect::SmallPart {
            stone,
            points: smaller.len() as u64,
            needed: min_points,
        });
    }
    let new = *next;
    *next += 1;
    for &i in &smaller {
        touched.points[i].stone = new;
    }
    Ok((new, smaller.len() as u64))
}

fn add(
    touched: &mut Touched,
    outline: &[Point2<f64>],
    min_points: u32,
    next: &mut u32,
) -> Result<EditEffect, NoEffect> {
    let mut free: Vec<usize> = (0..touched.points.len())
        .filter(|&i| touched.points[i].stone == 0)
        .filter(|&i| ring_contains(outline, &touched.points[i].place))
        .collect();
    if let Some(face) = face_around(touched, outline, &free) {
        free.retain(|&i| distance_m(&face, &flat(touched, i)) <= FACE_DEPTH_M);
    }

    if free.len() < min_points as usize {
        return Err(NoEffect::FewPoints {
            points: free.len() as u64,
            needed: min_points,
        });
    }

    let new = *next;
    *next += 1;
    for &i in &free {
        touched.points[i].stone = new;
        touched.points[i].added = true;
    }

    Ok(EditEffect {
        before: Vec::new(),
        after: vec![new],
        points: free.len() as u64,
    })
}

fn flat(touched: &Touched, i: usize) -> Point3<f64> {
    let p = &touched.points[i];
    Point3::new(p.place.x, p.place.y, p.out_m)
}

fn distance_m(plane: &Plane, p: &Point3<f64>) -> f64 {
    plane.normal.dot(&(p - plane.centroid)).abs()
}

/// The plane of the stones around an outline; of the points inside where there are none. `None` where neither
/// gives a plane.
fn face_around(touched: &Touched, outline: &[Point2<f64>], inside: &[usize]) -> Option<Plane> {
    let low = outline.iter().copied().reduce(|a, b| a.inf(&b))?;
    let high = outline.iter().copied().reduce(|a, b| a.sup(&b))?;
    let margin = (high - low).norm() / 2.0 + FACE_REACH_M;
    let centre = nalgebra::center(&low, &high);
    let around: Vec<usize> = (0..touched.points.len())
        .filter(|&i| touched.points[i].stone != 0)
        .filter(|&i| (touched.points[i].place - centre).norm() <= margin)
        .collect();
    let own = if around.len() < 3 { inside.to_vec() } else { around };
    let mut points: Vec<Point3<f64>> = own.into_iter().map(|i| flat(touched, i)).collect();
    let mut plane = Plane::fit(&points)?;
    for _ in 1..FACE_ROUNDS {
        points.retain(|p| distance_m(&plane, p) <= FACE_DEPTH_M);
        plane = Plane::fit(&points)?;
    }
    Some(plane)
}

fn ignore(touched: &mut Touched, outline: &[Point2<f64>], min_points: u32) -> Result<EditEffect, NoEffect> {
    let mut effect = EditEffect {
        before: Vec::new(),
        after: Vec::new(),
        points: 0,
    };
    for (stone, points) in touched.by_stone() {
        let (inside, outside): (Vec<usize>, Vec<usize>) = points
            .into_iter()
            .partition(|&i| ring_contains(outline, &touched.points[i].place));
        if inside.is_empty() {
            continue;
        }
        let rest_counts = outside.len() >= min_points as usize;
        effect.before.push(stone);
        effect.after.extend(rest_counts.then_some(stone));
        let taken = inside
            .into_iter()
            .chain(outside.into_iter().filter(|_| !rest_counts));
        for i in taken {
            touched.points[i].stone = 0;
            effect.points += 1;
        }
    }
    match effect.before.is_empty() {
        true => Err(NoEffect::NothingInside),
        false => Ok(effect),
    }
}
