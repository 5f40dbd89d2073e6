//! Distances and contours on a small raster; both are what [`super::outline()`] is made of.

use super::ring::signed_area;
use nalgebra::Point2;

/// Euclidean distance, in cells, from every cell to the nearest marked one; infinite beyond `reach`, which must be
/// below 4,096, so that squares are exact.
///
/// `marked`: row-major, `width * height`. Distances along columns first, then the least sum of squares along rows
/// (Saito & Toriwaki 1994), in loops that the compiler vectorises. Cost: cells times reach.
pub(super) fn distance(marked: &[bool], width: usize, reach: f64) -> Vec<f64> {
    let mut along: Vec<f32> = marked
        .iter()
        .map(|&m| if m { 0.0 } else { f32::INFINITY })
        .collect();
    let nearer = |row: &mut [f32], beside: &[f32]| {
        for (d, beside) in row.iter_mut().zip(beside) {
            *d = lesser(*d, beside + 1.0);
        }
    };
    let rows: Vec<usize> = (0..along.len()).step_by(width).collect();
    for row in rows.iter().skip(1) {
        let (above, below) = along.split_at_mut(*row);
        nearer(&mut below[..width], &above[row - width..]);
    }
    for row in rows.iter().skip(1).rev() {
        let (above, below) = along.split_at_mut(*row);
        nearer(&mut above[row - width..], &below[..width]);
    }

    let squares: Vec<f32> = along.iter().map(|d| d * d).collect();
    let mut smallest = squares.clone();
    for (row, smallest) in squares.chunks_exact(width).zip(smallest.chunks_exact_mut(width)) {
        for gap in (1..width).take(reach as usize) {
            let square = (gap * gap) as f32;
            let mut over = |to: std::ops::Range<usize>, from: std::ops::Range<usize>| {
                for (d, other) in smallest[to].iter_mut().zip(&row[from]) {
                    *d = lesser(*d, other + square);
                }
            };
            over(gap..width, 0..width - gap);
            over(0..width - gap, gap..width);
        }
    }
    let within = |d: f64| if d <= reach { d } else { f64::INFINITY };
    smallest
        .iter()
        .map(|square| within(f64::from(*square).sqrt()))
        .collect()
}

/// The lesser of two numbers that are not NaN. `f32::min`, which handles NaN, takes more instructions.
fn lesser(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}

/// The outer contours of `values` at `level`, in cell coordinates, each counter-clockwise and simple, the one
/// with the largest enclosed area first.
///
/// Marching squares with linear interpolation (Lorensen & Cline 1987, in the plane); where two opposite
/// corners of a square are inside, they stay apart. `values` must be below `level` along the border.
pub(super) fn trace(values: &[f64], width: usize, height: usize, level: f64) -> Vec<Vec<Point2<f64>>> {
    let inside = |x: usize, y: usize| values[y * width + x] > level;
    let mut visited = vec![false; width * height];
    let mut found: Vec<(f64, Vec<Point2<f64>>)> = Vec::new();
    for y in 0..height {
        for x in 0..width.saturating_sub(1) {
            // Such an edge, out to in along a row, belongs to exactly one contour.
            if inside(x, y) || !inside(x + 1, y) || visited[y * width + x] {
                continue;
            }
            let ring = follow(values, width, level, (x, y), &mut visited);
            let area = signed_area(&ring);
            if area > 0.0 {
                found.push((area, ring));
            }
        }
    }
    found.sort_by(|(a, _), (b, _)| b.total_cmp(a));
    found.into_iter().map(|(_, ring)| ring).collect()
}

