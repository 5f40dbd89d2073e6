//! The stone network adjustment: the motion of every matched stone, all stones together.

use super::breaks::{BreakLine, find_line};
use super::correlation::{Correlation, shared_variance, stone_factor, stone_slope_factor};
use super::discount::discounted;
use super::equations::{Equations, Layout, LocalPair, Matrix9, Motion9, equations};
use super::excerpt::Excerpt;
use super::field::{self, Beliefs, Field, LoosePrior, Posterior, StoneTerm};
use super::graph::{Graph, Place};
use super::hyper::VarianceComponents;
use super::noise::estimate_noise;
use super::outcome;
use super::pairs::{PairPoints, PairSource};
use super::params::{NetworkParams, NetworkReport};
use super::patch::SurfaceNoise;
use super::rivals::{Comparison, Rivals};
use super::sparse::BlockPattern;
use super::survey::{self, Survey, survey};
use super::track::Track;
use crate::geometry::Bounds;
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
/// Iteration at which stones are probed for motions of their own, once noise and field are about right.
const PROBED_AT: usize = 4;
/// Directions in the face in which a stone is probed.
const PROBES: usize = 8;
/// Iterations at which the variance components are estimated.
const COMPONENTS_AT: [usize; 6] = [0, 1, 2, 3, 5, 7];
/// From here on weights and components stay, so that the iteration settles.
const FIXED_FROM: usize = 10;
/// Where the iteration goes on after a break was found.
const RESUME_AT: usize = 5;
/// Most breaks of the whole wall that are sought.
const MAX_LINES: usize = 8;
/// One stone in so many may still swing between two optima of its own when the network has settled.
const RESTLESS: usize = 50;
/// Lever by which an error shared by half a stone turns it, metres.
const HALF_STONE_M: f64 = 0.1;
/// Rounds of learning beliefs from the field in an iteration; one in a large network, where each is dear.
const LEARN_STEPS: usize = 4;
/// A stone is probed if its points leave its motion in the face less certain than this share of what loose stones move.
const OPEN_SHARE: f64 = 0.1;
/// A stone's own optimum is followed once its points make it so many times more probably loose than it was without them.
const SUSPECT: f64 = 1.5;
/// A stone is evaluated again once its equations, which are those of another motion, may be wrong by this, metres.
const LINEAR_M: f64 = 1e-8;
/// A step within this share of its standard deviation no longer matters.
const SETTLED: f64 = 0.01;
/// A stone whose motion, as a loose stone, stays this uncertain in some direction (as a share of what is known of loose
/// stones beforehand) has learnt too little from its points to be told from its neighbours.
const BLIND_SHARE: f64 = 0.85;

/// The state of the iteration.
pub(super) struct Network {
    pub survey: Survey,
    pub graph: Graph,
    pub pattern: BlockPattern,
    /// The part of a large network on which the variance components are estimated.
    excerpt: Option<Excerpt>,
    pub noise: SurfaceNoise,
    pub layout: Layout,
    pub components: VarianceComponents,
    pub loose: LoosePrior,
    pub beliefs: Beliefs,
    /// Lines along which the wall is broken.
    pub lines: Vec<BreakLine>,
    /// Each stone moving with the field.
    pub tight: Vec<Track>,
    /// Each stone that may have moved on its own, doing so: its likelihood has several maxima, and what it says
    /// at one must not be read off at another.
    pub free: Vec<Option<Track>>,
    /// What the points of each stone that is followed on its own say between the two.
    comparisons: Vec<Comparison>,
    /// Common translation about which the field is solved, world.
    pub common: Vector3<f64>,
    pub correlation: Correlation,
    /// How many unknowns each stone's own points determine.
    determined: Vec<f64>,
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
    let stones = network.tight.len();
    let unsolvable = AdjustError::Unsolvable { stones };
    let (mut stage, mut iterations, mut allowed) = (0, 0, params.max_iterations);
    let mut converged = stones == 0;
    let mut last = None;
    while !converged && iterations < allowed {
        progress.begin("adjust", stones as u64);
        if iterations == stage && NOISE_AT.contains(&stage) {
            network.estimate_noise();
        }
        network.evaluate(source, progress)?;
        if iterations == PROBED_AT {
            network.probe(source, params, progress)?;
        }
        if COMPONENTS_AT.contains(&stage) {
            network.estimate_components();
        }
        let terms = network.terms();
        let Some(field) = network.solve(&terms, stage < FIXED_FROM, params) else {
            return Err(unsolvable);
        };
        let settled = network.step(&terms, &field, params);
        converged = stage >= FIXED_FROM && settled;
        stage += 1;
        iterations += 1;
        if converged && network.lines.len() < MAX_LINES && network.part(&terms, &field) {
            converged = false;
            stage = RESUME_AT;
            allowed = iterations + params.max_iterations;
        }
        last = Some((terms, field));
    }
    Ok(outcome::report(&network, last, params, iterations, converged))
}

