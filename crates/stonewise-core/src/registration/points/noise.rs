//! Noise of a stone's points, from their nearest neighbours.

use crate::cloud::{Cloud, GridIndex};
use crate::statistics::upper_median;
use nalgebra::{Matrix3, Point3};
use std::collections::BTreeSet;

/// Noises that differ by a larger factor are of different sensors: incidence and range change the noise of a
/// scanner by a factor of two.
pub(crate) const NOISES_ALIKE: f64 = 3.0;
/// Share of what all sources show that a sensor must show to be taken alone.
const LEAST_SHARE: f64 = 0.35;
/// Points that show their noise to a third.
const NOISE_POINTS: usize = 25;
/// Edge of the cells in which a face's extent is counted, metres: some dozens on a stone.
const CELL_M: f64 = 0.03;
/// Points of a stone on which its noise is measured: their median is known to some percent, and more only
/// cost time.
const NOISE_SAMPLES: usize = 300;
/// The median of |a - b| in standard deviations of a, for two values of a normal variable.
const MEDIAN_DIFFERENCE: f64 = 0.954;

/// The sources of the sharpest sensor that shows at least 35 % of what all show; `None` where none does.
///
/// `noises`: sources with their noise; those of alike noises are of one sensor. `shown`: what all sources show;
/// `shows`: what some of them show, in the same unit.
pub(crate) fn sharpest_sensor<S>(
    mut noises: Vec<(S, f64)>,
    shown: f64,
    shows: impl Fn(&[S]) -> f64,
) -> Option<Vec<S>> {
    noises.sort_by(|a, b| a.1.total_cmp(&b.1));
    while let Some(&(_, sharpest)) = noises.first() {
        let alike = noises.partition_point(|(_, noise)| *noise <= NOISES_ALIKE * sharpest);
        let of_sensor: Vec<S> = noises.drain(..alike).map(|(source, _)| source).collect();
        if shows(&of_sensor) >= LEAST_SHARE * shown {
            return Some(of_sensor);
        }
    }
    None
}

/// Noise of a stone's points along z of the face; `None` where there are too few.
pub(crate) fn noise_of(cloud: &Cloud, face_from_world: &Matrix3<f64>) -> Option<f64> {
    let at = |i: usize| Point3::from(face_from_world * cloud.local(i).coords);
    noise_of_face(&(0..cloud.len()).map(at).collect::<Vec<_>>())
}

/// Noise along z of points in the frame of the face; `None` where there are too few.
pub(super) fn noise_of_face(local: &[Point3<f64>]) -> Option<f64> {
    let size_m = CELL_M * (cells(local.iter()).len() as f64).sqrt();
    (local.len() >= NOISE_POINTS).then(|| noise_m(local, size_m))
}

/// Cells of the face in which there are points.
pub(super) fn cells<'a>(local: impl Iterator<Item = &'a Point3<f64>>) -> BTreeSet<[i64; 2]> {
    local
        .map(|p| [p.x, p.y].map(|x| (x / CELL_M).floor() as i64))
        .collect()
}

/// Noise along z of points of a face of `size_m`: the median difference of neighbours that are nearest in x
/// and y.
///
/// Relief within one point spacing counts as noise; on terrestrial scans that is about as much as the
/// scanner's.
pub(super) fn noise_m(local: &[Point3<f64>], size_m: f64) -> f64 {
    let flat: Vec<Point3<f64>> = local.iter().map(|p| Point3::new(p.x, p.y, 0.0)).collect();
    let index = GridIndex::new(&flat, 2.0 * size_m / (flat.len() as f64).sqrt());
    let mut differences: Vec<f64> = (0..flat.len())
        .step_by((flat.len() / NOISE_SAMPLES).max(1))
        .filter_map(|i| {
            let near = index.nearest_k(&flat[i], 2, size_m);
            let other = near.iter().find(|(j, _)| *j != i)?.0;
            Some((local[i].z - local[other].z).abs())
        })
        .collect();
    upper_median(&mut differences).map_or(0.0, |median| median / MEDIAN_DIFFERENCE)
}
