//! A wall in squares: how well the stones of each are measured.

use crate::results::{RowMotion, StoneRow};
use serde::Serialize;
use std::cmp::Ordering;
use stonewise_simulate::{SimStone, Wall};

/// Fewer stones than this make no square.
const LEAST_STONES: usize = 2;

/// The square of a wall that is measured worst.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Weakest {
    /// Middle along the wall, from its left end, metres.
    pub along_m: f64,
    /// Middle up the face, metres.
    pub up_m: f64,
    /// Standard deviation of the deformation of its stones in space, median, millimetres.
    pub sd_mm: f64,
}

/// The squares of a wall that hold stones.
#[derive(Clone, Debug)]
pub struct Squares {
    /// Edge, metres.
    pub edge_m: f64,
    /// Squares along the wall and up it.
    pub size: [usize; 2],
    /// Median standard deviation of the deformation in space, metres, row by row from below; stones that are not measured
    /// count as infinitely bad. `None` where the wall has no stones.
    pub sd_m: Vec<Option<f64>>,
    stones: usize,
}

impl Squares {
    /// Which stones of the wall lie in which square, and how well they are measured. Cost: O(stones of the wall times
    /// measured stones).
    pub fn new(wall: &Wall, edge_m: f64, measured: &[(&StoneRow, &RowMotion)]) -> Self {
        let sized = |v: f64| (v / edge_m).ceil().clamp(1.0, 1e4) as usize;
        let params = wall.params();
        let size = [sized(params.width_m), sized(params.height_m)];
        let square = |a: f64, u: f64| {
            let x = ((a + 0.5 * params.width_m) / edge_m).clamp(0.0, size[0] as f64 - 1.0);
            let y = (u / edge_m).clamp(0.0, size[1] as f64 - 1.0);
            y as usize * size[0] + x as usize
        };
        let above_ground = |s: &&SimStone| s.bounds[3] > 0.0;
        let middles: Vec<[f64; 2]> = { wall.stones.iter() }
            .filter(above_ground)
            .map(|s| s.middle)
            .collect();
        let mut count = vec![0; size[0] * size[1]];
        let mut sds: Vec<Vec<f64>> = vec![Vec::new(); count.len()];
        for [a, u] in &middles {
            count[square(*a, *u)] += 1;
        }
        for (row, motion) in measured {
            // What is seen of a stone may have its middle on the other side of a border.
            let place = wall.face.face_of(&row.centroid);
            let distance = |m: &[f64; 2]| (m[0] - place.a).hypot(m[1] - place.u);
            let nearest = { middles.iter() }.min_by(|a, b| distance(a).total_cmp(&distance(b)));
            if let Some([a, u]) = nearest {
                sds[square(*a, *u)].push(in_space(motion));
            }
        }
        Self {
            edge_m,
            size,
            stones: count.iter().sum(),
            sd_m: { count.into_iter().zip(sds) }
                .map(|(count, sds)| (count >= LEAST_STONES).then(|| middle(sds, count)))
                .collect(),
        }
    }

    /// Stones of the wall that reach above ground.
    pub fn stones(&self) -> usize {
        self.stones
    }

    /// Squares that hold stones.
    pub fn count(&self) -> usize {
        self.sd_m.iter().flatten().count()
    }

    /// Squares in which most stones are not measured.
    pub fn unseen(&self) -> usize {
        self.sd_m.iter().flatten().filter(|sd| sd.is_infinite()).count()
    }

    /// The square that is measured worst, of those in which most stones are measured.
    pub fn weakest(&self) -> Option<Weakest> {
        let known = |(i, sd): (usize, &Option<f64>)| Some((i, sd.filter(|sd| sd.is_finite())?));
        let seen = self.sd_m.iter().enumerate().filter_map(known);
        let (i, sd_m) = seen.max_by(|a, b| a.1.total_cmp(&b.1))?;
        let middle = |k: usize| (k as f64 + 0.5) * self.edge_m;
        Some(Weakest {
            along_m: middle(i % self.size[0]),
            up_m: middle(i / self.size[0]),
            sd_mm: 1e3 * sd_m,
        })
    }

    /// `Less` where these squares are measured better: fewer are unseen, or as many and the weakest is better.
    pub fn order(&self, other: &Self) -> Ordering {
        let weakest = |s: &Self| s.weakest().map_or(f64::INFINITY, |w| w.sd_mm);
        let unseen = self.unseen().cmp(&other.unseen());
        unseen.then(weakest(self).total_cmp(&weakest(other)))
    }
}

/// Standard deviation of a stone's deformation in space, of its motion where a part of the wall is too small for the
/// former, metres.
fn in_space(motion: &RowMotion) -> f64 {
    let deformation: f64 = motion.deformation_sd.iter().flatten().map(|sd| sd * sd).sum();
    match deformation > 0.0 {
        true => deformation.sqrt(),
        false => motion.face_sd.norm(),
    }
}

/// The value in the middle of `count`, of which those that are missing are infinite.
fn middle(mut values: Vec<f64>, count: usize) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len().max(count) / 2;
    values.get(middle).copied().unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Vector3};
    use stonewise_simulate::WallParams;

    #[test]
    fn stones_that_are_not_measured_make_a_square_worse_and_at_last_unseen() {
        assert_eq!(middle(vec![3.0, 1.0, 2.0], 3), 2.0);
        assert_eq!(middle(vec![3.0, 1.0], 3), 3.0);
        assert_eq!(middle(vec![1.0], 3), f64::INFINITY);
        // More found than the wall has, where a stone straddles a border.
        assert_eq!(middle(vec![1.0, 2.0, 3.0], 2), 2.0);
    }

    #[test]
    fn the_square_whose_stones_are_measured_worst_is_the_weakest() {
        let wall = Wall::new(&WallParams {
            plan_radius_m: 20.0,
            ..WallParams::sized([4.0, 2.0])
        });
        let rows: Vec<(StoneRow, RowMotion)> = { wall.stones.iter() }
            .filter(|s| s.bounds[3] > 0.0)
            .map(|s| {
                // Worse to the right and towards the top; nothing is measured at the left end.
                let sd = 1e-4 * (3.0 + s.middle[0]) * (1.0 + s.middle[1]);
                // Most of the stone may be hidden: its points lie off its middle.
                let up = Vector3::z() * 0.02;
                let row = StoneRow {
                    centroid: Point3::from(s.world_from_stone.translation.vector + up),
                    ..StoneRow::default()
                };
                let motion = RowMotion {
                    deformation_sd: [Some(0.0), Some(0.6 * sd), Some(0.8 * sd)],
                    ..RowMotion::default()
                };
                (row, motion)
            })
            .filter(|(row, _)| wall.face.face_of(&row.centroid).a > -1.0)
            .collect();
        let rows: Vec<(&StoneRow, &RowMotion)> = rows.iter().map(|(row, motion)| (row, motion)).collect();
        let squares = Squares::new(&wall, 1.0, &rows);
        assert_eq!((squares.count(), squares.unseen()), (8, 2));
        let weakest = squares.weakest().unwrap();
        assert_eq!((weakest.along_m, weakest.up_m), (3.5, 1.5));
        // In the middle of that square: 4.5 * 2.5 tenths of a millimetre.
        assert!((weakest.sd_mm - 1.125).abs() < 0.2, "{weakest:?}");
        let none = Squares::new(&wall, 1.0, &[]);
        assert_eq!(none.weakest(), None);
        assert_eq!(squares.order(&none), Ordering::Less);
    }
}
