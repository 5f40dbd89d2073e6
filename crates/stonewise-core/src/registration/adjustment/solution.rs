//! Solution of the field, and what follows from it: weights of stones and ties, variance components, cracks.

use super::equations::StoneEquations;
use super::field::{
    Displacement, Field, FieldProblem, FieldStone, FieldVector, LeftOver, PhotoTerms, Prediction, Subgraph,
    VarianceComponents, creeping_zone, estimated_share, find_crack, most_likely_components, posterior,
    probabilities_with_field, reweight_ties, solve,
};
use super::observation::NormalEquations;
use super::partial_view::estimated_rate;
use super::state::{Adjustment, StoneState};
use crate::progress::{Interrupted, Progress};
use crate::switches::switchable;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// Rounds in which weights and field follow each other within an iteration; one for large walls, where each
/// is expensive.
const ROUNDS: usize = 4;
/// A stone whose motion, as a loose stone, stays this uncertain in some direction (as a share of what loose
/// stones are expected to move) has observations too weak to tell it from its neighbours: they took off a
/// quarter of the variance at most.
const UNCERTAIN_SHARE: f64 = 0.85;

/// Share of stones that photos do not find up to which the others determine the variance components: a third
/// less raises their standard deviations by a fifth.
const MOST_UNCONFIRMED: f64 = 1.0 / 3.0;

/// The last iteration's equations and the field that solves them.
pub(crate) struct Solution {
    /// One per stone.
    pub equations: Vec<StoneEquations>,
    pub field: Field,
}

impl Adjustment {
    /// The variance components that the stones' equations show; of large walls, those that parts of it show. Where
    /// zones creep, those of the wall with its zones: how far a zone reaches is not known, and beside it the motion
    /// changes more than far from it.
    ///
    /// # Errors
    /// The caller stopped the work.
    pub fn components_of_wall(&self, progress: &dyn Progress) -> Result<VarianceComponents, Interrupted> {
        if self.keeps_components() {
            return Ok(self.prior.components);
        }
        let equations = self.without_error();
        let problem = self.likelihood(&equations);
        match Subgraph::new(&self.prior.graph, &self.displacements()) {
            None => most_likely_components(&problem, progress),
            Some(part) => most_likely_components(&part.restrict(&problem), progress),
        }
    }

    /// Whether the variance components are kept instead of estimated: once a creeping zone has been found.
    fn keeps_components(&self) -> bool {
        self.prior.zones > 0
    }

    /// Equations of the stones' points for any error in the face.
    pub fn without_error(&self) -> Vec<NormalEquations> {
        let mut equations = match &self.photos {
            None => self.equations_with_field(0.0),
            Some(_) => self.cloud_equations(0.0),
        };
        for i in self.unconfirmed() {
            equations[i] = NormalEquations::nothing();
        }
        equations
    }

    /// The problem whose likelihood determines the variance components; `equations`: as [`Self::without_error`] gives
    /// them.
    pub fn likelihood<'a>(&'a self, equations: &'a [NormalEquations]) -> FieldProblem<'a> {
        let mut problem = self.problem(equations.iter());
        problem.photos = self.photos.as_ref().map(|photos| PhotoTerms {
            stones: (0..self.stones.len())
                .map(|i| {
                    let is_usable = self.stones[i].info.usable;
                    (photos.stone(i).filter(|_| is_usable), self.prior.common_in(i))
                })
                .collect(),
        });
        problem
    }

    /// Stones that photos do not find, where they find most: what their clouds show may be no motion, and a few
    /// of them must not decide how unlike neighbours move.
    fn unconfirmed(&self) -> Vec<usize> {
        let Some(photos) = &self.photos else {
            return Vec::new();
        };
        let usable: Vec<usize> = (0..self.stones.len())
            .filter(|&i| self.stones[i].info.usable)
            .collect();
        let all = usable.len() as f64;
        let lost: Vec<usize> = usable
            .into_iter()
            .filter(|&i| photos.stone(i).is_none())
            .collect();
        if lost.len() as f64 <= MOST_UNCONFIRMED * all {
            lost
        } else {
            Vec::new()
        }
    }

