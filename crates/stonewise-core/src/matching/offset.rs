//! Whether labels lie on the stones that the cloud shows.
//!
//! Labels come from photos, relief from the cloud. Where cameras and cloud do not fit each other, labels lie
//! beside the stones: their joints are not where the relief dips, and the relief under matched labels of two
//! epochs is not the same. Both show as a correlation that is best at another place than zero.

use super::face_patch::{CELL_M, FacePatch};
use nalgebra::Vector2;

/// A correlation below this is no likeness.
const LEAST_LIKENESS: f64 = 0.1;
/// A shift counts whose overlap has at least this share of the largest.
const LEAST_OVERLAP: f64 = 0.5;

/// Correlations of pairs of patches at every shift, added up over the places of a wall.
#[derive(Clone, Debug)]
pub struct OffsetVote {
    reach: usize,
    /// Per shift, row by row from the lower left: sums of products, of both squares, and the number of cells.
    sums: Vec<[f64; 4]>,
}

/// Where two sets of patches are most alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offset {
    /// From where the second set should be to where it is, along and up the face, metres.
    pub along_up_m: Vector2<f64>,
    /// Correlation there.
    pub likeness: f64,
    /// Correlation without an offset.
    pub likeness_unmoved: f64,
}

impl OffsetVote {
    /// A vote over shifts up to `reach_m` along and up the face.
    pub fn new(reach_m: f64) -> Self {
        let reach = (reach_m / CELL_M).round() as usize;
        Self {
            reach,
            sums: vec![[0.0; 4]; (2 * reach + 1).pow(2)],
        }
    }

    /// Adds a place. `larger` has the same middle as `smaller`; places that `larger` does not reach count at
    /// fewer shifts.
    pub fn add(&mut self, smaller: &FacePatch, larger: &FacePatch) {
        let span = 2 * self.reach + 1;
        // Cell of the larger patch over the first cell of the smaller one at the least shift.
        let start = larger.side as i64 / 2 - smaller.side as i64 / 2 - self.reach as i64;
        for (shift, sum) in self.sums.iter_mut().enumerate() {
            let (di, dj) = (start + (shift % span) as i64, start + (shift / span) as i64);
            for j in 0..smaller.side {
                let jj = j as i64 + dj;
                if jj < 0 || jj >= larger.side as i64 {
                    continue;
                }
                let (first, end) = (
                    (-di).clamp(0, smaller.side as i64) as usize,
                    (larger.side as i64 - di).clamp(0, smaller.side as i64) as usize,
                );
                let row = &smaller.values[j * smaller.side + first..j * smaller.side + end.max(first)];
                let from = jj as usize * larger.side + (first as i64 + di).max(0) as usize;
                for (a, b) in row.iter().zip(&larger.values[from..]) {
                    let (a, b) = (f64::from(*a), f64::from(*b));
                    // NaN marks a cell without points.
                    if (a + b).is_finite() {
                        sum[0] += a * b;
                        sum[1] += a * a;
                        sum[2] += b * b;
                        sum[3] += 1.0;
                    }
                }
            }
        }
    }

    /// Adds the votes of other places.
    pub fn merge(mut self, other: &Self) -> Self {
        for (sum, more) in self.sums.iter_mut().zip(&other.sums) {
            (0..4).for_each(|k| sum[k] += more[k]);
        }
        self
    }

    /// The most likely offset; `None` where nothing is alike at any shift.
    pub fn offset(&self) -> Option<Offset> {
        let most = self.sums.iter().map(|s| s[3]).fold(0.0, f64::max);
        let likeness = |s: &[f64; 4]| match s[3] >= LEAST_OVERLAP * most && s[1] > 0.0 && s[2] > 0.0 {
            true => s[0] / (s[1] * s[2]).sqrt(),
            false => -1.0,
        };
        let all: Vec<f64> = self.sums.iter().map(likeness).collect();
        let (best, found) = all
            .iter()
            .copied()
            .enumerate()
            .max_by(|a, b| a.1.total_cmp(&b.1))?;
        let (span, reach) = (2 * self.reach + 1, self.reach as f64);
        let at = |i: usize| all.get(i).copied().unwrap_or(-1.0);
        let refined = |place: usize, step: usize| {
            let inside = place > 0 && place + 1 < span;
            let (below, above) = if inside {
                (at(best - step), at(best + step))
            } else {
                (found, found)
            };
            place as f64 - reach + peak(below, found, above)
        };
        (found >= LEAST_LIKENESS).then(|| Offset {
            along_up_m: CELL_M * Vector2::new(refined(best % span, 1), refined(best / span, span)),
            likeness: found,
            likeness_unmoved: at(self.reach * span + self.reach),
        })
    }
}