/// The stones' equations: moving with the field, and on their own where that is followed.
pub(super) struct Terms {
    pub tight: Vec<StoneTerm>,
    pub free: Vec<Option<StoneTerm>>,
}

/// What a stone's points say where it moved since the last evaluation.
struct Evaluation {
    tight: Option<Equations>,
    free: Option<Equations>,
    comparison: Option<Comparison>,
}

/// A stone's motion with its looseness averaged out.
pub(super) struct Estimate {
    /// In the stone's frame, about the common translation.
    pub mean: Motion9,
    pub covariance: Matrix9,
}

impl Network {
    fn new(survey: Survey, params: &NetworkParams) -> Option<Self> {
        let places: Vec<Place> = survey.stones.iter().map(|s| s.place.clone()).collect();
        let graph = Graph::new(&places, params.neighbours_per_side);
        let edges: Vec<_> = graph.edges.iter().map(|e| (e.low, e.high)).collect();
        let pattern = BlockPattern::new(places.len(), &edges)?;
        let excerpt = Excerpt::new(&graph);
        let start = survey.smoothed_shifts(&graph);
        let tight: Vec<Track> = graph
            .nodes
            .iter()
            .zip(&start)
            .map(|(node, shift)| {
                let mut x = Motion9::zeros();
                x.fixed_rows_mut::<3>(0)
                    .copy_from(&(node.face_from_world * shift));
                Track::new(x)
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
                parted: vec![false; edges.len()],
            },
            lines: Vec::new(),
            common: survey::middle(&start),
            free: vec![None; tight.len()],
            comparisons: vec![Comparison::default(); tight.len()],
            tight,
            correlation: Correlation::NONE,
            determined: vec![0.0; places.len()],
            survey,
            graph,
            pattern,
            excerpt,
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
                    self.tight[*i].motion,
                )
            })
            .collect();
        let views: Vec<(&LocalPair, Motion9)> = sample.iter().map(|(p, x)| (p, *x)).collect();
        self.noise = estimate_noise(&views, &self.noise, &self.layout);
        self.tight.iter_mut().for_each(Track::invalidate);
        self.free.iter_mut().flatten().for_each(Track::invalidate);
    }

    /// Normal equations of all stones that moved since they were last evaluated.
    fn evaluate<S: PairSource>(
        &mut self,
        source: &S,
        progress: &dyn Progress,
    ) -> Result<(), AdjustError<S::Error>> {
        for (batch, range) in self.survey.batches.clone().into_iter().enumerate() {
            progress.check()?;
            let count = range.len();
            let tracks = || range.clone().map(|i| (&self.tight[i], self.free[i].as_ref()));
            if tracks().any(|(tight, free)| self.is_due(tight) || free.is_some_and(|f| self.is_due(f))) {
                let pairs = source.load(batch).map_err(AdjustError::Source)?;
                let new: Vec<Option<Evaluation>> = pairs
                    .par_iter()
                    .zip(range.clone())
                    .map(|(pair, i)| self.evaluate_one(i, pair))
                    .collect();
                for (new, i) in new.into_iter().zip(range) {
                    let Some(Evaluation {
                        tight,
                        free,
                        comparison,
                    }) = new
                    else {
                        continue;
                    };
                    self.comparisons[i] = comparison.unwrap_or_default();
                    if let Some(tight) = tight {
                        self.tight[i].set(tight);
                    }
                    if let (Some(free), Some(track)) = (free, &mut self.free[i]) {
                        track.set(free);
                    }
                }
            }
            progress.advance(count as u64);
        }
        let known: Vec<(&Equations, f64)> = (0..self.tight.len())
            .filter_map(|i| Some((self.tight[i].equations()?, self.determined[i])))
            .collect();
        self.correlation = Correlation::of(&known);
        Ok(())
    }

    /// What changed at a stone; `None` if nothing did.
    fn evaluate_one(&self, i: usize, pair: &PairPoints) -> Option<Evaluation> {
        let (tight, free) = (&self.tight[i], self.free[i].as_ref());
        if !self.is_due(tight) && !free.is_some_and(|t| self.is_due(t)) {
            return None;
        }
        let local = LocalPair::new(pair, &self.graph.nodes[i].face_from_world);
        let anew = |t: &Track| equations(&local, &t.motion, &t.window(), &self.noise, &self.layout);
        let compare = |free: &Track| {
            let rivals = Rivals {
                pair: &local,
                tight,
                free,
                noise: &self.noise,
                layout: &self.layout,
            };
            rivals.compare(self.inflation(i))
        };
        Some(Evaluation {
            tight: Some(tight).filter(|t| self.is_due(t)).map(anew),
            free: free.filter(|t| self.is_due(t)).map(anew),
            comparison: free.map(compare),
        })
    }

    /// Whether a track's equations no longer hold where it is: they are quadratic, and their error grows with the square of the
    /// distance, in units of the surface's cells.
    fn is_due(&self, track: &Track) -> bool {
        track.is_due((LINEAR_M * self.layout.cell_m).sqrt())
    }

    /// Looks for optima far from the field's motion: a noisy stone that moved by more than the reach of its relief does not show at
    /// the field's motion where it went. Each stone is tried at the loose stones' typical distance; the best place is followed.
    ///
    /// Only stones whose points leave their motion in the face that open. Cost: [`PROBES`] evaluations of these.
    fn probe<S: PairSource>(
        &mut self,
        source: &S,
        params: &NetworkParams,
        progress: &dyn Progress,
    ) -> Result<(), AdjustError<S::Error>> {
        for (batch, range) in self.survey.batches.clone().into_iter().enumerate() {
            progress.check()?;
            if range.clone().any(|i| self.is_open(i, params)) {
                let pairs = source.load(batch).map_err(AdjustError::Source)?;
                let found: Vec<(usize, Option<Motion9>)> = pairs
                    .par_iter()
                    .zip(range)
                    .filter(|(_, i)| self.is_open(*i, params))
                    .map(|(pair, i)| (i, self.probe_one(i, pair, params)))
                    .collect();
                for (i, place) in found {
                    self.free[i] = place.map(Track::new);
                }
            }
        }
        Ok(())
    }

    /// Whether a stone's points alone leave its motion in the face uncertain by a share of what loose stones move.
    fn is_open(&self, i: usize, params: &NetworkParams) -> bool {
        let Some(e) = self.tight[i].equations().filter(|_| self.free[i].is_none()) else {
            return false;
        };
        let least = params.loose_move_m.powi(-2);
        let known = e
            .information
            .fixed_view::<2, 2>(0, 0)
            .symmetric_eigenvalues()
            .min()
            / self.inflation(i);
        self.survey.stones[i].usable && known > least && known < least * OPEN_SHARE.powi(-2)
    }

    /// The place, of those tried, where the stone's points, those that count where it is, are best explained after one more step; `None`
    /// if that is where it is.
    fn probe_one(&self, i: usize, pair: &PairPoints, params: &NetworkParams) -> Option<Motion9> {
        let local = LocalPair::new(pair, &self.graph.nodes[i].face_from_world);
        let (here, window) = (self.tight[i].motion, self.tight[i].window());
        let expected = |e: &Equations| {
            let held = e.information + Matrix9::identity() * self.inflation(i) / params.loose_move_m.powi(2);
            held.cholesky().map_or(f64::INFINITY, |c| {
                e.deviance - e.gradient.dot(&c.solve(&e.gradient))
            })
        };
        let mut best = (expected(self.tight[i].equations()?), None);
        for k in 0..PROBES {
            let (s, c) = (std::f64::consts::TAU * k as f64 / PROBES as f64).sin_cos();
            let mut place = here;
            place[0] += params.loose_move_m * c;
            place[1] += params.loose_move_m * s;
            let value = expected(&equations(&local, &place, &window, &self.noise, &self.layout));
            if value < best.0 {
                best = (value, Some(place));
            }
        }
        best.1
    }

    /// Equations about the common translation, with correlation between points accounted for.
    fn terms(&self) -> Terms {
        self.terms_with(self.components.error_m)
    }

    /// The same for another error of the motions in the face.
    fn terms_with(&self, error_m: f64) -> Terms {
        let term = |i: usize, track: &Track| match self.survey.stones[i].usable {
            true => {
                let inflation = self.inflation(i);
                let inside = self.inflation_inside(i) / inflation;
                discounted(track.term(&self.common_in(i), inflation), inside, error_m)
            }
            false => StoneTerm::nothing(),
        };
        Terms {
            tight: self.tight.iter().enumerate().map(|(i, t)| term(i, t)).collect(),
            free: self
                .free
                .iter()
                .enumerate()
                .map(|(i, t)| t.as_ref().map(|t| self.compared(i, term(i, t))))
                .collect(),
        }
    }

    /// The term of a stone on its own, with the likelihood that it has against the field's motion on the same points.
    fn compared(&self, i: usize, mut term: StoneTerm) -> StoneTerm {
        let free = self.free[i].as_ref().and_then(Track::equations);
        if let (Some(tight), Some(free)) = (self.tight[i].equations(), free) {
            let on_its_own_points = 0.5 * (tight.deviance - free.deviance);
            term.constant += (self.comparisons[i].advantage - on_its_own_points) / self.inflation(i);
        }
        term
    }

    /// Variances of errors that all points of a stone share, beyond what its own cells show: translation, rotation. `octaves` of
    /// length, from the size of a stone up: one against its neighbours, [`Self::octaves`] against another epoch.
    pub fn shared_variances(&self, octaves: f64, params: &NetworkParams) -> [f64; 9] {
        let known: Vec<&Equations> = self.tight.iter().filter_map(Track::equations).collect();
        let shared = shared_variance(&known, &self.correlation);
        let noise = self.noise.sigma_m;
        let bias = params.systematic_share.powi(2) * 0.5 * (noise[0].powi(2) + noise[1].powi(2));
        let turn = shared / (HALF_STONE_M * HALF_STONE_M);
        let shift = octaves * shared;
        [shift, shift, shift + bias, turn, turn, turn, 0.0, 0.0, 0.0]
    }

    /// Octaves of length between a stone and the wall, at least one.
    pub fn octaves(&self) -> f64 {
        let places = self.graph.nodes.iter().map(|n| n.centroid);
        let extent_m = Bounds::of(places).map_or(0.0, |b| (b.max - b.min).norm());
        let mut lengths: Vec<f64> = self.graph.edges.iter().map(|e| e.length_m).collect();
        let step_m = survey::median(&mut lengths).unwrap_or(extent_m);
        (extent_m / step_m.max(1e-3)).log2().max(0.0) + 1.0
    }

    /// Factor on a stone's variances.
    fn inflation(&self, i: usize) -> f64 {
        let survey = self.correlation.factor();
        survey * self.at_better(i, |e| stone_factor(e, self.determined[i], survey))
    }

    /// Factor on the variances of a stone's motion in the face, where that is larger.
    fn inflation_inside(&self, i: usize) -> f64 {
        self.at_better(i, |e| stone_slope_factor(e, self.correlation.slopes))
    }

    /// The least of a figure at a stone's motions: the worse one need not be right.
    fn at_better(&self, i: usize, figure: impl Fn(&Equations) -> f64) -> f64 {
        let least = [Some(&self.tight[i]), self.free[i].as_ref()]
            .into_iter()
            .flatten()
            .filter_map(Track::equations)
            .map(figure)
            .fold(f64::INFINITY, f64::min);
        if least.is_finite() { least } else { 1.0 }
    }

    /// The common translation in a stone's frame.
    pub fn common_in(&self, i: usize) -> Motion9 {
        let mut x = Motion9::zeros();
        x.fixed_rows_mut::<3>(0)
            .copy_from(&(self.graph.nodes[i].face_from_world * self.common));
        x
    }

    fn estimate_components(&mut self) {
        let terms = self.terms_with(0.0);
        self.components = match &self.excerpt {
            None => field::estimate_components(
                &self.graph,
                &self.pattern,
                &terms.tight,
                &self.components,
                &self.loose,
                &self.beliefs,
            ),
            Some(part) => field::estimate_components(
                &part.graph,
                &part.pattern,
                &part
                    .stones
                    .iter()
                    .map(|&i| terms.tight[i].clone())
                    .collect::<Vec<_>>(),
                &self.components,
                &self.loose,
                &Beliefs {
                    tight: part.stones.iter().map(|&i| self.beliefs.tight[i]).collect(),
                    tie: part.edges.iter().map(|&e| self.beliefs.tie[e]).collect(),
                    parted: part.edges.iter().map(|&e| self.beliefs.parted[e]).collect(),
                },
            ),
        };
    }

    /// Solves for the field; where `learn`, beliefs about stones and ties follow, and it is solved again.
    fn solve(&mut self, terms: &Terms, learn: bool, params: &NetworkParams) -> Option<Field> {
        let solve = |n: &Self| {
            field::solve(
                &n.graph,
                &n.pattern,
                &terms.tight,
                &n.components,
                &n.loose,
                &n.beliefs,
            )
        };
        let mut field = solve(self)?;
        if learn {
            let steps = if self.excerpt.is_some() { 1 } else { LEARN_STEPS };
            for _ in 0..steps {
                self.beliefs.tight = field::tight_probability(
                    &terms.tight,
                    &terms.free,
                    &field,
                    &self.components,
                    &self.loose,
                    &self.shared_variances(1.0, params),
                );
                self.disbelieve(terms, &field);
                field::learn_ties(
                    &self.graph,
                    &field,
                    &mut self.components,
                    &mut self.beliefs,
                    params.tie_freedom,
                );
                field = solve(self)?;
            }
        }
        Some(field)
    }

    /// Parts the wall along its most significant line; whether there is one.
    fn part(&mut self, terms: &Terms, field: &Field) -> bool {
        let test = |sides: &[Vec<bool>]| {
            field::test_jumps(
                &self.graph,
                &self.pattern,
                &terms.tight,
                &self.components,
                &self.loose,
                &self.beliefs,
                sides,
            )
        };
        let Some(line) = find_line(&self.graph, field, &self.beliefs.parted, test) else {
            return false;
        };
        for (parted, edge) in self.beliefs.parted.iter_mut().zip(&self.graph.edges) {
            *parted |= line.side[edge.low] != line.side[edge.high];
        }
        self.lines.push(line);
        true
    }

    /// Lets stones move with the field whose own optimum means nothing: those whose points hardly know their motion (few noisy points
    /// have optima far away), and those of which one half speaks against it.
    fn disbelieve(&mut self, terms: &Terms, field: &Field) {
        let wide = field::loose_variances(&self.components, &self.loose);
        for i in 0..self.tight.len() {
            let term = terms.free[i].as_ref().unwrap_or(&terms.tight[i]);
            let own = field::posterior(term, &field.from_others[i], &wide);
            let known = own.covariance.fixed_view::<3, 3>(0, 0).into_owned();
            let is_blind = known.symmetric_eigenvalues().max().sqrt() > BLIND_SHARE * self.loose.move_m;
            if is_blind || self.comparisons[i].contradicted {
                self.beliefs.tight[i] = 1.0;
            }
        }
    }

    /// Moves every stone to its posterior mean; whether the network has settled.
    fn step(&mut self, terms: &Terms, field: &Field, params: &NetworkParams) -> bool {
        let mut restless = 0;
        // What passes for an error might be the start of a motion: the equations follow it, so that a loose stone shows itself.
        let followed = self.terms_with(0.0);
        let own = self.components.own_and_error_variances();
        let wide = field::loose_variances(&self.components, &self.loose);
        for i in 0..self.tight.len() {
            let origin = self.common_in(i);
            let p = self.beliefs.tight[i];
            // A motion that is hardly believed moves the stone's estimate by its share only.
            let mut follow = |track: &mut Track, posterior: &Posterior, belief: f64| {
                let step = track.move_to(&(posterior.mean + origin), params.max_step_m);
                let sd = posterior.covariance.fixed_view::<3, 3>(0, 0).trace().sqrt();
                restless += usize::from(belief * step > params.tolerance_m.max(SETTLED * sd));
            };
            let prediction = &field.from_others[i];
            let tight = field::posterior(&followed.tight[i], prediction, &own);
            self.determined[i] = tight.determined;
            follow(&mut self.tight[i], &tight, p);
            if let (Some(track), Some(term)) = (&mut self.free[i], &terms.free[i]) {
                follow(track, &field::posterior(term, prediction, &wide), 1.0 - p);
            } else if 1.0 - self.beliefs.tight[i] > SUSPECT * self.loose.share {
                let start = field::posterior(&terms.tight[i], prediction, &wide).mean + origin;
                let mut track = Track::new(self.tight[i].motion);
                track.move_to(&start, params.max_step_m);
                self.free[i] = Some(track);
                restless += 1;
            }
        }
        restless * RESTLESS <= self.tight.len()
    }

    /// A stone's motion about the common translation, looseness averaged out.
    pub fn estimate(&self, i: usize, terms: &Terms, field: &Field) -> Estimate {
        let p = self.beliefs.tight[i];
        let prediction = &field.from_others[i];
        let mut tight = field::posterior(&terms.tight[i], prediction, &self.components.own_variances());
        // What is taken for an error might be a motion after all.
        for k in 0..2 {
            tight.covariance[(k, k)] += self.components.error_m * self.components.error_m;
        }
        let Some(free) = &terms.free[i] else {
            return Estimate {
                mean: tight.mean,
                covariance: tight.covariance,
            };
        };
        let free = field::posterior(
            free,
            prediction,
            &field::loose_variances(&self.components, &self.loose),
        );
        let apart = tight.mean - free.mean;
        Estimate {
            mean: tight.mean * p + free.mean * (1.0 - p),
            covariance: tight.covariance * p
                + free.covariance * (1.0 - p)
                + apart * apart.transpose() * (p * (1.0 - p)),
        }
    }
}
