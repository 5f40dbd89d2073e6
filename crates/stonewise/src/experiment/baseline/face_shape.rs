//! The smooth shape of a wall's face: a plane or a cylinder that leans back.

use nalgebra::{Matrix4, Point3, RowVector4, Vector3, Vector4};
use serde::Serialize;
use stonewise_core::geometry::FaceFrame;
use stonewise_core::statistics::median;

/// A stone farther from the face than this many median distances takes no part in the fit: three standard deviations of
/// a normal distribution.
const OUTLIER: f64 = 3.0 * 1.4826;
/// How often stones that stand out are left out anew.
const ROUNDS: usize = 3;

/// The face that fits the middles of the stones best.
///
/// With x along the chord, y out of the wall and z up, all from the middle of the stones, the face is
/// y = c + m x + b z + k / 2 (x^2 + y^2): a circle in plan of curvature k, or a straight line where k is zero, that leans by b.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FaceShape {
    #[serde(skip)]
    middle: Point3<f64>,
    #[serde(skip)]
    frame: FaceFrame,
    /// c, m, b, k.
    #[serde(skip)]
    coefficients: Vector4<f64>,
    /// How far the face leans back for each metre of height.
    pub batter: f64,
    /// Its standard deviation, as the scatter of the stones about the face gives it.
    pub batter_sd: f64,
    /// Radius in plan, metres, positive where the face is hollow; absent where the curvature is below three standard
    /// deviations.
    pub radius_m: Option<f64>,
}

impl FaceShape {
    /// The face through the middles of stones of a wall whose outside is `out`; `None` for fewer than eight stones, or
    /// stones in one line.
    pub fn fit(middles: &[Point3<f64>], out: &Vector3<f64>) -> Option<Self> {
        let level = Vector3::new(out.x, out.y, 0.0).try_normalize(1e-9)?;
        let sum: Vector3<f64> = middles.iter().map(|p| p.coords).sum();
        let mut shape = Self {
            middle: Point3::from(sum / middles.len().max(1) as f64),
            frame: FaceFrame::from_normal(&level),
            coefficients: Vector4::zeros(),
            batter: 0.0,
            batter_sd: 0.0,
            radius_m: None,
        };
        let mut used = middles.to_vec();
        for _ in 0..ROUNDS {
            shape.refit(&used)?;
            let distance = |p: &Point3<f64>| shape.out_m(p).abs();
            let most = OUTLIER * median(&mut middles.iter().map(distance).collect::<Vec<_>>())?;
            used = { middles.iter().filter(|p| distance(p) <= most.max(1e-6)) }
                .copied()
                .collect();
        }
        Some(shape)
    }

    fn refit(&mut self, points: &[Point3<f64>]) -> Option<()> {
        if points.len() < 8 {
            return None;
        }
        let rows: Vec<(RowVector4<f64>, f64)> = points.iter().map(|p| self.row(p)).collect();
        let matrix: Matrix4<f64> = rows.iter().map(|(row, _)| row.transpose() * row).sum();
        let rhs: Vector4<f64> = rows.iter().map(|(row, y)| row.transpose() * *y).sum();
        let factor = matrix.cholesky()?;
        self.coefficients = factor.solve(&rhs);
        let squares: f64 = { rows.iter() }
            .map(|(row, y)| (y - (row * self.coefficients)[0]).powi(2))
            .sum();
        let covariance = factor.inverse() * squares / (points.len() - 4) as f64;
        let [_, m, b, k] = self.coefficients.into();
        // Across the chord at its middle, where the line in plan has the slope m.
        let across = (1.0 + m * m).sqrt();
        self.batter = -b / across;
        self.batter_sd = covariance[(2, 2)].max(0.0).sqrt();
        self.radius_m = (k.abs() > 3.0 * covariance[(3, 3)].max(0.0).sqrt()).then(|| across / k);
        Some(())
    }

    /// A row of the linear equations, and its right side.
    fn row(&self, p: &Point3<f64>) -> (RowVector4<f64>, f64) {
        let d = p - self.middle;
        let (x, y) = (d.dot(&self.frame.along), d.dot(&self.frame.out));
        (RowVector4::new(1.0, x, d.z, 0.5 * (x * x + y * y)), y)
    }

    /// How far a point lies in front of the face, metres.
    pub fn out_m(&self, p: &Point3<f64>) -> f64 {
        let (row, y) = self.row(p);
        let [_, m, b, k] = self.coefficients.into();
        let slope = Vector3::new(m + k * row[1], k * y - 1.0, b);
        (y - (row * self.coefficients)[0]) / slope.norm()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Middles of stones on a battered face of this radius, seen from the middle of the circle: hollow. Relief of 1 cm.
    fn face(radius_m: f64, batter: f64) -> Vec<Point3<f64>> {
        (0..2000)
            .map(|i| {
                let (angle, z) = (f64::from(i % 100) / 99.0 - 0.5, f64::from(i / 100) * 0.3);
                let relief = 0.01 * (f64::from(i) * 2.4).sin();
                let r = radius_m + batter * z - relief;
                Point3::new(5e5 + r * angle.sin(), 5e6 + r * angle.cos(), 300.0 + z)
            })
            .collect()
    }

    #[test]
    fn a_hollow_arch_shows_its_radius_batter_and_a_bulge() {
        let mut points = face(40.0, 0.2);
        let out = -Vector3::y();
        let ground = FaceShape::fit(&points, &out).unwrap();
        assert!((ground.batter - 0.2).abs() < 0.01, "{ground:?}");
        assert!((ground.radius_m.unwrap() / 40.0 - 1.0).abs() < 0.03, "{ground:?}");
        let toward = (Point3::new(5e5, 5e6, points[1050].z) - points[1050]).normalize();
        points[1050] += 0.5 * toward;
        let shape = FaceShape::fit(&points, &out).unwrap();
        assert!((shape.out_m(&points[1050]) - 0.5).abs() < 0.03);
    }

    #[test]
    fn a_plane_has_no_radius_and_stones_in_a_line_no_face() {
        let plane: Vec<Point3<f64>> = (0..400)
            .map(|i| {
                let (a, z) = (f64::from(i % 20) * 0.3, f64::from(i / 20) * 0.2);
                Point3::new(a, 0.1 * z + 0.01 * (f64::from(i) * 2.4).sin(), z)
            })
            .collect();
        let figures = FaceShape::fit(&plane, &-Vector3::y()).unwrap();
        assert!((figures.batter - 0.1).abs() < 0.002, "{figures:?}");
        assert_eq!(figures.radius_m, None);
        let line: Vec<Point3<f64>> = (0..20).map(|i| Point3::new(f64::from(i), 0.0, 0.0)).collect();
        assert!(FaceShape::fit(&line, &Vector3::y()).is_none());
        assert!(FaceShape::fit(&plane, &Vector3::z()).is_none());
    }
}
