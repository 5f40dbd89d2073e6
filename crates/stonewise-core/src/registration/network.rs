//! The stone network adjustment: the motion of every matched stone, all stones together.

use super::equations::{Equations, Layout, LocalPair, Matrix9, Motion9, equations};
use super::field::{self, Beliefs, Field, LoosePrior, Posterior, StoneTerm};
use super::graph::{Graph, Place};
use super::hyper::VarianceComponents;
use super::noise::estimate_noise;
use super::outcome;
use super::pairs::{PairPoints, PairSource};
use super::params::{NetworkParams, NetworkReport};
use super::patch::SurfaceNoise;
use super::sparse::BlockPattern;
use super::survey::{self, Survey, survey};
use crate::progress::{Interrupted, Progress};
use nalgebra::Vector3;
use rayon::prelude::*;

/// Why the adjustment stopped.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AdjustError<E: std::error::Error + 'static> {
    /// A batch of pairs could not be read.
    #[error("cannot read the points of a batch of stones")]
    Source(#[source] E),
    /// The caller stopped the work.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
    /// The equations could not be factored.
    #[error(
        "the equations of {stones} stones could not be solved: not enough memory, or coordinates that are not finite"
    )]
    Unsolvable {
        /// Stones in the network.
        stones: usize,
    },
}

/// Iterations at which the noise of the points is estimated: rough, aligned, final.
const NOISE_AT: [usize; 3] = [0, 2, 4];
/// Iterations at which the variance components are estimated.
const COMPONENTS_AT: [usize; 6] = [0, 1, 2, 3, 5, 7];
/// From here on weights and components stay, so that the iteration settles.
const FIXED_FROM: usize = 10;
/// A stone is evaluated again once it moved by more than this, metres (of its centroid and of its rim).
const REFRESH_M: f64 = 2e-7;

/// The state of the iteration.
pub(super) struct Network {
    pub survey: Survey,
    pub graph: Graph,
    pub pattern: BlockPattern,
    pub noise: SurfaceNoise,
    pub layout: Layout,
    pub components: VarianceComponents,
    pub loose: LoosePrior,
    pub beliefs: Beliefs,
    /// Motion of each stone in its frame.
    pub motions: Vec<Motion9>,
    /// Common translation about which the field is solved, world.
    pub common: Vector3<f64>,
    pub equations: Vec<Equations>,
    evaluated_at: Vec<Option<Motion9>>,
    pub correlation_factor: f64,
}

/// Adjusts all pairs together.
///
/// The stones' own points give each stone normal equations of its motion; a smooth field of motion ties
/// neighbours, with weights estimated from the survey; stones and ties that do not fit are released. World
/// frame, metres. Cost: about ten evaluations of all points and ten sparse factorisations.
pub fn adjust<S: PairSource>(
    source: &S,
    params: &NetworkParams,
    progress: &dyn Progress,
) -> Result<NetworkReport, AdjustError<S::Error>> {
    let survey = survey(source, params)?;
    let mut network = Network::new(survey, params).ok_or(AdjustError::Unsolvable { stones: 0 })?;
    let stones = network.motions.len();
    let unsolvable = AdjustError::Unsolvable { stones };
    let mut iterations = 0;
    let mut converged = stones == 0;
    let mut last = None;
    while !converged && iterations < params.max_iterations {
        progress.begin("adjust", stones as u64);
        if NOISE_AT.contains(&iterations) {
            network.estimate_noise();
        }
        network.evaluate(source, progress)?;
        let terms = network.terms();
        if COMPONENTS_AT.contains(&iterations) {
            network.estimate_components(&terms);
        }
        let Some(field) = network.solve(&terms, iterations < FIXED_FROM, params) else {
            return Err(unsolvable);
        };
        let step = network.step(&terms, &field, params);
        converged = iterations >= FIXED_FROM && step <= params.tolerance_m;
        last = Some((terms, field));
        iterations += 1;
    }
    Ok(outcome::report(&network, last, params, iterations, converged))
}

impl Network {
    fn new(survey: Survey, params: &NetworkParams) -> Option<Self> {
        let places: Vec<Place> = survey.stones.iter().map(|s| s.place.clone()).collect();
        let graph = Graph::new(&places, params.neighbours_per_side);
        let edges: Vec<_> = graph.edges.iter().map(|e| (e.low, e.high)).collect();
        let pattern = BlockPattern::new(places.len(), &edges)?;
        let start = survey.smoothed_shifts(&graph);
        let motions = graph
            .nodes
            .iter()
            .zip(&start)
            .map(|(node, shift)| {
                let mut x = Motion9::zeros();
                x.fixed_rows_mut::<3>(0)
                    .copy_from(&(node.face_from_world * shift));
                x
            })
            .collect();
        let cell_m = (params.cell_spacings * survey.spacing_m).max(params.min_cell_m);
        Some(Self {
            noise: SurfaceNoise {
                sigma_m: [0.003; 2],
                tau_m: 0.001,
            },
            layout: Layout {
                cell_m,
                patch_cells: params.patch_cells,
                outlier_sigmas: params.outlier_sigmas,
            },
            components: VarianceComponents::start(),
            loose: LoosePrior {
                share: params.loose_share,
                move_m: params.loose_move_m,
                turn_rad: params.loose_turn_rad,
            },
            beliefs: Beliefs {
                tight: vec![1.0; places.len()],
                tie: vec![1.0; edges.len()],
            },
            common: survey::middle(&start),
            motions,
            equations: Vec::new(),
            evaluated_at: vec![None; places.len()],
            correlation_factor: 1.0,
            survey,
            graph,
            pattern,
        })
    }

