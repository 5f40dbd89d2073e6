//! Distances and contours on a small raster; both are what [`super::outline()`] is made of.

use super::ring::signed_area;
use nalgebra::Point2;

/// Euclidean distance, in cells, from every cell to the nearest marked one (Felzenszwalb & Huttenlocher
/// 2012).
///
/// `marked`: row-major, `width * height`. Infinite where nothing is marked.
pub(super) fn distance(marked: &[bool], width: usize, height: usize) -> Vec<f64> {
    // A finite stand-in for infinity keeps the parabolas' intersections defined.
    let far = 4.0 * ((width * width + height * height) as f64);
    let mut squared: Vec<f64> = marked.iter().map(|&m| if m { 0.0 } else { far }).collect();
    let mut line = Vec::new();
    for x in 0..width {
        line.clear();
        line.extend((0..height).map(|y| squared[y * width + x]));
        for (y, d) in lower_envelope(&line).into_iter().enumerate() {
            squared[y * width + x] = d;
        }
    }
    for row in squared.chunks_exact_mut(width) {
        let new = lower_envelope(row);
        row.copy_from_slice(&new);
    }
    squared
        .iter()
        .map(|&d| if d >= far { f64::INFINITY } else { d.sqrt() })
        .collect()
}

/// The smallest of the parabolas (x - i)^2 + f(i) at every x of a line.
fn lower_envelope(f: &[f64]) -> Vec<f64> {
    let mut roots: Vec<usize> = Vec::with_capacity(f.len());
    let mut starts: Vec<f64> = Vec::with_capacity(f.len());
    let meet = |p: usize, q: usize| {
        let (pf, qf) = (p as f64, q as f64);
        (f[q] + qf * qf - f[p] - pf * pf) / (2.0 * (qf - pf))
    };

    for q in 0..f.len() {
        let mut start = f64::NEG_INFINITY;
        while let Some(&p) = roots.last() {
            start = meet(p, q);
            if starts.last().is_some_and(|&s| start <= s) {
                roots.pop();
                starts.pop();
                start = f64::NEG_INFINITY;
            } else {
                break;
            }
        }
        roots.push(q);
        starts.push(start);
    }

    let mut k = 0;
    (0..f.len())
        .map(|x| {
            while k + 1 < roots.len() && starts[k + 1] < x as f64 {
                k += 1;
            }
            let gap = x as f64 - roots[k] as f64;
            gap * gap + f[roots[k]]
        })
        .collect()
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
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn distances_agree_with_brute_force(bits in proptest::collection::vec(0u8..12, 13 * 9)) {
            let marked: Vec<bool> = bits.iter().map(|&b| b == 0).collect();
            let fast = distance(&marked, 13, 9);
            for (i, d) in fast.iter().enumerate() {
                let (x, y) = ((i % 13) as f64, (i / 13) as f64);
                let brute = (0..marked.len())
                    .filter(|&j| marked[j])
                    .map(|j| (x - (j % 13) as f64).hypot(y - (j / 13) as f64))
                    .fold(f64::INFINITY, f64::min);
                prop_assert!((d - brute).abs() < 1e-9 || (d.is_infinite() && brute.is_infinite()));
            }
        }

        #[test]
        fn every_contour_is_simple(bits in proptest::collection::vec(0u8..3, 14 * 10)) {
            let (w, h) = (16, 12);
            let mut values = vec![0.0; w * h];
            for (i, b) in bits.iter().enumerate() {
                values[(i / 14 + 1) * w + i % 14 + 1] = f64::from(*b);
            }
            let rings = trace(&values, w, h, 0.7);
            let areas: Vec<f64> = rings.iter().map(|r| signed_area(r)).collect();
            prop_assert!(rings.iter().all(|r| crate::geometry::is_simple(r)));
            prop_assert!(areas.iter().all(|a| *a > 0.0) && areas.is_sorted_by(|a, b| a >= b));
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
