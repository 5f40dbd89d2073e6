//! Evaluation of the stones' own points, some batches at a time.

use super::candidate::CandidateMotion;
use super::covered::covered;
use super::error::AdjustError;
use super::hypothesis::{LikelihoodRatioTest, Placed, Probe};
use super::observation::surface::{Correlation, Effort, Equations, LocalPair, estimate_noise};
use super::state::{Adjustment, StoneState};
use super::stone_vector::StoneVector;
use super::survey::Points;
use crate::registration::points::{PairPoints, PairSource};
use crate::switches::{switchable, where_on};
use rayon::prelude::*;

/// What a stone's points say where it moved since the last evaluation.
struct Evaluation {
    with_field: Equations,
    on_own: Option<Equations>,
    log_ratio: Option<f64>,
}

impl Adjustment {
    /// Estimates the noise of the points at the stones' present motions; all equations are then evaluated anew.
    pub fn estimate_noise(&mut self, sample: &[(usize, PairPoints)]) {
        let sample: Vec<(LocalPair, StoneVector)> = sample
            .par_iter()
            .map(|(i, pair)| {
                let pair = self.local_pair(*i, pair);
                (pair, self.stones[*i].with_field.motion)
            })
            .collect();
        let views: Vec<(&LocalPair, StoneVector)> = sample.iter().map(|(p, x)| (p, *x)).collect();
        self.surface.noise = estimate_noise(&views, &self.surface.noise, &self.surface.layout);
        self.invalidate();
    }

    /// Sets how exactly stones are evaluated from now on. Approximate equations are then evaluated anew.
    pub fn set_effort(&mut self, effort: Effort) {
        if self.surface.effort == Effort::Aligning && effort != Effort::Aligning {
            self.invalidate();
        }
        self.surface.effort = effort;
    }

    /// Forgets all equations.
    fn invalidate(&mut self) {
        for stone in &mut self.stones {
            stone.with_field.surface.invalidate();
            if let Some(own) = &mut stone.on_own {
                own.surface.invalidate();
            }
        }
    }

    /// The points of a stone in its frame.
    pub fn local_pair(&self, i: usize, pair: &PairPoints) -> LocalPair {
        let face_from_world = &self.prior.graph.nodes[i].face_from_world;
        LocalPair::new(pair, face_from_world, self.stones[i].info.noise_factors)
    }

    /// Normal equations of all stones that moved since they were last evaluated.
    pub fn evaluate<S: PairSource>(&mut self, points: &Points<S>) -> Result<(), AdjustError<S::Error>> {
        let due: Vec<bool> = self.stones.iter().map(|stone| self.is_due(stone)).collect();
        let settled = due.iter().filter(|due| !**due).count();
        points.progress.advance(settled as u64);
        for group in points.groups(|i| due[i]) {
            let new = points.of_stones(
                &group,
                |i| due[i],
                |i, pair| {
                    let new = self.evaluate_one(i, pair);
                    points.progress.advance(1);
                    new
                },
            )?;
            for (i, new) in new {
                new.store(&mut self.stones[i]);
            }
        }
        let covered = covered(self);
        let uncovered = self
            .stones
            .iter()
            .zip(&covered)
            .filter_map(|(s, covered)| (!covered).then_some(s));
        let known: Vec<(&Equations, f64)> = uncovered
            .filter_map(|s| Some((s.with_field.surface.equations()?, s.effective_freedom)))
            .collect();
        self.surface.correlation = where_on("correlation", Correlation::of(&known), Correlation::NONE);
        Ok(())
    }

    /// Whether a stone left the motion, either of two, at which its equations were evaluated.
    fn is_due(&self, stone: &StoneState) -> bool {
        self.is_candidate_due(&stone.with_field)
            || stone.on_own.as_ref().is_some_and(|c| self.is_candidate_due(c))
    }

    fn is_candidate_due(&self, candidate: &CandidateMotion) -> bool {
        self.surface.is_due(&candidate.surface, &candidate.motion)
    }

