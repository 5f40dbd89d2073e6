//! The sensor that measures a stone, where several show it in an epoch.
//!
//! A scanner's points weigh a hundred times as much as those of a drone that see the same stone; what the
//! drone's points add is less than what their own errors (trajectory, footprint, strips that do not fit) do
//! harm. So the sharpest sensor that shows the stone measures it.

use super::near_point::NearPoint;
use super::noise::{cells, noise_of_face, sharpest_sensor};
use nalgebra::{Matrix3, Point3, Vector3};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// The points of the sharpest sensor that shows enough of the stone; all of them where there is only one, or
/// none shows enough.
pub(super) fn of_best_sensor<'a>(
    near: &'a [NearPoint],
    face_from_world: &Matrix3<f64>,
) -> Cow<'a, [NearPoint]> {
    let mut faces: BTreeMap<u32, Vec<Point3<f64>>> = BTreeMap::new();
    for p in near.iter().filter(|p| p.labelled) {
        let at = face_from_world * Vector3::from(p.offset.map(f64::from));
        faces.entry(p.source).or_default().push(at.into());
    }
    if faces.len() < 2 {
        return Cow::Borrowed(near);
    }
    let noise = |(source, face): (&u32, &Vec<Point3<f64>>)| Some((*source, noise_of_face(face)?));
    let noises = faces.iter().filter_map(noise).collect();
    let shown = cells(faces.values().flatten()).len() as f64;
    let shows = |sources: &[u32]| {
        let own = faces.iter().filter(|(source, _)| sources.contains(source));
        cells(own.flat_map(|(_, face)| face)).len() as f64
    };
    match sharpest_sensor(noises, shown, shows) {
        Some(sensor) => Cow::Owned(
            near.iter()
                .filter(|p| sensor.contains(&p.source))
                .copied()
                .collect(),
        ),
        None => Cow::Borrowed(near),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::collections::BTreeSet;

    /// Points of one source at random places in part of a face of 30 by 20 cm.
    fn scan(source: u32, noise_m: f64, points: usize, share: f64, seed: u64) -> Vec<NearPoint> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let point = |_| {
            let (y, z): (f64, f64) = (rng.random_range(0.0..0.3 * share), rng.random_range(0.0..0.2));
            let x = 0.004 * (30.0 * y).sin() + noise_m * stonewise_testing::normal(&mut rng);
            NearPoint {
                offset: [x, y, z].map(|v| v as f32),
                labelled: true,
                source,
            }
        };
        (0..points).map(point).collect()
    }

    fn kept(scans: &[Vec<NearPoint>]) -> BTreeSet<u32> {
        let face = crate::geometry::FaceFrame::from_normal(&Vector3::x()).face_from_world();
        let kept = of_best_sensor(&scans.concat(), &face).into_owned();
        kept.iter().map(|p| p.source).collect()
    }

    #[test]
    fn a_stone_is_measured_by_the_sharpest_sensor_that_shows_it() {
        let stations = [scan(0, 0.001, 900, 1.0, 1), scan(1, 0.002, 500, 0.5, 2)];
        let strips = [scan(2, 0.011, 600, 1.0, 3), scan(3, 0.013, 600, 1.0, 4)];
        let both = [stations.to_vec(), strips.to_vec()].concat();
        assert_eq!(kept(&both), BTreeSet::from([0, 1]));
        assert_eq!(kept(&strips), BTreeSet::from([2, 3]));
        // What the scanner hardly sees, the drone measures.
        let corner = [vec![scan(0, 0.001, 200, 0.2, 5)], strips.to_vec()].concat();
        assert_eq!(kept(&corner), BTreeSet::from([2, 3]));
    }
}
