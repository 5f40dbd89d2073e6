//! Errors that stones share besides those of sources: the scale, and what bends clouds from photos.

use super::epoch_error::EpochErrors;
use super::epoch_pair::EpochPair;
use super::joint::JointErrors;
use super::network::Matching;
use super::scale::ScaleError;
use nalgebra::{DMatrix, Matrix3, Matrix3xX, Vector3};

impl EpochErrors {
    /// Adds these errors to all covariances, and what is known of the scale to the expectations.
    pub(super) fn add_shared(&mut self, pair: &EpochPair) {
        self.scale = pair
            .scale
            .map(|known| ScaleError::of(known, pair.stones, pair.response.as_ref()));
        let scale = self.scale.as_ref();
        let modes = pair.network.and_then(|network| network.modes(pair.stones));
        // By independent unknowns of variance one: a column for each.
        let columns = |k: usize| {
            let by_modes = modes
                .as_ref()
                .map_or_else(|| Matrix3xX::zeros(0), |m| m[k].clone());
            let arm = scale.map_or_else(Vector3::zeros, |s| s.arm(&pair.stones[k].centroid) * s.sd);
            let count = by_modes.ncols();
            let mut by = by_modes.insert_column(count, 0.0);
            by.set_column(count, &arm);
            by
        };
        let columns: Vec<Matrix3xX<f64>> = (0..pair.stones.len()).map(columns).collect();
        let means: Vec<Vector3<f64>> = pair
            .stones
            .iter()
            .map(|stone| scale.map_or_else(Vector3::zeros, |s| s.at(&stone.centroid)))
            .collect();

        let square = |by: &Matrix3xX<f64>| by * by.transpose();
        self.shared = columns.iter().map(square).collect();
        for (at, (covariance, mean)) in self.at.iter_mut().zip(self.shared.iter().zip(&means)) {
            at.covariance += covariance;
            at.mean += mean;
        }
        self.relative
            .iter_mut()
            .zip(&self.shared)
            .for_each(|(sum, covariance)| *sum += covariance);
        for (between, [first, second]) in self.between.iter_mut().zip(pair.neighbours) {
            *between += square(&(&columns[*second] - &columns[*first]));
        }
        if let Some(joint) = &mut self.joint {
            joint.add(&columns, &means);
            joint.matching = match pair.has_unknown_photos {
                true => Some(Matching::usual(pair.stones.len())),
                false => pair.network.and_then(|network| network.matching(pair.stones)),
            };
        }
    }
}

impl JointErrors {
    /// Adds errors by independent unknowns of variance one, a column of each stone for each, and their expectations.
    fn add(&mut self, columns: &[Matrix3xX<f64>], means: &[Vector3<f64>]) {
        let before = self.covariance.nrows();
        let blocks = columns.first().map_or(0, |by| by.ncols().div_ceil(3));
        let mut covariance = DMatrix::identity(before + 3 * blocks, before + 3 * blocks);
        covariance
            .view_mut((0, 0), (before, before))
            .copy_from(&self.covariance);
        self.covariance = covariance;
        for (row, by) in self.rows.iter_mut().zip(columns) {
            for block in 0..blocks {
                let first = 3 * block;
                let width = (by.ncols() - first).min(3);
                let mut three = Matrix3::zeros();
                three.columns_mut(0, width).copy_from(&by.columns(first, width));
                row.push((before + first, three));
            }
        }
        let of_points = self.mean.iter_mut().zip(&mut self.mean_of_motions);
        for ((of_points, of_motions), mean) in of_points.zip(means) {
            *of_points += mean;
            *of_motions += mean;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::progress::Silent;
    use crate::registration::observers::{
        EpochErrorParams, KnownScale, SeenStone, Source, SourcePoints, epoch_errors,
    };
    use nalgebra::Point3;

    fn source(epoch: usize) -> Source {
        Source {
            name: format!("scan {epoch}"),
            epoch,
            has_times: false,
            same_as: None,
        }
    }

    fn stone(k: usize) -> SeenStone {
        let centroid = Point3::new(3.0, 0.5 * (k % 6) as f64, 0.4 * (k / 6) as f64);
        let sight = |source| SourcePoints {
            source,
            count: 100,
            time_s: 0.0,
            points: Cloud::new(centroid, Vec::new()),
        };
        SeenStone {
            centroid,
            normal: Vector3::x(),
            sights: vec![sight(0), sight(1)],
        }
    }

    #[test]
    fn a_scale_is_in_every_covariance_and_its_expectation_is_taken_off() {
        let (sources, stones) = ([source(0), source(1)], (0..24).map(stone).collect::<Vec<_>>());
        let neighbours = [[0, 1], [4, 20]];
        let errors = |scale| {
            let pair = EpochPair {
                neighbours: &neighbours,
                scale,
                ..EpochPair::new(&sources, &stones, 1e-3)
            };
            epoch_errors(&pair, &EpochErrorParams::default(), &Silent).unwrap()
        };
        let known = KnownScale {
            mean: 1e-3,
            sd: 2e-4,
            is_measured: true,
        };
        let (without, with) = (errors(None), errors(Some(known)));
        // 2.5 x 1.2 m: the middle of the stones.
        let middle = Point3::new(3.0, 1.25, 0.6);
        let arm = |k: usize| stones[k].centroid - middle;
        let square = |v: Vector3<f64>| v * v.transpose() * known.sd.powi(2);
        let of_joint = |errors: &EpochErrors, k: usize| {
            let joint = errors.joint.as_ref().unwrap();
            let mut sum = Matrix3::zeros();
            for (a, by_a) in &joint.rows[k] {
                for (b, by_b) in &joint.rows[k] {
                    sum += by_a * joint.covariance.fixed_view::<3, 3>(*a, *b) * by_b.transpose();
                }
            }
            sum
        };
        for k in 0..24 {
            let added = with.relative[k] - without.relative[k];
            assert!((added - square(arm(k))).norm() < 1e-15, "{added}");
            let added = of_joint(&with, k) - of_joint(&without, k);
            assert!((added - square(arm(k))).norm() < 1e-15, "{added}");
            let taken_off = with.joint.as_ref().unwrap().mean_of_motions[k];
            assert!((taken_off - arm(k) * known.mean).norm() < 1e-15, "{taken_off}");
        }
        for (pair, [first, second]) in neighbours.iter().enumerate() {
            let added = with.between[pair] - without.between[pair];
            assert!(
                (added - square(arm(*second) - arm(*first))).norm() < 1e-15,
                "{added}"
            );
        }
    }
}
