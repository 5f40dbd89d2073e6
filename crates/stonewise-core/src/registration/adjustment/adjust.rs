//! The adjustment of all stones together: the motion of every matched stone.

use super::error::AdjustError;
use super::outcome;
use super::params::{AdjustmentParams, AdjustmentReport};
use super::solution::Solution;
use super::state::Adjustment;
use super::survey::survey;
use crate::progress::Progress;
use crate::registration::photos::PhotoSource;
use crate::registration::points::PairSource;

/// Iterations of the alignment: the first two bring stones within reach of their relief, the others let noise
/// and variance components follow.
const ALIGNMENTS: usize = 4;
/// The noise is estimated in every second iteration of the alignment: it costs as much as an evaluation, and
/// changes by a percent in between.
const NOISE_EVERY: usize = 2;
/// Iterations in which the weights of stones and ties settle, and in which of them the variance components
/// are estimated once more: an estimate moves the weights, which need an iteration to follow.
const REWEIGHTINGS: usize = 5;
const COMPONENTS_IN: [usize; 2] = [0, 2];
/// Most cracks of the whole wall that are sought; each costs another adjustment.
const MAX_CRACKS: usize = 8;

/// Adjusts all pairs together.
///
/// The stones' own points give each stone normal equations of its motion; a smooth field of motion ties
/// neighbours, with weights estimated from the survey; stones and ties that do not fit are released. World
/// frame, metres.
///
/// align -> probe -> estimate variance components -> freeze -> cracks (and again) -> report.
///
/// Cost: about ten evaluations of all points and ten sparse factorisations.
///
/// ```
/// use nalgebra::{Point3, Vector3};
/// use stonewise_core::registration::{AdjustmentParams, MemoryPairs, PairPoints, adjust};
/// use stonewise_core::{cloud::Cloud, id::StoneId, progress::Silent};
///
/// // Twelve stones with wavy faces in the plane x = 0, which move by (1, 3, -2) mm.
/// let moved = Vector3::new(0.001, 0.003, -0.002);
/// let pair = |k: u32| {
///     let centroid = Point3::new(0.0, 0.3 * f64::from(k % 4), 0.2 * f64::from(k / 4));
///     let scan = |start: f64, by: Vector3<f64>| {
///         let point = |i: u32| {
///             let (y, z) = ((start + 0.618034 * f64::from(i)).fract(), (start + 0.754878 * f64::from(i)).fract());
///             let (y, z) = (0.2 * y - 0.1, 0.16 * z - 0.08);
///             let noise = 0.002 * ((start + 0.414214 * f64::from(i)).fract() - 0.5);
///             let relief = 0.004 * ((50.0 * y).sin() + (43.0 * z).cos());
///             centroid + Vector3::new(relief + noise, y, z) + by
///         };
///         Cloud::from_world(centroid, (0..600).map(point))
///     };
///     PairPoints {
///         first: StoneId(k),
///         second: StoneId(k),
///         centroid,
///         centroid_second: centroid + moved,
///         normal: Vector3::x(),
///         points_first: scan(0.0, Vector3::zeros()),
///         points_second: scan(0.3, moved),
///         nearby_second: Cloud::new(centroid, Vec::new()),
///         window: None,
///     }
/// };
/// let pairs = MemoryPairs::new((1..=12).map(pair).collect());
/// let report = adjust(&pairs, &AdjustmentParams::default(), &Silent)?;
/// assert!((report.common_motion - moved).norm() < 3e-4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// A batch cannot be read, the caller stopped the work, or the equations cannot be factored.
pub fn adjust<S: PairSource>(
    source: &S,
    params: &AdjustmentParams,
    progress: &dyn Progress,
) -> Result<AdjustmentReport, AdjustError<S::Error>> {
    adjust_with_photos(source, None, params, progress)
}

/// The same with photos, where there are any: once the clouds have brought the stones about where they are,
/// each is tracked from photo to photo, and what the photos show joins what the points show.
///
/// # Errors
/// As [`adjust`], and where parts of photos cannot be read.
pub fn adjust_with_photos<S: PairSource>(
    source: &S,
    photos: Option<&dyn PhotoSource<S::Error>>,
    params: &AdjustmentParams,
    progress: &dyn Progress,
) -> Result<AdjustmentReport, AdjustError<S::Error>> {
    let survey = survey(source, params, progress)?;
    let stones = survey.stones.len();
    let adjustment = Adjustment::new(survey, params).ok_or(AdjustError::Unsolvable { stones })?;
    let mut run = Run {
        adjustment,
        source,
        progress,
        iterations: 0,
        allowed: params.max_iterations,
        last: None,
    };
    let mut settled = stones == 0;
    if !settled {
        run.align()?;
        run.probe()?;
        if let Some(photos) = photos {
            run.adjustment.track(source, photos, progress)?;
        }
        loop {
            run.estimate_variance_components()?;
            settled = run.settle()?;
            if !(settled && run.find_crack()) {
                break;
            }
        }
    }
    Ok(outcome::report(
        &run.adjustment,
        run.last.as_ref(),
        run.iterations,
        settled,
    ))
}