    /// Where the stones are so far. Stones that seem loose count where they went: many of them together are a
    /// bulge.
    fn displacements(&self) -> Vec<Displacement> {
        let stones = self.stones.iter().zip(&self.prior.graph.nodes).enumerate();
        stones
            .map(|(i, (stone, node))| {
                let world = node.face_from_world.transpose();
                let covariance = self.cloud_motion(i, [0.0; 2]).map_or_else(
                    || Matrix3::identity() * self.prior.loose.move_m.powi(2),
                    |clouds| clouds.covariance,
                );
                Displacement {
                    mean: world * stone.more_probable().motion.translation(),
                    covariance: world * covariance * node.face_from_world,
                }
            })
            .collect()
    }

    /// Solves for the field with the present weights. `None` where the equations cannot be factored.
    pub fn solve(&self, equations: &[StoneEquations]) -> Option<Field> {
        solve(&self.problem(equations.iter().map(|e| &e.with_field)))
    }

    /// Solves for the field; probabilities of stones and weights of ties follow from it, and it is solved
    /// again.
    pub fn solve_and_reweight(&mut self, equations: &[StoneEquations]) -> Option<Field> {
        let mut field = self.solve(equations)?;
        let rounds = if Subgraph::is_needed(&self.prior.graph) {
            1
        } else {
            ROUNDS
        };
        for _ in 0..rounds {
            self.reweight_stones(equations, &field);
            let mut components = self.prior.components;
            reweight_ties(
                &self.prior.graph,
                &field,
                self.params.tie_freedom,
                &mut components,
                &self.prior.least,
                &mut self.prior.ties,
            );
            if !self.keeps_components() {
                self.prior.components = components;
            }
            field = self.solve(equations)?;
        }
        Some(field)
    }

    /// Whether the displacements of a field and the probabilities of the stones are finite.
    pub fn is_finite(&self, field: &Field) -> bool {
        let is_finite = |state: &FieldVector| state.displacement().iter().all(|x| x.is_finite());
        field.state.iter().all(is_finite) && self.stones.iter().all(|stone| stone.p_with_field.is_finite())
    }

    /// Parts the wall along its most significant crack; whether there is one.
    ///
    /// The points alone decide: all stones of a side share the errors of their photos' poses, so that no number
    /// of them proves a jump.
    pub fn add_crack(&mut self, solution: &Solution) -> bool {
        switchable!("crack", false);
        let photos = self.photos.as_ref();
        let of_clouds = photos.map(|_| self.cloud_equations(self.prior.components.error_m));
        let problem = match &of_clouds {
            Some(equations) => self.problem(equations.iter()),
            None => self.problem(solution.equations.iter().map(|e| &e.with_field)),
        };
        let Some(crack) = find_crack(&problem, &solution.field, |side| self.smallest_jump_m(side)) else {
            return false;
        };
        self.prior.part_along(crack);
        true
    }

    /// Finds a zone that creeps and lets its motion change as its stones show; whether there is one.
    pub fn loosen_zone(&mut self, solution: &Solution) -> bool {
        switchable!("zone", false);
        let equations = self.without_error();
        let left_over = self.left_over(solution);
        let Some((stones, least)) = creeping_zone(&self.likelihood(&equations), &left_over) else {
            return false;
        };
        for i in stones {
            self.prior.least[i] = self.prior.least[i].larger(&least);
            // Stones that left the field as it was may move with it now.
            self.stones[i].p_with_field = 1.0;
        }
        self.prior.zones += 1;
        true
    }

    /// What the points of each stone show beyond the field.
    fn left_over(&self, solution: &Solution) -> Vec<Option<LeftOver>> {
        let of_clouds = self.cloud_equations(self.prior.components.error_m);
        let shared = self.shared_variances(1.0);
        let own = self.prior.own_variances();
        let noise = Matrix3::from_diagonal(&Vector3::from_fn(|k, _| own[k] + shared[k]));
        let of_stone = |(i, equations): (usize, &NormalEquations)| {
            let frame = self.prior.graph.nodes[i].face_from_world;
            let (information, vector) = equations.of_displacement(&noise);
            let displacement = frame * solution.field.state[i].displacement();
            let vector = vector - information * displacement;
            self.stones[i]
                .info
                .usable
                .then_some(LeftOver { information, vector })
        };
        of_clouds.iter().enumerate().map(of_stone).collect()
    }

