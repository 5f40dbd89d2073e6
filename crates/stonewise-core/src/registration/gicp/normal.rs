//! Planes fitted to the neighbours of points.

use super::params::GicpParams;
use crate::cloud::GridIndex;
use crate::geometry::Moments;
use nalgebra::{Matrix3, Point3, Vector3};

/// Neighbours are sought no farther than this, metres: no survey of stones has its points that far apart.
pub(super) const FAR_M: f64 = 1.0;
/// Points that the first search should find for each neighbour that is needed. One search in fifty then finds
/// too few.
const FIRST_SHARE: f64 = 1.5;

/// Capacity for the points of a first search.
const FOUND: usize = 64;

/// Fits planes to the neighbours of points.
#[derive(Clone, Copy)]
pub(super) struct PlaneFit {
    /// Neighbours, the point included.
    needed: usize,
    /// Points within this radius take part too, metres.
    radius_m: f64,
    /// Radius of the first search, metres.
    first_m: f64,
}

impl PlaneFit {
    /// `spacing_m`: typical distance of neighbouring points.
    pub(super) fn new(spacing_m: f64, params: &GicpParams) -> Self {
        let area = FIRST_SHARE * params.plane_neighbours as f64 * spacing_m * spacing_m;
        Self {
            needed: params.plane_neighbours,
            radius_m: params.plane_radius_m,
            first_m: (area / std::f64::consts::PI).sqrt().max(params.plane_radius_m),
        }
    }

    /// Unit normal of the plane through the nearest points of `p` and all within the plane's radius; its sign
    /// is of no meaning.
    pub(super) fn normal(&self, index: &GridIndex, p: &Point3<f64>) -> Vector3<f64> {
        let mut found: Vec<(f64, Vector3<f64>)> = Vec::with_capacity(FOUND);
        let mut radius = self.first_m;
        loop {
            found.clear();
            index.positions_within(p, radius, |_, q| {
                let offset = q - p;
                found.push((offset.norm_squared(), offset));
            });
            if found.len() >= self.needed || radius >= FAR_M {
                break;
            }
            radius = (1.5 * radius).min(FAR_M);
        }
        let mut reach2 = f64::INFINITY;
        if (1..found.len()).contains(&self.needed) {
            let (_, last, _) = found.select_nth_unstable_by(self.needed - 1, |a, b| a.0.total_cmp(&b.0));
            reach2 = last.0.max(self.radius_m * self.radius_m);
        }
        let mut moments = Moments::default();
        let near = found.iter().filter(|n| n.0 <= reach2);
        near.for_each(|(_, offset)| moments.add(offset));
        least_axis(&moments.covariance())
    }
}

/// Unit eigenvector of the smallest eigenvalue of a symmetric matrix.
///
/// The eigenvalue in closed form (Smith 1961), the vector as the cross product of the two rows of `m - value
/// I` that are least parallel. Where all rows are nearly parallel, because the two smallest
/// eigenvalues are nearly equal, it is found by iteration.
fn least_axis(m: &Matrix3<f64>) -> Vector3<f64> {
    let mean = m.trace() / 3.0;
    let deviation = m - Matrix3::identity() * mean;
    let size = (deviation.norm_squared() / 6.0).sqrt();
    let shape = deviation.determinant() / (2.0 * size.powi(3));
    let angle = shape.clamp(-1.0, 1.0).acos() / 3.0 + std::f64::consts::TAU / 3.0;
    let rest = deviation - Matrix3::identity() * (2.0 * size * angle.cos());
    let rows = [0, 1, 2].map(|i| rest.row(i).transpose());
    let normal = [(0, 1), (1, 2), (2, 0)]
        .map(|(i, j)| rows[i].cross(&rows[j]))
        .into_iter()
        .fold(Vector3::zeros(), |best: Vector3<f64>, n| {
            if n.norm_squared() > best.norm_squared() {
                n
            } else {
                best
            }
        });
    let length = normal.norm();
    if length > 1e-6 * size * size {
        return normal / length;
    }
    let eigen = m.symmetric_eigen();
    eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn the_least_axis_is_that_of_which_a_matrix_was_made() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(6);
        for [a, b, c] in [
            [1.0, 1.0, 0.0],
            [1.0, 0.999_999, 1e-3],
            [1.0, 0.3, 0.1],
            [1.0, 1e-3, 1e-6],
            [5e-6, 4e-6, 1e-9],
            [1.0, 0.101, 0.1],
        ] {
            for _ in 0..50 {
                let mut draw = || rng.random_range(-3.0..3.0);
                let turn = UnitQuaternion::from_scaled_axis(Vector3::new(draw(), draw(), draw()));
                let axes = turn.to_rotation_matrix().into_inner();
                let m = axes * Matrix3::from_diagonal(&Vector3::new(a, b, c)) * axes.transpose();
                let found = least_axis(&m);
                assert!((found.norm() - 1.0).abs() < 1e-12);
                assert!(found.cross(&axes.column(2)).norm() < 1e-9, "{a} {b} {c}: {found}");
            }
        }
        // Points on a line, and in one place: any normal of it will do.
        let line = Vector3::new(0.6, 0.0, 0.8);
        assert!(least_axis(&(line * line.transpose())).dot(&line).abs() < 1e-7);
        assert!((least_axis(&Matrix3::zeros()).norm() - 1.0).abs() < 1e-12);
    }

    /// The 20 nearest of all points, and all within the radius, give the same plane.
    #[test]
    fn planes_are_those_through_the_nearest_points() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let points: Vec<Point3<f64>> = (0..900)
            .map(|i| {
                // A third is much sparser than the rest.
                let side = if i % 3 == 0 { 3.0 } else { 0.3 };
                let mut draw = |side: f64| rng.random_range(-side..side);
                Point3::new(draw(side), draw(side), draw(0.005))
            })
            .collect();
        let index = GridIndex::new(&points, 0.05);
        for plane_radius_m in [0.0, 0.06, 2.0] {
            let params = GicpParams {
                plane_radius_m,
                ..GicpParams::default()
            };
            let fit = PlaneFit::new(0.025, &params);
            for p in points.iter().step_by(7) {
                let mut offsets: Vec<Vector3<f64>> = points.iter().map(|q| q - p).collect();
                offsets.sort_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()));
                let near = offsets
                    .iter()
                    .enumerate()
                    .take_while(|(i, o)| (*i < 20 && o.norm() <= FAR_M) || o.norm() <= plane_radius_m);
                let near: Vec<&Vector3<f64>> = near.map(|n| n.1).collect();
                let mean = near.iter().copied().sum::<Vector3<f64>>() / near.len() as f64;
                let spread: Matrix3<f64> = near.iter().map(|o| (*o - mean) * (*o - mean).transpose()).sum();
                let eigen = spread.symmetric_eigen();
                let expected = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
                let found = fit.normal(&index, p);
                assert!(found.cross(&expected).norm() < 1e-8, "{plane_radius_m}: {p}");
            }
        }
    }
}
