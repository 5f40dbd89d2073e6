//! A stone's own motion against that of the field: what its points say between the two.
//!
//! Each motion has its window, and with it its own points. A few beside the stone's rim that count at one motion only would outweigh
//! what all others say, by a log likelihood of 20 in drone clouds, so both motions are judged on the same points. And a stone moves
//! as one: where a corner alone asks for a motion that the rest refuses, the mask took in something else there.

use super::equations::{Layout, LocalPair, Motion9, deviance};
use super::patch::SurfaceNoise;
use super::survey::median;
use super::track::Track;

/// Log of the odds, 20, at which half of a stone speaks against a motion.
const CONTRADICTION: f64 = 3.0;

/// Whether a place in the first epoch belongs to a part of the stone.
type Part<'a> = &'a dyn Fn(&[f64; 3]) -> bool;

/// The field's motion of a stone and its own, each with its window.
pub(super) struct Rivals<'a> {
    pub pair: &'a LocalPair,
    pub tight: &'a Track,
    pub free: &'a Track,
    pub noise: &'a SurfaceNoise,
    pub layout: &'a Layout,
}

/// What a stone's points say between two motions.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Comparison {
    /// Log likelihood of the stone's own motion less that of the field's, on the same points: those of the window that says less for it.
    pub advantage: f64,
    /// Whether the stone's own motion is more likely, and one of its halves speaks against it.
    pub contradicted: bool,
}

impl Rivals<'_> {
    /// `inflation`: factor on the points' variances, by which a log likelihood means less. Cost: four fits of the surface; where the points
    /// speak for the stone's own motion, sixteen of halves.
    pub fn compare(&self, inflation: f64) -> Comparison {
        let advantage = self.least(&[&|_| true]);
        let limit = CONTRADICTION * inflation;
        Comparison {
            advantage,
            contradicted: advantage > limit && self.least_half() < -limit,
        }
    }

    /// Of the half that says least for the stone's own motion: cut either way through the middle of the first epoch's points.
    fn least_half(&self) -> f64 {
        let [u, v] = [0, 1].map(|axis| {
            let mut places: Vec<f64> = self.pair.first.iter().map(|p| p[axis]).collect();
            median(&mut places).unwrap_or(0.0)
        });
        self.least(&[&|p| p[0] < u, &|p| p[0] >= u, &|p| p[1] < v, &|p| p[1] >= v])
    }

    /// The least log likelihood ratio over both windows and these parts of the stone.
    fn least(&self, parts: &[Part]) -> f64 {
        let windows = [self.tight.window(), self.free.window()];
        let ratios = windows
            .iter()
            .flat_map(|w| parts.iter().map(|part| self.ratio(w, part)));
        ratios.fold(f64::INFINITY, f64::min)
    }

    fn ratio(&self, window: &Motion9, part: Part) -> f64 {
        let points = self.pair.counting(window, part);
        let [tight, free] =
            [self.tight, self.free].map(|t| deviance(&points, &t.motion, self.noise, self.layout));
        0.5 * (tight - free)
    }
}

#[cfg(test)]
mod tests {
    use super::super::border::{NearPoint, stone_points};
    use super::super::equations::equations;
    use super::super::pairs::PairPoints;
    use super::*;
    use crate::cloud::Cloud;
    use crate::geometry::FaceFrame;
    use crate::id::StoneId;
    use nalgebra::{Point3, Vector3};
    use rand::{RngExt, SeedableRng};
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

    /// A wavy face of 0.4 m along y and z, points every 5 mm; what of it lies where after `moved`, and how high it stands out.
    fn scan(seed: u64, moved: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Vec<NearPoint> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let place = |i: i32| f64::from(i) * 0.005 - 0.2;
        (0..81 * 81)
            .map(|i| {
                let (y, z) = (place(i % 81), place(i / 81));
                let noise =
                    NOISE.sigma_m[0] * ((0..12).map(|_| rng.random_range(0.0..1.0)).sum::<f64>() - 6.0);
                let p = Vector3::new(0.006 * ((50.0 * y).sin() + (40.0 * z).cos()), y, z);
                let q = p + moved(&p);
                NearPoint {
                    offset: Vector3::new(q.x + noise, q.y, q.z).cast::<f32>().into(),
                    labelled: y.abs().max(z.abs()) < HALF_M,
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
        LocalPair::new(&pair, &FaceFrame::from_normal(&normal).face_from_world())
    }

    fn track(world: &Vector3<f64>) -> Track {
        let mut x = Motion9::zeros();
        let frame = FaceFrame::from_normal(&Vector3::x()).face_from_world();
        x.fixed_rows_mut::<3>(0).copy_from(&(frame * world));
        Track::new(x)
    }

    fn compare(second: &[NearPoint], own: &Vector3<f64>) -> Comparison {
        let (still, free) = (track(&Vector3::zeros()), track(own));
        let rivals = Rivals {
            pair: &local_pair(second),
            tight: &still,
            free: &free,
            noise: &NOISE,
            layout: &LAYOUT,
        };
        rivals.compare(1.0)
    }

    #[test]
    fn points_that_count_at_one_motion_alone_do_not_decide() {
        // Along the upper rim something stands in front of the second epoch's stone; a window farther down does not show it.
        let second = scan(2, |p| {
            let is_hidden = p.z > 0.08 && p.z < 0.095;
            Vector3::new(if is_hidden { 0.05 } else { 0.0 }, 0.0, 0.0)
        });
        let down = Vector3::new(0.0, 0.0, -0.02);
        let pair = local_pair(&second);
        let [at_rest, lower] = [Vector3::zeros(), down].map(|d| {
            let x = track(&d).motion;
            equations(&pair, &x, &x, &NOISE, &LAYOUT).deviance
        });
        assert!(0.5 * (at_rest - lower) > 20.0, "{at_rest} {lower}");
        assert!(compare(&second, &down).advantage < -20.0);
    }

    #[test]
    fn a_stone_moves_as_one() {
        let own = Vector3::new(0.0, 0.012, 0.0);
        let whole = compare(&scan(2, |_| own), &own);
        assert!(whole.advantage > 20.0 && !whole.contradicted, "{whole:?}");
        let torn = compare(
            &scan(2, |p| if p.y > -0.035 { own } else { Vector3::zeros() }),
            &own,
        );
        assert!(torn.advantage > 20.0 && torn.contradicted, "{torn:?}");
        let none = compare(&scan(2, |_| Vector3::zeros()), &own);
        assert!(none.advantage < -20.0 && !none.contradicted, "{none:?}");
    }
}
