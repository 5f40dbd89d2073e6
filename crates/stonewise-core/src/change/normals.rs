//! Normals of core points.

use crate::cloud::{CellMoments, GridIndex};
use crate::geometry::Plane;
use crate::surface::Outside;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// Which side of the surface is outside.
#[derive(Clone, Copy)]
pub enum OutwardReference<'a> {
    /// Positions that see the surface from outside, such as camera or scanner centres; the nearest one
    /// counts.
    Towards(&'a [Point3<f64>]),
    /// A direction, of any length, that points out of the surface everywhere.
    Direction(Vector3<f64>),
    /// A surface whose outside was found.
    Surface(&'a Outside),
}

impl OutwardReference<'_> {
    /// The normal or its opposite, whichever points outside at `at`; unchanged where the reference says
    /// nothing.
    pub fn orient(&self, at: &Point3<f64>, normal: Vector3<f64>) -> Vector3<f64> {
        let outside = match self {
            Self::Surface(outside) => return outside.orient(at, normal),
            Self::Direction(direction) => *direction,
            Self::Towards(positions) => positions
                .iter()
                .map(|p| p - at)
                .min_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))
                .unwrap_or_default(),
        };
        if normal.dot(&outside) < 0.0 {
            -normal
        } else {
            normal
        }
    }
}

/// Unit normals of the least-squares planes through all points within `radius_m`, pointing outside; `None`
/// where under three points, or only a line of them, lie so near.
///
/// Cost: one pass over the cloud; positions x cells of the index in the sphere and points of the cells on its
/// border, which is least where a cell is about a tenth of the radius.
pub fn estimate_normals(
    cloud: &GridIndex,
    at: &[Point3<f64>],
    radius_m: f64,
    outward: &OutwardReference<'_>,
) -> Vec<Option<Vector3<f64>>> {
    let sums = CellMoments::new(cloud);
    at.par_iter()
        .map(|centre| {
            let plane = Plane::of_moments(centre, &sums.within(centre, radius_m))?;
            Some(outward.orient(centre, plane.normal))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A half cylinder of radius 2 m about the z axis: its outward normals are radial.
    fn tower() -> Vec<Point3<f64>> {
        (0..200)
            .flat_map(|i| (0..40).map(move |j| (0.0157 * f64::from(i), 0.03 * f64::from(j))))
            .map(|(angle, z)| Point3::new(2.0 * angle.cos(), 2.0 * angle.sin(), z))
            .collect()
    }

    #[test]
    fn normals_of_a_round_tower_point_at_the_nearest_camera() {
        let cloud = tower();
        let index = GridIndex::new(&cloud, 0.1);
        let cameras: Vec<_> = (0..9)
            .map(|i| 0.39 * f64::from(i))
            .map(|a| Point3::new(9.0 * a.cos(), 9.0 * a.sin(), 0.6))
            .collect();
        let normals = estimate_normals(&index, &cloud, 0.2, &OutwardReference::Towards(&cameras));
        for (p, normal) in cloud.iter().zip(&normals) {
            let radial = Vector3::new(p.x, p.y, 0.0).normalize();
            // The ends of the arc see one side only.
            if p.y > 0.3 {
                assert!(normal.unwrap().dot(&radial) > 0.999, "{p}");
            }
        }
        let inward = estimate_normals(
            &index,
            &cloud[4000..4001],
            0.2,
            &OutwardReference::Direction(-Vector3::y()),
        );
        assert!(inward[0].unwrap().y < -0.9);
    }

    #[test]
    fn a_lonely_point_has_no_normal() {
        let index = GridIndex::new(&[Point3::origin()], 1.0);
        let normals = estimate_normals(
            &index,
            &[Point3::origin()],
            1.0,
            &OutwardReference::Direction(Vector3::x()),
        );
        assert_eq!(normals, vec![None]);
    }
}
