//! Comparing clouds that lie in memory.

use super::error::CompareError;
use crate::change::{ChangeField, CorePoint, M3c2Params, OutwardReference, m3c2};
use crate::cloud::GridIndex;
use crate::params::Params;
use crate::progress::Progress;
use nalgebra::{Point3, Vector3};

/// Core points between two looks whether to stop.
const BATCH: usize = 8192;

/// Where the normals of core points come from.
#[derive(Clone, Copy)]
pub enum CoreNormals<'a> {
    /// One for each core point, of any length.
    Given(&'a [Vector3<f64>]),
    /// The first cloud around each core point.
    Fitted(OutwardReference<'a>),
}

/// M3C2 of two clouds at core points; one entry for each, in their order. Points of the clouds that are not
/// finite do not count.
///
/// # Errors
/// The parameters are not usable, there is not one normal for each core point, or the caller stopped the work.
pub fn m3c2_clouds(
    clouds: [Vec<Point3<f64>>; 2],
    core_points: &[Point3<f64>],
    normals: &CoreNormals<'_>,
    params: &M3c2Params,
    progress: &dyn Progress,
) -> Result<ChangeField, CompareError> {
    params.check()?;
    if let CoreNormals::Given(normals) = normals
        && normals.len() != core_points.len()
    {
        return Err(CompareError::NormalCount {
            core_points: core_points.len(),
            normals: normals.len(),
        });
    }

    progress.begin("M3C2", core_points.len() as u64);
    let [first, second] = clouds.map(|mut points| {
        points.retain(|p| p.iter().all(|c| c.is_finite()));
        GridIndex::new(&points, params.cylinder_radius_m)
    });
    let mut field = ChangeField::default();

    for (number, positions) in core_points.chunks(BATCH).enumerate() {
        progress.check()?;
        let core = match normals {
            CoreNormals::Fitted(outward) => {
                CorePoint::fitted(&first, positions, params.normal_radius_m, outward)
            }
            CoreNormals::Given(normals) => with_normals(positions, &normals[number * BATCH..]),
        };
        field.points.extend(m3c2(&first, &second, &core, params).points);
        progress.advance(positions.len() as u64);
    }

    Ok(field)
}

/// Core points with the first of these normals, made unit vectors.
fn with_normals(positions: &[Point3<f64>], normals: &[Vector3<f64>]) -> Vec<CorePoint> {
    let unit = |n: &Vector3<f64>| n.try_normalize(0.0).filter(|n| n.iter().all(|c| c.is_finite()));
    let both = positions.iter().zip(normals);
    both.map(|(&position, normal)| CorePoint {
        position,
        normal: unit(normal),
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    fn plane(x: f64) -> Vec<Point3<f64>> {
        (0..400)
            .map(|i| Point3::new(x, 0.02 * f64::from(i % 20), 0.02 * f64::from(i / 20)))
            .collect()
    }

    #[test]
    fn given_and_fitted_normals_see_the_same_shift_and_strays_do_not_count() {
        let [first, mut second] = [0.0, 0.005].map(plane);
        second.push(Point3::new(f64::NAN, 0.2, 0.2));
        let core = [Point3::new(0.0, 0.2, 0.2), Point3::new(50.0, 0.0, 0.0)];
        let run = |normals: CoreNormals| {
            let clouds = [first.clone(), second.clone()];
            m3c2_clouds(clouds, &core, &normals, &M3c2Params::default(), &Silent)
        };
        let fitted = run(CoreNormals::Fitted(OutwardReference::Direction(Vector3::x()))).unwrap();
        assert!((fitted.points[0].distance_m.unwrap() - 0.005).abs() < 1e-12);
        assert!(fitted.points[1].normal.x.is_nan() && fitted.points[1].distance_m.is_none());
        let opposite = [-3.0 * Vector3::x(), Vector3::zeros()];
        let given = run(CoreNormals::Given(&opposite)).unwrap();
        assert!((given.points[0].distance_m.unwrap() + 0.005).abs() < 1e-12);
        assert!(given.points[1].normal.x.is_nan());
        let error = run(CoreNormals::Given(&opposite[..1])).unwrap_err();
        assert!(
            error.to_string().contains("1 normals for 2 core points"),
            "{error}"
        );
    }
}