/// An adjustment under way.
struct Run<'a, S: PairSource> {
    adjustment: Adjustment,
    source: &'a S,
    progress: &'a dyn Progress,
    iterations: usize,
    /// Most iterations; each crack that is found adds as many again. A phase that has none left does nothing.
    allowed: usize,
    last: Option<Solution>,
}

impl<S: PairSource> Run<'_, S> {
    /// Brings the stones onto each other, while noise and variance components become about right.
    fn align(&mut self) -> Result<(), AdjustError<S::Error>> {
        for round in 0..ALIGNMENTS {
            if !self.begins() {
                break;
            }
            if round % NOISE_EVERY == 0 {
                self.adjustment.estimate_noise();
            }
            self.adjustment.evaluate(self.source, self.progress)?;
            self.adjustment.estimate_components(self.progress)?;
            self.solve_and_reweight()?;
        }
        Ok(())
    }

    /// Estimates the noise for good, and tries stones far from the field's motion.
    fn probe(&mut self) -> Result<(), AdjustError<S::Error>> {
        if self.begins() {
            self.adjustment.estimate_noise();
            self.adjustment.evaluate(self.source, self.progress)?;
            self.adjustment.probe(self.source, self.progress)?;
            self.solve_and_reweight()?;
        }
        Ok(())
    }

    /// Estimates the variance components; the weights of stones and ties follow.
    fn estimate_variance_components(&mut self) -> Result<(), AdjustError<S::Error>> {
        for round in 0..REWEIGHTINGS {
            if !self.begins() {
                break;
            }
            self.adjustment.evaluate(self.source, self.progress)?;
            self.adjustment.update_photos(self.last.as_ref());
            if COMPONENTS_IN.contains(&round) {
                self.adjustment.estimate_components(self.progress)?;
            }
            self.solve_and_reweight()?;
        }
        Ok(())
    }

    /// Iterates with frozen weights and components until no stone moves; whether they came to rest.
    fn settle(&mut self) -> Result<bool, AdjustError<S::Error>> {
        self.adjustment.forget_swings();
        while self.begins() {
            self.adjustment.evaluate(self.source, self.progress)?;
            let equations = self.adjustment.equations();
            let field = self
                .adjustment
                .solve(&equations)
                .ok_or_else(|| self.unsolvable())?;
            if self.step(Solution { equations, field }) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Parts the wall along its most significant crack; whether there is one.
    fn find_crack(&mut self) -> bool {
        let is_open = self.adjustment.cracks.len() < MAX_CRACKS;
        let last = self.last.as_ref().filter(|_| is_open);
        let found = last.is_some_and(|solution| self.adjustment.add_crack(solution));
        if found {
            self.allowed = self.iterations + self.adjustment.params.max_iterations;
        }
        found
    }

    /// Begins an iteration; `false` once none is left.
    fn begins(&mut self) -> bool {
        let is_left = self.iterations < self.allowed;
        if is_left {
            self.iterations += 1;
            let stones = self.adjustment.stones.len() as u64;
            self.progress
                .begin(&format!("iteration {}", self.iterations), stones);
        }
        is_left
    }

    fn solve_and_reweight(&mut self) -> Result<(), AdjustError<S::Error>> {
        self.progress.check()?;
        let equations = self.adjustment.equations();
        let field = self.adjustment.solve_and_reweight(&equations);
        let field = field.ok_or_else(|| self.unsolvable())?;
        self.step(Solution { equations, field });
        Ok(())
    }

    /// Moves the stones; whether they have come to rest.
    fn step(&mut self, solution: Solution) -> bool {
        let settled = self.adjustment.step(&solution);
        self.last = Some(solution);
        settled
    }

    fn unsolvable(&self) -> AdjustError<S::Error> {
        AdjustError::Unsolvable {
            stones: self.adjustment.stones.len(),
        }
    }
}