    /// Evaluates the points of a stone at its present motions.
    fn evaluate_one(&self, i: usize, pair: &PairPoints) -> Evaluation {
        let stone = &self.stones[i];
        let local = self.local_pair(i, pair);
        let anew = |candidate: &CandidateMotion| {
            let window = candidate.surface.window(&candidate.motion);
            let weights = candidate.surface.weights(&candidate.motion);
            self.surface
                .equations(&local, &candidate.motion, &window, weights)
        };

        let compare = |own: &CandidateMotion| {
            let test = LikelihoodRatioTest {
                pair: &local,
                with_field: placed(&stone.with_field),
                on_own: placed(own),
                noise: &self.surface.noise,
                layout: &self.surface.layout,
            };
            test.log_ratio()
        };

        // The ratio is that of both present motions, so the equations must belong to them as well.
        let own = stone.on_own.as_ref();
        Evaluation {
            with_field: anew(&stone.with_field),
            on_own: own.map(anew),
            log_ratio: own.map(compare),
        }
    }

    /// Tries stones at a distance. Where another place fits better, a stone is followed on its own from there.
    ///
    /// Cost: eight evaluations of these stones.
    pub fn probe<S: PairSource>(&mut self, points: &Points<S>) -> Result<(), AdjustError<S::Error>> {
        switchable!("probe", Ok(()));
        for group in points.groups(|i| self.may_be_elsewhere(&self.stones[i])) {
            let may_be = |i: usize| self.may_be_elsewhere(&self.stones[i]);
            let found = points.of_stones(&group, may_be, |i, pair| self.probe_one(i, pair))?;
            for (i, place) in found.into_iter().filter_map(|(i, place)| Some((i, place?))) {
                self.stones[i].on_own = Some(CandidateMotion::new(place));
            }
        }
        Ok(())
    }

    /// Whether a stone is to be tried at a distance: usable, and its points leave its motion open, or it is followed on
    /// its own already. It may have left the field because it moved out of the face, and still be at a false
    /// optimum in the face.
    fn may_be_elsewhere(&self, stone: &StoneState) -> bool {
        let inflation = self.surface.inflation_of_all(stone.surface());
        let is_open = |e: &Equations| Probe::is_open(e, inflation, self.params.loose_move_m);
        stone.info.usable
            && (stone.on_own.is_some() || stone.with_field.surface.equations().is_some_and(is_open))
    }

    fn probe_one(&self, i: usize, pair: &PairPoints) -> Option<StoneVector> {
        let stone = &self.stones[i];
        let from = stone.on_own.as_ref().unwrap_or(&stone.with_field);
        let probe = Probe {
            pair: &self.local_pair(i, pair),
            here: placed(from),
            surface: &self.surface,
            inflation: self.surface.inflation_of_all(stone.surface()),
            move_m: self.params.loose_move_m,
        };
        probe.best(from.surface.equations()?)
    }
}

impl Evaluation {
    fn store(self, stone: &mut StoneState) {
        stone.log_ratio = self.log_ratio.unwrap_or_default();
        let at = stone.with_field.motion;
        stone.with_field.surface.set(at, self.with_field);
        if let (Some(equations), Some(own)) = (self.on_own, &mut stone.on_own) {
            own.surface.set(own.motion, equations);
        }
    }
}

fn placed(candidate: &CandidateMotion) -> Placed {
    Placed {
        motion: candidate.motion,
        window: candidate.surface.window(&candidate.motion),
    }
}

#[cfg(test)]
mod tests {
    use super::super::adjust::adjust;
    use super::super::observation::surface::PointWeights;
    use super::super::params::AdjustmentParams;
    use super::super::testing::{begun, wall};
    use super::*;
    use crate::cloud::Cloud;
    use crate::progress::Silent;
    use crate::registration::points::MemoryPairs;
    use nalgebra::Vector3;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use std::convert::Infallible;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// Counts how often each batch is read.
    struct Counting {
        pairs: MemoryPairs,
        loads: [AtomicUsize; 2],
    }

    impl Counting {
        fn loads(&self) -> [usize; 2] {
            [0, 1].map(|batch| self.loads[batch].load(Ordering::Relaxed))
        }
    }

    impl PairSource for Counting {
        type Error = Infallible;

        fn batch_count(&self) -> usize {
            self.pairs.batch_count()
        }

        fn load(&self, batch: usize) -> Result<Vec<PairPoints>, Infallible> {
            self.loads[batch].fetch_add(1, Ordering::Relaxed);
            self.pairs.load(batch)
        }
    }

