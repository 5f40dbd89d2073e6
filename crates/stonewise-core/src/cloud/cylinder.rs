//! Points inside a cylinder.

use crate::cloud::GridIndex;
use nalgebra::{Point3, Vector3};

/// A closed cylinder; its middle is the origin of its axis.
#[derive(Clone, Copy, Debug)]
pub struct Cylinder {
    /// Middle of the axis, metres.
    pub centre: Point3<f64>,
    /// Unit vector along the axis.
    pub axis: Vector3<f64>,
    /// Radius, metres.
    pub radius_m: f64,
    /// From the middle to either end, metres.
    pub half_length_m: f64,
}

impl Cylinder {
    /// Where a point lies along the axis, metres from the middle; `None` outside the cylinder.
    #[inline]
    fn along(&self, p: &Point3<f64>) -> Option<f64> {
        let q = p - self.centre;
        let along = q.dot(&self.axis);
        let inside = along.abs() <= self.half_length_m
            && q.norm_squared() - along * along <= self.radius_m * self.radius_m;
        inside.then_some(along)
    }
}

impl GridIndex {
    /// Calls `visit(index, metres along the axis)` for every point inside the cylinder.
    ///
    /// Walks through the layers of cells across the axis' largest component and in each layer visits only the
    /// cells around the axis, so that the cost follows the volume of the cylinder, not of a sphere around it.
    pub fn within_cylinder(&self, cylinder: &Cylinder, mut visit: impl FnMut(usize, f64)) {
        let main = cylinder.axis.iamax();
        if self.points.is_empty() || cylinder.axis[main] == 0.0 {
            return;
        }
        let reach = |a: usize| cylinder.radius_m * (1.0 - cylinder.axis[a].powi(2)).max(0.0).sqrt();
        let whole = cylinder.half_length_m * cylinder.axis[main].abs() + reach(main);
        let Some(layers) =
            self.cells_between(main, cylinder.centre[main] - whole, cylinder.centre[main] + whole)
        else {
            return;
        };

        for layer in layers.0..=layers.1 {
            let mut cells = [(layer, layer); 3];
            let bottom = self.origin[main] + layer as f64 * self.cell_m - cylinder.centre[main];
            // Stretch of the axis whose discs touch this layer; a border cell also holds what rounding put
            // there.
            let slack = reach(main) + 1e-6 * self.cell_m;
            let ends = [bottom - slack, bottom + self.cell_m + slack]
                .map(|z| (z / cylinder.axis[main]).clamp(-cylinder.half_length_m, cylinder.half_length_m));
            let hit = (0..3).filter(|&a| a != main).all(|a| {
                let at = ends.map(|t| cylinder.centre[a] + t * cylinder.axis[a]);
                let range = self.cells_between(a, at[0].min(at[1]) - reach(a), at[0].max(at[1]) + reach(a));
                cells[a] = range.unwrap_or_default();
                range.is_some()
            });
            if hit {
                self.blocks.for_each_run(&cells, |run| {
                    for (p, &i) in self.points[run.clone()].iter().zip(&self.order[run]) {
                        if let Some(along) = cylinder.along(p) {
                            visit(i as usize, along);
                        }
                    }
                });
            }
        }
    }

    /// First and last cell along `axis` that hold coordinates between `low` and `high`.
    fn cells_between(&self, axis: usize, low: f64, high: f64) -> Option<(usize, usize)> {
        let from = ((low - self.origin[axis]) / self.cell_m).floor();
        let to = ((high - self.origin[axis]) / self.cell_m).floor();
        let last = self.dims[axis] - 1;
        (to >= 0.0 && from <= last as f64).then(|| (from.max(0.0) as usize, (to as usize).min(last)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn finds_what_brute_force_finds_in_any_direction() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let cloud: Vec<Point3<f64>> = (0..3000)
            .map(|_| Point3::from([2.0, 1.5, 1.0].map(|s| s * rng.random_range(-1.0..1.0))))
            .collect();
        let mut hits = 0;
        for cell in [0.07, 0.3, 5.0] {
            let index = GridIndex::new(&cloud, cell);
            for trial in 0..60 {
                let axis = match trial % 4 {
                    0 => Vector3::x(),
                    1 => -Vector3::z(),
                    _ => Vector3::from([0; 3].map(|_| rng.random_range(-1.0..1.0))).normalize(),
                };
                let cylinder = Cylinder {
                    centre: Point3::from([2.4, 1.8, 1.2].map(|s| s * rng.random_range(-1.0..1.0))),
                    axis,
                    radius_m: rng.random_range(0.02..0.4),
                    half_length_m: rng.random_range(0.01..1.5),
                };
                let mut found = Vec::new();
                index.within_cylinder(&cylinder, |i, along| {
                    assert!((along - (cloud[i] - cylinder.centre).dot(&axis)).abs() < 1e-12);
                    found.push(i);
                });
                found.sort_unstable();
                let expected: Vec<usize> = (0..cloud.len())
                    .filter(|&i| {
                        let q = cloud[i] - cylinder.centre;
                        q.dot(&axis).abs() <= cylinder.half_length_m
                            && q.cross(&axis).norm() <= cylinder.radius_m
                    })
                    .collect();
                assert_eq!(found, expected);
                hits += found.len();
            }
        }
        assert!(hits > 1000, "the trials must find something");
    }
}
