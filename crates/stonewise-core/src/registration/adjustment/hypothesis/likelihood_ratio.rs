//! A stone's own motion against that of the field: the likelihood ratio of its points.
//!
//! Each motion has its window, and with it its own points. A few beside the stone's rim that count at one
//! motion only would outweigh what all others say, by a log likelihood of 20 in drone clouds, so both motions
//! are judged on the same points. And a stone moves as one: where a corner fits a motion that the rest
//! contradicts, the mask took in something else there.

use crate::registration::adjustment::observation::surface::{Layout, LocalPair, SurfaceNoise, deviance};
use crate::registration::adjustment::stone_vector::StoneVector;
use crate::statistics::upper_median;
use crate::switches::is_on;

/// Log of the odds, 20, at which half of a stone contradicts a motion.
const CONTRADICTION: f64 = 3.0;

/// Whether a place in the first epoch belongs to a part of the stone.
type Part<'a> = &'a dyn Fn(&[f64; 3]) -> bool;

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

/// What a stone's points say between the two motions.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LikelihoodRatio {
    /// Log likelihood of the stone's own motion less that of the field's, on the same points: those of the
    /// window where it is less.
    pub log_ratio: f64,
    /// Whether the stone's own motion is more likely, and one of its halves contradicts it.
    pub is_contradicted: bool,
    /// Result of testing the halves; `None` where the whole stone does not favour its own motion with the odds of a
    /// contradiction.
    pub halves: Option<Halves>,
}

/// Comparison of the two motions on the halves of a stone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Halves {
    /// Log likelihood ratio of the half that favours the stone's own motion least.
    least: f64,
    /// The motions that were compared: with the field, on its own.
    at: [StoneVector; 2],
}

impl LikelihoodRatioTest<'_> {
    /// `inflation`: factor on the points' variances, by which a log likelihood means less. `known`: earlier result for
    /// the halves, reused if each motion is within a millimetre of what it was then. Cost: four fits of the surface;
    /// sixteen more for the halves, where the points favour the stone's own motion and `known` does not hold.
    pub fn run(&self, inflation: f64, known: Option<&Halves>) -> LikelihoodRatio {
        let log_ratio = self.log_ratio();
        let limit = CONTRADICTION * inflation;
        let at = [self.with_field.motion, self.on_own.motion];
        let known = known.filter(|halves| halves.at.iter().zip(&at).all(|(a, b)| a.is_alike(b)));
        let test = || Halves {
            least: self.least_half(),
            at,
        };
        let halves = (log_ratio > limit && is_on("halves")).then(|| known.copied().unwrap_or_else(test));
        LikelihoodRatio {
            log_ratio,
            is_contradicted: halves.is_some_and(|halves| halves.least < -limit),
            halves,
        }
    }

    /// [`LikelihoodRatio::log_ratio`] alone.
    pub fn log_ratio(&self) -> f64 {
        self.least(&[&|_| true])
    }

    /// The least log likelihood ratio over the halves of the stone, cut either way through the middle of the first
    /// epoch's points: that of the half that favours the stone's own motion least.
    fn least_half(&self) -> f64 {
        let [u, v] = [0, 1].map(|axis| {
            let mut places: Vec<f64> = self.pair.first.iter().map(|p| p[axis]).collect();
            upper_median(&mut places).unwrap_or(0.0)
        });
        self.least(&[&|p| p[0] < u, &|p| p[0] >= u, &|p| p[1] < v, &|p| p[1] >= v])
    }

    /// The least log likelihood ratio over both windows and these parts of the stone.
    fn least(&self, parts: &[Part]) -> f64 {
        let windows = [self.with_field.window, self.on_own.window];
        let ratios = windows
            .iter()
            .flat_map(|w| parts.iter().map(|part| self.ratio(w, part)));
        ratios.fold(f64::INFINITY, f64::min)
    }

    fn ratio(&self, window: &StoneVector, part: Part) -> f64 {
        let points = self.pair.counting(window, part);
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
    use crate::registration::adjustment::observation::surface::NoiseFactors;
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
            NoiseFactors::USUAL,
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

    fn compare(second: &[NearPoint], own: &Vector3<f64>) -> LikelihoodRatio {
        compare_knowing(second, own, None)
    }

    fn compare_knowing(second: &[NearPoint], own: &Vector3<f64>, known: Option<&Halves>) -> LikelihoodRatio {
        let test = LikelihoodRatioTest {
            pair: &local_pair(second),
            with_field: placed(&Vector3::zeros()),
            on_own: placed(own),
            noise: &NOISE,
            layout: &LAYOUT,
        };
        test.run(1.0, known)
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
        assert!(compare(&second, &down).log_ratio < -20.0);
    }

    #[test]
    fn a_stone_moves_as_one() {
        let own = Vector3::new(0.0, 0.012, 0.0);
        let whole = compare(&scan(2, |_| own), &own);
        assert!(whole.log_ratio > 20.0 && !whole.is_contradicted, "{whole:?}");
        let second = scan(2, |p| if p.y > -0.035 { own } else { Vector3::zeros() });
        let torn = compare(&second, &own);
        assert!(torn.log_ratio > 20.0 && torn.is_contradicted, "{torn:?}");
        // An earlier result is reused as long as neither motion has changed by more than a millimetre.
        let agreeing = |own: &Vector3<f64>| Halves {
            least: 0.0,
            at: [Vector3::zeros(), *own].map(|d| placed(&d).motion),
        };
        for (apart_m, is_known) in [(0.9e-3, true), (1.1e-3, false)] {
            let known = agreeing(&(own + Vector3::new(0.0, apart_m, 0.0)));
            let torn = compare_knowing(&second, &own, Some(&known));
            assert_eq!(torn.is_contradicted, !is_known, "{apart_m}");
        }
        let none = compare(&scan(2, |_| Vector3::zeros()), &own);
        assert!(none.log_ratio < -20.0 && !none.is_contradicted, "{none:?}");
    }
}