/// Place of the summit of the parabola through three values one step apart, from the middle one, steps.
fn peak(below: f64, middle: f64, above: f64) -> f64 {
    let bend = below - 2.0 * middle + above;
    if bend < 0.0 {
        (0.5 * (below - above) / bend).clamp(-0.5, 0.5)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::super::FaceGrid;
    use super::*;
    use crate::statistics::split_mix;
    use nalgebra::{Point3, Vector3};

    /// Depth of joints between irregular stones at (along, up), metres.
    fn joint(x: f64, y: f64) -> f64 {
        let row = (y / 0.25).floor();
        let length = 0.4 + 0.13 * (row * 2.4).sin();
        let course = (y / 0.25).fract().abs();
        let head = ((x + 0.17 * row * row) / length).fract().abs();
        if course < 0.1 || head < 0.07 {
            -0.015
        } else {
            0.004 * (7.0 * x + 11.0 * y * row).sin()
        }
    }

    /// Points of a wall that looks along x, moved along (y) and up (z).
    fn wall(moved: [f64; 2], half_m: f64) -> Vec<Point3<f64>> {
        let n = (half_m / 0.008) as i32;
        let grid = (-n..=n).flat_map(|i| (-n..=n).map(move |j| (0.008 * f64::from(i), 0.008 * f64::from(j))));
        let noise = |a: f64, b: f64| 0.006 * ((a * 917.3 + b * 3_331.7).sin() * 43_758.5).fract();
        grid.map(|(y, z)| Point3::new(joint(y - moved[0], z - moved[1]) + noise(y, z), y, z))
            .collect()
    }

    fn patch(points: &[Point3<f64>], half_m: f64) -> FacePatch {
        let mut grid = FaceGrid::new(Point3::origin(), &Vector3::x(), half_m);
        for p in points {
            grid.add(p, grid.height(p));
        }
        grid.finish()
    }

    #[test]
    fn the_offset_of_a_wall_of_joints_is_found_to_a_third_of_a_cell() {
        let still = patch(&wall([0.0, 0.0], 0.5), 0.5);
        for moved in [[0.0, 0.0], [0.12, 0.0], [-0.05, 0.31], [0.013, -0.207]] {
            let mut vote = OffsetVote::new(0.5);
            vote.add(&still, &patch(&wall(moved, 1.0), 1.0));
            let found = vote.offset().unwrap();
            let error = (found.along_up_m - Vector2::from(moved)).norm();
            assert!(error < 0.007, "{moved:?}: {found:?}");
            let unmoved = moved == [0.0, 0.0];
            assert_eq!(
                found.likeness_unmoved > 0.8 * found.likeness,
                unmoved,
                "{moved:?}: {found:?}"
            );
        }
    }

    #[test]
    fn labels_are_compared_with_the_relief_of_their_own_cloud() {
        let points = wall([0.0, 0.0], 1.0);
        // The last lies a quarter of a cell beside one along and up.
        for off in [[0.0, 0.0], [0.08, 0.02], [0.085, -0.045]] {
            let mut labels = FaceGrid::new(Point3::origin(), &Vector3::x(), 0.5);
            for p in &points {
                let is_stone = joint(p.y + off[0], p.z + off[1]) > -0.01;
                labels.add(p, f64::from(u8::from(is_stone)));
            }
            let mut vote = OffsetVote::new(0.5);
            vote.add(&labels.finish(), &patch(&points, 1.0));
            let found = vote.offset().unwrap();
            assert!(
                (found.along_up_m - Vector2::from(off)).norm() < 0.012,
                "{off:?}: {found:?}"
            );
        }
    }

    #[test]
    fn surfaces_of_different_walls_are_not_alike() {
        let noise = |seed: u64| {
            let points = wall([0.0, 0.0], 1.0).into_iter().zip(0..).map(move |(p, i)| {
                let height = split_mix(seed << 32 | i) as f64 / u64::MAX as f64;
                Point3::new(0.01 * height, p.y, p.z)
            });
            points.collect::<Vec<_>>()
        };
        let mut vote = OffsetVote::new(0.5);
        vote.add(&patch(&noise(1), 0.5), &patch(&noise(2), 1.0));
        assert_eq!(vote.offset(), None);
    }
}
