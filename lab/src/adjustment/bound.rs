//! The Cramér-Rao bound of the stones: what their true relief and the true noise of the points allow.
//!
//! With the surface known, the points of one epoch have the information sum of J' J / sigma^2, J = (n, arm x
//! n), n the true normal and sigma the true noise along it. Where both epochs measure the same surface with
//! noise, the covariances of both add. No estimator that treats stones (or windows of stones) apart can be
//! better in the mean.

use nalgebra::{Matrix6, Point3, Vector3, Vector6};
use rayon::prelude::*;
use std::collections::BTreeMap;
use stonewise_simulate::{Target, World};

/// One point in this many is looked at.
pub const STEP: usize = 4;
/// Half the side of the window that a buffer of 60 cm makes around a stone, metres.
const WINDOW_M: f64 = 0.75;

/// True places of an epoch's points on the unmoved wall, with stone and cosine of incidence; and how many
/// points each stands for.
pub struct Exact {
    pub points: Vec<(u32, Point3<f64>, f64)>,
    pub weight: f64,
    /// Noise along the normal beside that of the ranges, metres.
    pub noise_m: f64,
}

/// By stone: places, normals and weights of an epoch's points.
type Facets = BTreeMap<u32, Vec<(Point3<f64>, Vector3<f64>, f64)>>;

/// Per stone: standard deviations (in the face 2D, out of it) of the stone alone and of its window, metres.
///
/// `sigma_m`: range noise on a surface met square on; it grows with 1/sqrt(cos incidence), and its part along
/// the normal is cos incidence times that.
pub fn bounds(world: &World, epochs: &[Exact; 2], sigma_m: f64) -> BTreeMap<u32, [[f64; 2]; 2]> {
    let scene = world.scene(0);
    let face = &scene.wall().face;
    let middle = |stone: u32| {
        Point3::from(
            world.wall.stones[stone as usize - 1]
                .world_from_stone
                .translation
                .vector,
        )
    };

    let mut rows: [Facets; 2] = Default::default();
    for (epoch, exact) in epochs.iter().enumerate() {
        let found: Vec<_> = exact
            .points
            .par_iter()
            .filter_map(|(stone, p, cos)| {
                let f = face.face_of(p);
                let hit = scene.on_face(f.a, f.u)?;
                matches!(hit.target, Target::Stone(k, _) if k as u32 + 1 == *stone).then_some((
                    *stone,
                    *p,
                    hit.normal,
                    exact.weight / (sigma_m * sigma_m * cos + exact.noise_m * exact.noise_m),
                ))
            })
            .collect();
        for (stone, p, n, w) in found {
            rows[epoch].entry(stone).or_default().push((p, n, w));
        }
    }

    let stones: Vec<u32> = rows[0].keys().copied().collect();
    let information = |about: &Point3<f64>, members: &[u32], epoch: usize| -> Matrix6<f64> {
        let mut h = Matrix6::zeros();
        for (p, n, w) in members.iter().filter_map(|s| rows[epoch].get(s)).flatten() {
            let m = (p - about).cross(n);
            let j = Vector6::new(n.x, n.y, n.z, m.x, m.y, m.z);
            h.syger(*w, &j, &j, 1.0);
        }
        h.fill_upper_triangle_with_lower_triangle();
        h
    };

    stones
        .par_iter()
        .filter_map(|&stone| {
            let c = middle(stone);
            let frame = face.frame(face.face_of(&c).a).face_from_world();
            let window: Vec<u32> = stones
                .iter()
                .copied()
                .filter(|&s| (middle(s) - c).norm() < WINDOW_M)
                .collect();
            let sd = |members: &[u32]| -> Option<[f64; 2]> {
                let covariance =
                    information(&c, members, 0).try_inverse()? + information(&c, members, 1).try_inverse()?;
                let local = frame * covariance.fixed_view::<3, 3>(0, 0) * frame.transpose();
                Some([(local[(0, 0)] + local[(1, 1)]).sqrt(), local[(2, 2)].sqrt()])
            };
            Some((stone, [sd(&[stone])?, sd(&window)?]))
        })
        .collect()
}
