//! Lines along which stones are split.

use crate::geometry::ring_contains;
use nalgebra::Point2;

/// How far the ends of a line may miss the border of a stone, metres. 0.03: a joint's width, and as well as
/// people draw.
pub(super) const END_TOLERANCE_M: f64 = 0.03;
/// How far a line is lengthened to divide the wall into two sides, metres: longer than any stone.
const FAR_M: f64 = 100.0;

/// A line that divides the wall into two sides.
pub(super) struct DividingLine {
    /// The line as drawn.
    drawn: Vec<Point2<f64>>,
    /// The side to its left, as a polygon.
    left: Vec<Point2<f64>>,
    length_m: f64,
}

impl DividingLine {
    /// `None` where the line has no length.
    pub(super) fn new(drawn: &[Point2<f64>]) -> Option<Self> {
        let mut drawn = drawn.to_vec();
        drawn.dedup();
        let [first, second] = [*drawn.first()?, *drawn.get(1)?];
        let (last, before) = (*drawn.last()?, *drawn.get(drawn.len() - 2)?);
        let start = first + (first - second).try_normalize(0.0)? * FAR_M;
        let end = last + (last - before).try_normalize(0.0)? * FAR_M;
        let chord = (end - start).try_normalize(0.0)?;
        let to_left = nalgebra::Vector2::new(-chord.y, chord.x) * (2.0 * FAR_M);
        let mut left = vec![start];
        left.extend(&drawn);
        left.extend([end, end + to_left, start + to_left]);
        let length_m = drawn.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
        Some(Self {
            drawn,
            left,
            length_m,
        })
    }

    pub(super) fn is_left(&self, p: &Point2<f64>) -> bool {
        ring_contains(&self.left, p)
    }

    /// Whether the line, as drawn, reaches from border to border of a stone with these points: those close to
    /// the line, which is continued straight on for this, lie beside its drawn part.
    pub(super) fn crosses<'p>(&self, points: impl Iterator<Item = &'p Point2<f64>>) -> bool {
        let mut is_close = false;
        for p in points {
            let (distance, along) = self.nearest(p);
            if distance > END_TOLERANCE_M {
                continue;
            }
            is_close = true;
            if along < -END_TOLERANCE_M || along > self.length_m + END_TOLERANCE_M {
                return false;
            }
        }
        is_close
    }

    /// Distance from the line, continued beyond its ends, and the place along it, from its beginning.
    fn nearest(&self, p: &Point2<f64>) -> (f64, f64) {
        let mut begin = 0.0;
        let mut best = (f64::INFINITY, 0.0);
        for (i, w) in self.drawn.windows(2).enumerate() {
            let side = w[1] - w[0];
            let length = side.norm();
            let along = (p - w[0]).dot(&side) / length;
            let low = if i == 0 { -FAR_M } else { 0.0 };
            let high = if i + 2 == self.drawn.len() { FAR_M } else { 0.0 } + length;
            let at = along.clamp(low, high);
            let distance = (p - (w[0] + side * (at / length))).norm();
            if distance < best.0 {
                best = (distance, begin + at);
            }
            begin += length;
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stone(from: [f64; 2], to: [f64; 2]) -> Vec<Point2<f64>> {
        let steps = |low: f64, high: f64| {
            let n = ((high - low) / 0.01).round() as usize;
            (0..=n).map(move |i| low + (high - low) * i as f64 / n as f64)
        };
        steps(from[0], to[0])
            .flat_map(|x| steps(from[1], to[1]).map(move |y| Point2::new(x, y)))
            .collect()
    }

    #[test]
    fn a_line_divides_what_it_crosses_and_not_what_it_touches() {
        let p = Point2::new;
        let line = DividingLine::new(&[p(0.2, -0.02), p(0.22, 0.1), p(0.2, 0.22)]).unwrap();
        let middle = stone([0.0, 0.0], [0.4, 0.2]);
        assert!(line.crosses(middle.iter()));
        let left = middle.iter().filter(|p| line.is_left(p)).count();
        // By hand: the line bulges to the right, so that 0.2 x 0.2 m and a triangle of 0.2 x 0.0167 / 2 m lie
        // to its left.
        let expected = middle.len() as f64 * (0.04 + 0.2 * 0.0167 / 2.0) / 0.08;
        assert!((left as f64 - expected).abs() < 30.0, "{left} {expected}");
        // The stones above and below have its ends, but not the whole line.
        assert!(!line.crosses(stone([0.0, 0.215], [0.4, 0.4]).iter()));
        assert!(!line.crosses(stone([0.0, -0.2], [0.4, -0.015]).iter()));
        // Far away.
        assert!(!line.crosses(stone([2.0, 0.0], [2.4, 0.2]).iter()));
        assert!(DividingLine::new(&[p(1.0, 1.0), p(1.0, 1.0)]).is_none());
    }
}