    fn estimate_noise(&mut self) {
        let sample: Vec<(LocalPair, Motion9)> = self
            .survey
            .sample
            .par_iter()
            .map(|(i, pair)| {
                (
                    LocalPair::new(pair, &self.graph.nodes[*i].face_from_world),
                    self.motions[*i],
                )
            })
            .collect();
        let views: Vec<(&LocalPair, Motion9)> = sample.iter().map(|(p, x)| (p, *x)).collect();
        self.noise = estimate_noise(&views, &self.noise, &self.layout);
        self.evaluated_at.fill(None);
    }

    /// Normal equations of all stones that moved since they were last evaluated.
    fn evaluate<S: PairSource>(
        &mut self,
        source: &S,
        progress: &dyn Progress,
    ) -> Result<(), AdjustError<S::Error>> {
        let mut start = 0;
        for batch in 0..source.batch_count() {
            progress.check()?;
            let count = self.survey.batch_sizes[batch];
            let due: Vec<bool> = (start..start + count).map(|i| self.is_due(i)).collect();
            if due.contains(&true) {
                let pairs = source.load(batch).map_err(AdjustError::Source)?;
                let new: Vec<Option<Equations>> = pairs
                    .par_iter()
                    .enumerate()
                    .map(|(k, pair)| due[k].then(|| self.evaluate_one(start + k, pair)))
                    .collect();
                for (k, value) in new.into_iter().enumerate() {
                    if let Some(value) = value {
                        self.evaluated_at[start + k] = Some(self.motions[start + k]);
                        if self.equations.len() <= start + k {
                            self.equations.push(value);
                        } else {
                            self.equations[start + k] = value;
                        }
                    }
                }
            }
            progress.advance(count as u64);
            start += count;
        }
        let mut differences: Vec<f64> = self
            .equations
            .iter()
            .flat_map(|e| e.differences.iter().copied())
            .collect();
        self.correlation_factor = survey::chi_square_inflation(&mut differences);
        Ok(())
    }

    fn is_due(&self, i: usize) -> bool {
        self.evaluated_at[i].is_none_or(|x| {
            let d = x - self.motions[i];
            let rim = 0.2;
            d.fixed_rows::<3>(0).norm()
                + rim * d.fixed_rows::<3>(3).norm()
                + rim * rim * d.fixed_rows::<3>(6).norm()
                > REFRESH_M
        })
    }

    fn evaluate_one(&self, i: usize, pair: &PairPoints) -> Equations {
        let local = LocalPair::new(pair, &self.graph.nodes[i].face_from_world);
        equations(&local, &self.motions[i], &self.noise, &self.layout)
    }

    /// Normal equations about the common translation, with correlation between points accounted for.
    fn terms(&self) -> Vec<StoneTerm> {
        self.equations
            .iter()
            .enumerate()
            .map(|(i, e)| {
                if !self.survey.stones[i].usable {
                    return StoneTerm {
                        information: Matrix9::zeros(),
                        vector: Motion9::zeros(),
                    };
                }
                let at = self.evaluated_at[i].unwrap_or(self.motions[i]) - self.common_in(i);
                StoneTerm {
                    information: e.information / self.correlation_factor,
                    vector: (e.information * at - e.gradient) / self.correlation_factor,
                }
            })
            .collect()
    }

    /// The common translation in a stone's frame.
    pub fn common_in(&self, i: usize) -> Motion9 {
        let mut x = Motion9::zeros();
        x.fixed_rows_mut::<3>(0)
            .copy_from(&(self.graph.nodes[i].face_from_world * self.common));
        x
    }

    fn estimate_components(&mut self, terms: &[StoneTerm]) {
        self.components = field::estimate_components(
            &self.graph,
            &self.pattern,
            terms,
            &self.components,
            &self.loose,
            &self.beliefs,
        );
    }

    /// Solves for the field; where `learn`, beliefs about stones and ties follow, and it is solved again.
    fn solve(&mut self, terms: &[StoneTerm], learn: bool, params: &NetworkParams) -> Option<Field> {
        let solve = |n: &Self| field::solve(&n.graph, &n.pattern, terms, &n.components, &n.loose, &n.beliefs);
        let mut field = solve(self)?;
        if learn {
            for _ in 0..2 {
                self.beliefs.tight = field::tight_probability(terms, &field, &self.components, &self.loose);
                let nu = params.tie_freedom;
                self.beliefs.tie = field::tie_strain(&self.graph, &field, &self.components)
                    .iter()
                    .map(|s| ((nu + 9.0) / (nu + s)).min(1.0))
                    .collect();
                field = solve(self)?;
            }
        }
        Some(field)
    }

    /// Moves every stone to its posterior mean; the largest step, metres.
    fn step(&mut self, terms: &[StoneTerm], field: &Field, params: &NetworkParams) -> f64 {
        let mut largest: f64 = 0.0;
        for i in 0..terms.len() {
            let mean = self.posterior(i, &terms[i], field).mean + self.common_in(i);
            let mut step = mean - self.motions[i];
            let length = step.fixed_rows::<3>(0).norm();
            if length > params.max_step_m {
                step *= params.max_step_m / length;
            }
            largest = largest.max(length);
            self.motions[i] += step;
        }
        largest
    }

    /// Posterior of a stone about the common translation, its looseness averaged out of the mean.
    pub fn posterior(&self, i: usize, term: &StoneTerm, field: &Field) -> Posterior {
        let p = self.beliefs.tight[i];
        let prediction = &field.from_others[i];
        let tight = field::posterior(term, prediction, &self.components.own_variances());
        let free = field::posterior(
            term,
            prediction,
            &field::loose_variances(&self.components, &self.loose),
        );
        let mean = tight.mean * p + free.mean * (1.0 - p);
        Posterior {
            mean,
            covariance: if p > 0.5 {
                tight.covariance
            } else {
                free.covariance
            },
            ..tight
        }
    }
}