    pub(super) fn problem<'a>(
        &'a self,
        equations: impl Iterator<Item = &'a NormalEquations>,
    ) -> FieldProblem<'a> {
        let stones = equations.zip(&self.stones);
        FieldProblem {
            graph: &self.prior.graph,
            stones: stones
                .map(|(equations, stone)| FieldStone {
                    equations,
                    p_with_field: stone.p_with_field,
                })
                .collect(),
            ties: self.prior.ties.clone(),
            least: self.prior.least.clone(),
            components: self.prior.components,
            loose: self.prior.loose,
            photos: None,
        }
    }

    fn reweight_stones(&mut self, equations: &[StoneEquations], field: &Field) {
        let problem = self.problem(equations.iter().map(|e| &e.with_field));
        let on_own: Vec<Option<&NormalEquations>> = equations.iter().map(|e| e.on_own.as_ref()).collect();
        let stones = 0..self.stones.len();
        let shares: Vec<f64> = stones.map(|i| self.leaving_share(i)).collect();
        let shared = self.shared_variances(1.0);
        let probabilities = probabilities_with_field(&problem, &on_own, field, &shared, &shares);
        for (stone, p) in self.stones.iter_mut().zip(probabilities) {
            stone.p_with_field = p;
        }
        self.return_to_field(equations, field);
        let predictions = field.from_others.par_iter().enumerate();
        let doubts: Vec<f64> = predictions
            .map(|(i, prediction)| self.doubt(i, prediction))
            .collect();
        for (stone, doubt) in self.stones.iter_mut().zip(doubts) {
            stone.doubt = doubt;
        }
        let decided = || self.stones.iter().filter(|s| s.decides);
        let wrong = |s: &StoneState| (s.info.hidden, s.p_wrong());
        self.wrong_rate = estimated_rate(decided().map(wrong));
        self.prior.loose.share = estimated_share(self.params.loose_share, decided().map(|s| self.p_loose(s)));
    }

    /// Probability that the clouds are wrong about a stone, if they show it away from its neighbours; none where
    /// its photos show that it left them, too.
    fn doubt(&self, i: usize, prediction: &Prediction) -> f64 {
        let wrong = self.wrong_share(i);
        if wrong == 0.0 || self.photos_show_own_motion(i, prediction) {
            return 0.0;
        }
        wrong / (wrong + self.prior.loose.share)
    }

    /// Returns stones to the field whose points barely constrain their motion: few noisy points have optima far away.
    fn return_to_field(&mut self, equations: &[StoneEquations], field: &Field) {
        let own = self.prior.loose_variances();
        let decides = |(equations, prediction): (&StoneEquations, &Prediction)| {
            let at_optimum = equations.on_own.as_ref().unwrap_or(&equations.with_field);
            let loose = posterior(at_optimum, prediction, &own);
            let covariance = loose.covariance.fixed_view::<3, 3>(0, 0).into_owned();
            let largest_m = covariance.symmetric_eigenvalues().max().sqrt();
            largest_m <= UNCERTAIN_SHARE * self.prior.loose.move_m
        };
        let stones = equations.par_iter().zip(&field.from_others);
        let found: Vec<bool> = stones.map(decides).collect();
        for (stone, decides) in self.stones.iter_mut().zip(found) {
            stone.decides = decides;
            if !decides {
                stone.p_with_field = 1.0;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::observation::photo::{BiasWeights, PhotoModel, PoseInfluence, StonePhotos};
    use super::super::survey::Points;
    use super::super::testing::{COLUMNS, begun, wall};
    use super::*;
    use crate::registration::points::{MemoryPairs, PairSource};
    use nalgebra::Vector3;
    use std::fmt::Debug;

    fn is_right(stone: usize) -> bool {
        stone as u32 % COLUMNS >= COLUMNS / 2
    }

    /// The solution with the weights that follow from it, where the stones are.
    fn solved<S: PairSource<Error: Debug>>(adjustment: &mut Adjustment, points: &Points<S>) -> Solution {
        adjustment.evaluate(points).unwrap();
        let equations = adjustment.equations();
        let field = adjustment.solve_and_reweight(&equations).unwrap();
        Solution { equations, field }
    }

    /// Whether a wall is parted whose right half moved by these by its points and by its photos.
    fn is_parted(by_points: Vector3<f64>, by_photos: Vector3<f64>) -> bool {
        let moved = |k: u32| by_points * f64::from(u8::from(is_right(k as usize)));
        let source = MemoryPairs::new(wall(10, [0.001; 2], moved));
        let (mut adjustment, points) = begun(&source);
        adjustment.estimate_noise(&points.sample);
        for _ in 0..3 {
            let solution = solved(&mut adjustment, &points);
            adjustment.step(&solution);
        }
        // Two tenths of a millimetre in the face, nothing across it.
        let information = Matrix3::from_diagonal(&Vector3::new(2.5e7, 2.5e7, 1.0));
        let shown = |i: usize| StonePhotos {
            information,
            vector: information
                * (adjustment.prior.graph.nodes[i].face_from_world
                    * by_photos
                    * f64::from(u8::from(is_right(i)))),
            place: [0.0; 2],
            bias_factor: 1.0,
            turn: None,
            weights: BiasWeights::USUAL,
            by_poses: PoseInfluence::none(),
        };
        let photos = (0..adjustment.stones.len()).map(shown).collect();
        adjustment.photos = Some(PhotoModel::showing(photos));
        adjustment.prior.components.appearance_m = Some(1e-4);
        let equations = adjustment.equations();
        let field = adjustment.solve(&equations).unwrap();
        adjustment.add_crack(&Solution { equations, field })
    }

    #[test]
    fn points_part_a_wall_and_photos_do_not() {
        let (still, moved) = (Vector3::zeros(), Vector3::new(0.0, 0.008, 0.004));
        assert!(is_parted(moved, moved));
        assert!(!is_parted(still, moved));
    }

    #[test]
    fn probabilities_are_finite_where_the_clouds_are_surely_wrong() {
        let source = MemoryPairs::new(wall(5, [0.001; 2], |_| Vector3::zeros()));
        let (mut adjustment, points) = begun(&source);
        adjustment.estimate_noise(&points.sample);
        adjustment.wrong_rate = 1.0;
        for (stone, hidden) in [(20, 0.99), (21, 1.0)] {
            adjustment.stones[stone].info.hidden = hidden;
            assert_eq!(adjustment.leaving_share(stone), 0.5);
        }
        let solution = solved(&mut adjustment, &points);
        assert!(adjustment.is_finite(&solution.field));
        // Their points show that they move with the field.
        assert!((20..=21).all(|i| adjustment.stones[i].p_with_field > 0.5));
        adjustment.stones[20].p_with_field = f64::NAN;
        assert!(!adjustment.is_finite(&solution.field));
    }

    #[test]
    fn a_stone_of_which_one_epoch_shows_half_is_not_called_loose_by_its_clouds_alone() {
        let moved = Vector3::new(0.0, 0.015, 0.0);
        let motion = |k| moved * f64::from(u8::from(k == 20));
        let source = MemoryPairs::new(wall(5, [0.001; 2], motion));
        let [seen, hidden] = [0.0, 0.5].map(|hidden| {
            let (mut adjustment, points) = begun(&source);
            adjustment.stones[20].info.hidden = hidden;
            adjustment.estimate_noise(&points.sample);
            let mut last = None;
            for _ in 0..8 {
                let solution = solved(&mut adjustment, &points);
                adjustment.step(&solution);
                last = Some(solution);
            }
            let estimate = adjustment.estimate(20, &last.unwrap(), &adjustment.shared_variances(1.0), None);
            let along = estimate.mean + adjustment.prior.common_in(20);
            let sd = estimate.covariance[(0, 0)].sqrt();
            let p_loose = adjustment.p_loose(&adjustment.stones[20]);
            (along.translation().x.abs(), sd, p_loose)
        });
        let (along, sd, p_loose) = seen;
        assert!(
            (along - 0.015).abs() < 5e-4 && sd < 1e-3 && p_loose > 0.95,
            "{seen:?}"
        );
        // A loose stone and clouds at a wrong place are about as probable: the interval holds either.
        let (along, sd, p_loose) = hidden;
        assert!((0.2..0.9).contains(&p_loose), "{hidden:?}");
        assert!(
            (along - 0.015).abs() < 1.96 * sd && along < 1.96 * sd,
            "{hidden:?}"
        );
    }

    #[test]
    fn a_wall_without_loose_stones_lowers_their_share() {
        let source = MemoryPairs::new(wall(10, [0.001; 2], |_| Vector3::zeros()));
        let (mut adjustment, points) = begun(&source);
        adjustment.estimate_noise(&points.sample);
        adjustment.evaluate(&points).unwrap();
        let equations = adjustment.equations();
        adjustment.solve_and_reweight(&equations).unwrap();
        // None of 80 stones is loose, and half a loose stone of 0.5 / 0.03 is what is expected.
        let share = adjustment.prior.loose.share;
        let expected = 0.5 / (0.5 / 0.03 + 80.0);
        assert!((share / expected - 1.0).abs() < 0.02, "{share} {expected}");
    }
}
