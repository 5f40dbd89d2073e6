//! A stone's own motion against that of the field: the likelihood ratio of its points.
//!
//! Each motion has its window, and with it its own points. A few beside the stone's rim that count at one
//! motion only would outweigh what all others say, by a log likelihood of 20 in drone clouds, so both motions
//! are judged on the same points.

use crate::registration::adjustment::observation::surface::{Layout, LocalPair, SurfaceNoise, deviance};
use crate::registration::adjustment::stone_vector::StoneVector;

/// A motion and the motion with which the stone's window moves there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed {
    pub motion: StoneVector,
    pub window: StoneVector,
}

/// The test of a stone's own motion against the field's.
pub(crate) struct LikelihoodRatioTest<'a> {
    pub pair: &'a LocalPair,
    pub with_field: Placed,
    pub on_own: Placed,
    pub noise: &'a SurfaceNoise,
    pub layout: &'a Layout,
}

impl LikelihoodRatioTest<'_> {
    /// Log likelihood of the stone's own motion less that of the field's, on the same points: those of the window where
    /// it is less. Cost: four fits of the surface.
    pub fn log_ratio(&self) -> f64 {
        [self.with_field.window, self.on_own.window]
            .iter()
            .map(|window| self.ratio(window))
            .fold(f64::INFINITY, f64::min)
    }

    fn ratio(&self, window: &StoneVector) -> f64 {
        let points = self.pair.counting(window);
        let [with_field, on_own] = [self.with_field, self.on_own]
            .map(|placed| deviance(&points, &placed.motion, self.noise, self.layout));
        0.5 * (with_field - on_own)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::geometry::FaceFrame;
    use crate::id::StoneId;
    use crate::registration::adjustment::observation::surface::{FitOptions, equations};
    use crate::registration::points::PairPoints;
    use crate::registration::points::{NearPoint, stone_points};
    use nalgebra::{Point3, Vector3};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use std::sync::Arc;

    const NOISE: SurfaceNoise = SurfaceNoise {
        sigma_m: [0.002; 2],
        tau_m: 0.003,
    };
    const LAYOUT: Layout = Layout {
        cell_m: 0.02,
        patch_cells: 24,
        outlier_sigmas: 3.5,
    };
    /// Half the side of the stone's mask.
    const HALF_M: f64 = 0.1;

    /// A wavy face of 0.4 m along y and z, points every 5 mm; what of it lies where after `moved`, and how
    /// high it stands out.
    fn scan(seed: u64, moved: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Vec<NearPoint> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let place = |i: i32| f64::from(i) * 0.005 - 0.2;
        (0..81 * 81)
            .map(|i| {
                let (y, z) = (place(i % 81), place(i / 81));
                let noise = NOISE.sigma_m[0] * stonewise_testing::normal(&mut rng);
                let p = Vector3::new(0.006 * ((50.0 * y).sin() + (40.0 * z).cos()), y, z);
                let q = p + moved(&p);
                NearPoint {
                    offset: Vector3::new(q.x + noise, q.y, q.z).cast::<f32>().into(),
                    labelled: y.abs().max(z.abs()) < HALF_M,
                    source: 0,
                }
            })
            .collect()
    }

    fn local_pair(second: &[NearPoint]) -> LocalPair {
        let normal = Vector3::x();
        let chosen = stone_points(
            [&scan(1, |_| Vector3::zeros()), second],
            &normal,
            &Vector3::zeros(),
            3.0,
        );
        let cloud = |offsets: Vec<[f32; 3]>| Cloud::new(Point3::origin(), offsets);
        let pair = PairPoints {
            first: StoneId(1),
            second: StoneId(1),
            centroid: Point3::origin(),
            centroid_second: Point3::origin(),
            normal,
            points_first: cloud(chosen.first),
            points_second: cloud(chosen.second),
            nearby_second: cloud(chosen.nearby_second),
            window: chosen.window.map(Arc::new),
        };
        LocalPair::new(
            &pair,
            &FaceFrame::from_normal(&normal).face_from_world(),
            [1.0; 2],
        )
    }

    fn placed(world: &Vector3<f64>) -> Placed {
        let frame = FaceFrame::from_normal(&Vector3::x()).face_from_world();
        let motion = StoneVector::from_translation(frame * world);
        Placed {
            motion,
            window: motion,
        }
    }

    fn log_ratio(second: &[NearPoint], own: &Vector3<f64>) -> f64 {
        let test = LikelihoodRatioTest {
            pair: &local_pair(second),
            with_field: placed(&Vector3::zeros()),
            on_own: placed(own),
            noise: &NOISE,
            layout: &LAYOUT,
        };
        test.log_ratio()
    }

    #[test]
    fn points_that_count_at_one_motion_alone_do_not_decide() {
        // Along the upper rim something stands in front of the second epoch's stone; a window farther down
        // does not show it.
        let second = scan(2, |p| {
            let is_hidden = p.z > 0.08 && p.z < 0.095;
            Vector3::new(if is_hidden { 0.05 } else { 0.0 }, 0.0, 0.0)
        });
        let down = Vector3::new(0.0, 0.0, -0.02);
        let pair = local_pair(&second);
        let [at_rest, lower] = [Vector3::zeros(), down].map(|d| {
            let x = placed(&d).motion;
            equations(&pair, &x, &x, &NOISE, &LAYOUT, &FitOptions::EXACT).deviance
        });
        assert!(0.5 * (at_rest - lower) > 20.0, "{at_rest} {lower}");
        assert!(log_ratio(&second, &down) < -20.0);
    }

    #[test]
    fn points_favour_the_motion_that_the_stone_made() {
        let own = Vector3::new(0.0, 0.012, 0.0);
        assert!(log_ratio(&scan(2, |_| own), &own) > 20.0);
        assert!(log_ratio(&scan(2, |_| Vector3::zeros()), &own) < -20.0);
    }
}
