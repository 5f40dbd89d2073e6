//! Nearest neighbours of a few points of a tile whose points are sorted into cells.

use crate::cloud::sort_nearest;
use crate::geometry::cells_between;
use nalgebra::Point3;
use std::f64::consts::PI;

/// Indices of the points of a cell, ascending, and the cell.
pub(super) type Members = ([i32; 3], Vec<u32>);

/// The points of a tile by cell.
///
/// For a few searches per cell: each goes through all points of the cell, which is faster than building an
/// index.
pub(super) struct Neighbourhood<'a> {
    pub points: &'a [Point3<f64>],
    /// Ascending by cell.
    pub members: &'a [Members],
    pub cell_m: f64,
}

/// Margin for rounding when a cell is left out as too far away, metres.
const MARGIN_M: f64 = 1e-9;

impl Neighbourhood<'_> {
    /// The `k` nearest points within `max_m` of a point of the cell, nearest first, the lower index first
    /// among equals, as (index, squared distance).
    pub(super) fn nearest_k(
        &self,
        cell: &[i32; 3],
        centre: &Point3<f64>,
        k: usize,
        max_m: f64,
    ) -> Vec<(usize, f64)> {
        let inside = self.members.binary_search_by_key(cell, |m| m.0);
        let count = inside.map_or(1, |at| self.members[at].1.len());
        // On a face that fills the cell, about twice as many points as are sought lie within this distance.
        let usual_m = self.cell_m * (2.0 * k as f64 / (PI * count as f64)).sqrt();
        if usual_m < max_m {
            let found = self.nearest_within(cell, centre, k, usual_m);
            if found.len() >= k {
                return found;
            }
        }
        self.nearest_within(cell, centre, k, max_m)
    }

    fn nearest_within(
        &self,
        cell: &[i32; 3],
        centre: &Point3<f64>,
        k: usize,
        max_m: f64,
    ) -> Vec<(usize, f64)> {
        let to_border = (0..3)
            .map(|a| {
                let low = centre[a] - f64::from(cell[a]) * self.cell_m;
                low.min(self.cell_m - low)
            })
            .fold(f64::INFINITY, f64::min);
        let mut found = Vec::new();
        for shell in 0.. {
            self.add_shell(cell, shell, centre, max_m, &mut found);
            sort_nearest(&mut found, k);
            // All points nearer than this have been visited.
            let known = to_border + f64::from(shell) * self.cell_m - MARGIN_M;
            let enough = found.len() >= k && found.last().is_none_or(|l| l.1.sqrt() <= known);
            if enough || known >= max_m {
                break;
            }
        }
        found
    }

    /// Adds the points of all cells that are `shell` cells away along one axis and no farther along the
    /// others.
    fn add_shell(
        &self,
        cell: &[i32; 3],
        shell: i32,
        centre: &Point3<f64>,
        max_m: f64,
        found: &mut Vec<(usize, f64)>,
    ) {
        let [low, high] = [-1, 1].map(|side| cell.map(|c| i64::from(c) + i64::from(side * shell)));
        for other in cells_between(low, high) {
            let away = (0..3).map(|a| (other[a] - i64::from(cell[a])).abs()).max();
            if away != Some(i64::from(shell)) {
                continue;
            }
            let key = other.map(|c| c as i32);
            if let Ok(at) = self.members.binary_search_by_key(&key, |m| m.0) {
                let near = self.members[at].1.iter().map(|&i| {
                    let d2 = (self.points[i as usize] - centre).norm_squared();
                    (i as usize, d2)
                });
                found.extend(near.filter(|n| n.1 <= max_m * max_m));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::cell_of;
    use rand::{RngExt, SeedableRng};
    use std::collections::BTreeMap;

    #[test]
    fn the_nearest_points_are_those_of_a_search_through_all() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(11);
        let mut points: Vec<Point3<f64>> = (0..600)
            .map(|_| Point3::from([0, 1, 2].map(|a| rng.random_range(-1.0..1.0) * [1.0, 0.05, 0.6][a])))
            .collect();
        // Lone points, and points in one place.
        points.extend([[1.4, 0.0, 0.0], [-0.2, 0.9, 0.1], [0.3, 0.0, -1.9]].map(Point3::from));
        points.extend(points[..30].to_vec());
        let cell_m = 0.25;
        let mut members = BTreeMap::<[i32; 3], Vec<u32>>::new();
        for (p, i) in points.iter().zip(0..) {
            let cell = cell_of(p, cell_m).map(|c| c as i32);
            members.entry(cell).or_default().push(i);
        }
        let members: Vec<Members> = members.into_iter().collect();
        let (points, members) = (&points[..], &members[..]);
        let neighbourhood = Neighbourhood {
            points,
            members,
            cell_m,
        };
        for (cell, inside) in members {
            for centre in inside.iter().map(|&i| points[i as usize]) {
                for (k, max_m) in [(1, 0.5), (13, 0.5), (13, 0.04), (40, 3.0)] {
                    let all = points.iter().map(|p| (p - centre).norm_squared()).enumerate();
                    let mut expected: Vec<(usize, f64)> = all.filter(|p| p.1 <= max_m * max_m).collect();
                    expected.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
                    expected.truncate(k);
                    assert_eq!(neighbourhood.nearest_k(cell, &centre, k, max_m), expected);
                }
            }
        }
    }
}