    /// The true motion of a stone in its frame.
    fn true_motion(adjustment: &Adjustment, i: usize, world: Vector3<f64>) -> StoneVector {
        StoneVector::from_translation(adjustment.prior.graph.nodes[i].face_from_world * world)
    }

    #[test]
    fn a_newton_step_errs_as_the_information_says() {
        let truth = Vector3::new(0.001, 0.004, -0.003);
        let noise = [0.001, 0.0015];
        let pairs = MemoryPairs::new(wall(8, noise, |_| truth));
        let (mut adjustment, points) = begun(&pairs);
        adjustment.surface.noise.sigma_m = noise;
        // Half a millimetre beside the truth, far less than the waves of the faces.
        for i in 0..adjustment.stones.len() {
            let beside = truth + Vector3::new(0.0002, -0.0004, 0.0003);
            adjustment.stones[i].with_field.motion = true_motion(&adjustment, i, beside);
        }
        adjustment.evaluate(&points).unwrap();
        let squares: Vec<f64> = (0..adjustment.stones.len())
            .map(|i| {
                let stone = &adjustment.stones[i].with_field;
                let e = stone.surface.equations().unwrap();
                let step = e.information.cholesky().unwrap().solve(&e.gradient);
                let error = (stone.motion - true_motion(&adjustment, i, truth)).unknowns() - step;
                error.dot(&(e.information * error))
            })
            .collect();
        // Six unknowns: chi-square of 6 a stone, whose mean over 64 stones scatters by 0.43.
        let mean = squares.iter().sum::<f64>() / squares.len() as f64;
        assert!((4.0..8.0).contains(&mean), "{mean}");
    }

    #[test]
    fn only_batches_with_stones_that_moved_are_read_again() {
        let source = Counting {
            pairs: MemoryPairs::new(wall(10, [0.001; 2], |_| Vector3::zeros())),
            loads: Default::default(),
        };
        let (mut adjustment, points) = begun(&source);
        assert_eq!(source.loads(), [1, 1]);
        adjustment.evaluate(&points).unwrap();
        assert_eq!(source.loads(), [2, 2]);
        adjustment.evaluate(&points).unwrap();
        assert_eq!(source.loads(), [2, 2]);

        let gradient =
            |a: &Adjustment, i: usize| a.stones[i].with_field.surface.equations().unwrap().gradient;
        let before = [0, 70, 71].map(|i| gradient(&adjustment, i));
        let moved = true_motion(&adjustment, 70, Vector3::new(0.0, 0.002, 0.0));
        adjustment.stones[70].with_field.motion = moved;
        adjustment.evaluate(&points).unwrap();
        assert_eq!(source.loads(), [2, 3]);
        assert_eq!([0, 71].map(|i| gradient(&adjustment, i)), [before[0], before[2]]);
        // Brute force: the stone's points alone at its new motion.
        let frame = &adjustment.prior.graph.nodes[70].face_from_world;
        let local = LocalPair::new(&source.pairs.pairs()[70], frame, [1.0; 2]);
        let alone = adjustment
            .surface
            .equations(&local, &moved, &moved, &PointWeights::NONE);
        assert_eq!(gradient(&adjustment, 70), alone.gradient);
        assert_ne!(alone.gradient, before[1]);
    }

    #[test]
    fn the_noise_of_both_epochs_is_found_and_equations_are_due_again() {
        let noise = [0.001, 0.002];
        let pairs = MemoryPairs::new(wall(8, noise, |_| Vector3::zeros()));
        let (mut adjustment, points) = begun(&pairs);
        for _ in 0..4 {
            adjustment.evaluate(&points).unwrap();
            assert!(!adjustment.stones.iter().any(|s| adjustment.is_due(s)));
            adjustment.estimate_noise(&points.sample);
            assert!(adjustment.stones.iter().all(|s| adjustment.is_due(s)));
        }
        for (found, truth) in adjustment.surface.noise.sigma_m.iter().zip(noise) {
            assert!((found / truth - 1.0).abs() < 0.05, "{found} instead of {truth}");
        }
    }

