//! Differences between what several sources show of one unmoved place.

use super::sight::{Sight, StablePlane};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// What a small part of the wall, or of a stable area, says about the errors of the sources that see it.
///
/// Sight 0 is the reference: `values` holds, for each further sight, its apparent displacement against the
/// first along each of the directions. The place itself is unknown and has dropped out.
#[derive(Clone, Debug)]
pub(super) struct Observation {
    pub sights: Vec<Sight>,
    /// World directions that are seen: three for a stone, the normal for a plane.
    pub directions: Vec<Vector3<f64>>,
    /// Metres; sight by sight, within it direction by direction.
    pub values: DVector<f64>,
    /// Covariance of `values` from the noise of the points, m^2.
    pub covariance: DMatrix<f64>,
    /// Takes world components to (along, up, out) of the face.
    pub face_from_world: Matrix3<f64>,
    /// Weight of the whole, 1 for one that fits.
    pub weight: f64,
}

impl Observation {
    /// The plane of a stable area that it is part of; `None` for a stone.
    pub fn plane(&self) -> Option<StablePlane> {
        self.sights[0].plane()
    }

    /// Number of differences.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// What it says of some of its sights, by their places in `sights`, two at least: differences against the first of
    /// them.
    pub fn among(&self, kept: &[usize]) -> Self {
        let m = self.directions.len();
        let [first, others @ ..] = kept else {
            return self.clone();
        };
        let mut differences = DMatrix::zeros(m * others.len(), self.len());
        for (row, k) in others.iter().enumerate() {
            for (sight, sign) in [(*k, 1.0), (*first, -1.0)] {
                if sight > 0 {
                    let mut block = differences.view_mut((m * row, m * (sight - 1)), (m, m));
                    block.fill_diagonal(sign);
                }
            }
        }
        Self {
            sights: kept.iter().map(|&k| self.sights[k]).collect(),
            directions: self.directions.clone(),
            values: &differences * &self.values,
            covariance: &differences * &self.covariance * differences.transpose(),
            face_from_world: self.face_from_world,
            weight: self.weight,
        }
    }

    /// Covariance of the differences with the noise of the points times `scale` and an independent error of
    /// each sight, standard deviations `nugget_m` in the face and across it.
    pub fn covariance(&self, scale: f64, nugget_m: [f64; 2]) -> DMatrix<f64> {
        let [inside, across] = nugget_m.map(|s| s * s);
        let variances = Matrix3::from_diagonal(&Vector3::new(inside, inside, across));
        let world = self.face_from_world.transpose() * variances * self.face_from_world;
        let m = self.directions.len();
        let own = DMatrix::from_fn(m, m, |a, b| self.directions[a].dot(&(world * self.directions[b])));
        let mut sum = &self.covariance * scale;
        let others = self.sights.len() - 1;
        for r in 0..others {
            for c in 0..others {
                // The reference's error is in every difference.
                let share = if r == c { 2.0 } else { 1.0 };
                let mut block = sum.view_mut((r * m, c * m), (m, m));
                block += &own * share;
            }
        }
        sum / self.weight
    }
}