/// Walks along one contour with the inside on the left, from the edge between (x, y) and (x + 1, y).
fn follow(
    values: &[f64],
    width: usize,
    level: f64,
    from: (usize, usize),
    visited: &mut [bool],
) -> Vec<Point2<f64>> {
    let value = |x: usize, y: usize| values[y * width + x];
    let inside = |(x, y): (usize, usize)| value(x, y) > level;
    let start = (from, (from.0 + 1, from.1));
    // The edge under the walker: an outside cell and an inside neighbour.
    let (mut out, mut inn) = start;
    let mut ring = Vec::new();

    loop {
        if inn.0 == out.0 + 1 {
            visited[out.1 * width + out.0] = true;
        }
        ring.push(crossing(
            out,
            value(out.0, out.1),
            inn,
            value(inn.0, inn.1),
            level,
        ));
        // The next square lies ahead; its far corners are the next cells on either side.
        let step = travel(delta(out, inn));
        let (ahead_out, ahead_in) = (shift(out, step), shift(inn, step));
        (out, inn) = match (inside(ahead_out), inside(ahead_in)) {
            (_, false) => (ahead_in, inn),
            (true, true) => (out, ahead_out),
            (false, true) => (ahead_out, ahead_in),
        };
        if (out, inn) == start {
            return ring;
        }
    }
}

fn delta(from: (usize, usize), to: (usize, usize)) -> (isize, isize) {
    (to.0 as isize - from.0 as isize, to.1 as isize - from.1 as isize)
}

/// Direction of travel that keeps the inside on the left: the step from outside to inside, turned right.
fn travel((dx, dy): (isize, isize)) -> (isize, isize) {
    (dy, -dx)
}

fn shift((x, y): (usize, usize), (dx, dy): (isize, isize)) -> (usize, usize) {
    (x.saturating_add_signed(dx), y.saturating_add_signed(dy))
}

/// Where the level lies between the centres of two neighbouring cells; never at a centre, so that no two
/// coincide.
fn crossing(a: (usize, usize), va: f64, b: (usize, usize), vb: f64, level: f64) -> Point2<f64> {
    let t = ((level - va) / (vb - va)).clamp(0.01, 0.99);
    let t = if t.is_finite() { t } else { 0.5 };
    let at = |p: usize, q: usize| p as f64 + t * (q as f64 - p as f64);
    Point2::new(at(a.0, b.0), at(a.1, b.1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    /// Whole numbers below `end`, others in each case.
    fn random(case: u64, end: u8, count: usize) -> Vec<u8> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(case);
        (0..count).map(|_| rng.random_range(0..end)).collect()
    }

    #[test]
    fn distances_agree_with_brute_force() {
        for case in 0..64 {
            let marked: Vec<bool> = random(case, 12, 13 * 9).iter().map(|&b| b == 0).collect();
            for reach in [4.0, 99.0] {
                for (i, d) in distance(&marked, 13, reach).iter().enumerate() {
                    let (x, y) = ((i % 13) as f64, (i / 13) as f64);
                    let brute = (0..marked.len())
                        .filter(|&j| marked[j])
                        .map(|j| (x - (j % 13) as f64).hypot(y - (j / 13) as f64))
                        .fold(f64::INFINITY, f64::min);
                    let is_right = match brute <= reach {
                        true => (d - brute).abs() < 1e-9,
                        false => d.is_infinite(),
                    };
                    assert!(is_right, "case {case}: {d} instead of {brute}");
                }
            }
        }
    }

    #[test]
    fn every_contour_is_simple() {
        let (w, h) = (16, 12);
        for case in 0..64 {
            let mut values = vec![0.0; w * h];
            for (i, value) in random(case, 3, 14 * 10).into_iter().enumerate() {
                values[(i / 14 + 1) * w + i % 14 + 1] = f64::from(value);
            }
            let rings = trace(&values, w, h, 0.7);
            let areas: Vec<f64> = rings.iter().map(|r| signed_area(r)).collect();
            assert!(rings.iter().all(|r| crate::geometry::is_simple(r)), "case {case}");
            assert!(
                areas.iter().all(|a| *a > 0.0) && areas.is_sorted_by(|a, b| a >= b),
                "case {case}"
            );
        }
    }

    #[test]
    fn a_single_cell_is_a_diamond() {
        let mut values = vec![0.0; 25];
        values[12] = 1.0;
        let rings = trace(&values, 5, 5, 0.5);
        assert_eq!((rings.len(), rings[0].len()), (1, 4));
        assert!((signed_area(&rings[0]) - 0.5).abs() < 1e-12);
    }
}