    #[test]
    fn planes_among_rough_stones_stay_with_their_neighbours() {
        let noise_m = 0.002;
        let mut pairs = wall(8, [noise_m; 2], |_| Vector3::zeros());
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut flat = |cloud: &Cloud| {
            let points = (0..cloud.len()).map(|i| {
                let p = cloud.local(i);
                let noise = noise_m * stonewise_testing::normal(&mut rng);
                [noise as f32, p.y as f32, p.z as f32]
            });
            Cloud::new(cloud.origin(), points.collect())
        };
        for plane in pairs.iter_mut().step_by(3) {
            plane.points_first = flat(&plane.points_first);
            plane.points_second = flat(&plane.points_second);
        }
        let report = adjust(&MemoryPairs::new(pairs), &AdjustmentParams::default(), &Silent).unwrap();
        for (k, result) in report.results.iter().enumerate() {
            let motion = result.motion.as_ref().unwrap();
            let covariance = motion.covariance.fixed_view::<3, 3>(0, 0).into_owned();
            let square = motion
                .displacement
                .dot(&(covariance.try_inverse().unwrap() * motion.displacement));
            assert!(!motion.loose && square < 16.0, "{k}: {square} {motion:?}");
        }
    }

    #[test]
    fn a_stone_that_is_followed_on_its_own_is_tried_elsewhere_too() {
        let truth = Vector3::new(0.006, 0.013, 0.0);
        let moved = |k| if k == 20 { truth } else { Vector3::zeros() };
        let noise = [0.001; 2];
        let pairs = MemoryPairs::new(wall(5, noise, moved));
        let (mut adjustment, points) = begun(&pairs);
        adjustment.surface.noise.sigma_m = noise;
        let mut error_from = |start: Vector3<f64>| {
            let start = true_motion(&adjustment, 20, start);
            adjustment.stones[20].on_own = Some(CandidateMotion::new(start));
            adjustment.evaluate(&points).unwrap();
            adjustment.probe(&points).unwrap();
            let own = adjustment.stones[20].on_own.as_ref().unwrap().motion;
            (own - true_motion(&adjustment, 20, truth)).translation().norm()
        };
        // Out of the face it is where it went, along the face it is not.
        let error = error_from(Vector3::new(truth.x, 0.0, 0.0));
        assert!(error < 0.005, "{error}");
        assert_eq!(error_from(truth), 0.0);
    }

    #[test]
    fn the_stone_that_went_away_is_followed_on_its_own() {
        let far = Vector3::new(0.0, 0.015, 0.0);
        let moved = |k| if k == 20 { far } else { Vector3::zeros() };
        let noise = [0.005; 2];
        let pairs = MemoryPairs::new(wall(5, noise, moved));
        let (mut adjustment, points) = begun(&pairs);
        for _ in 0..3 {
            adjustment.evaluate(&points).unwrap();
            adjustment.estimate_noise(&points.sample);
        }
        adjustment.evaluate(&points).unwrap();
        adjustment.probe(&points).unwrap();
        let followed: Vec<usize> = (0..adjustment.stones.len())
            .filter(|&i| adjustment.stones[i].on_own.is_some())
            .collect();
        // A noisy stone that stayed may be followed too: that alone does not make it loose.
        assert!(followed.contains(&20) && followed.len() <= 3, "{followed:?}");
        // Newton's steps from there lead to the truth.
        for _ in 0..4 {
            adjustment.evaluate(&points).unwrap();
            let own = adjustment.stones[20].on_own.as_mut().unwrap();
            let e = own.surface.equations().unwrap();
            let step = e.information.cholesky().unwrap().solve(&e.gradient);
            own.motion = own.motion - StoneVector::from(step);
        }
        adjustment.evaluate(&points).unwrap();
        let own = adjustment.stones[20].on_own.as_ref().unwrap().motion;
        let error = own - true_motion(&adjustment, 20, far);
        assert!(error.translation().norm() < 0.004, "{error:?}");
        // Both motions are compared on the same points, and its own is far more likely.
        assert!(
            adjustment.stones[20].log_ratio > 5.0,
            "{:?}",
            adjustment.stones[20].log_ratio
        );
        let other = (0..40).find(|i| !followed.contains(i)).unwrap();
        assert_eq!(adjustment.stones[other].log_ratio, 0.0);
    }
}
