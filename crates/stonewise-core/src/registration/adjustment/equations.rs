//! The normal equations of all stones: what every type of observation hands over, added up.

use super::candidate::{CandidateMotion, Moving};
use super::observation::NormalEquations;
use super::observation::surface::{Equations, Inflation, with_shift_error};
use super::state::Adjustment;
use crate::geometry::Bounds;
use crate::statistics::upper_median;
use rayon::prelude::*;

/// A stone's normal equations about the common motion.
pub(crate) struct StoneEquations {
    /// Moving with the field.
    pub with_field: NormalEquations,
    /// Moving on its own, where that is followed or where photos weigh otherwise then.
    pub on_own: Option<NormalEquations>,
}

impl Adjustment {
    /// Equations of all stones, with correlation between points accounted for.
    pub fn equations(&self) -> Vec<StoneEquations> {
        let error_m = self.prior.components.error_m;
        let of_stone = |(i, with_field): (usize, NormalEquations)| StoneEquations {
            with_field,
            on_own: self.on_own(i, error_m),
        };
        let with_field = self.equations_with_field(error_m);
        with_field.into_par_iter().enumerate().map(of_stone).collect()
    }

    /// Normal equations of all stones, moving with the field, for an error of their motions in the face.
    pub fn equations_with_field(&self, error_m: f64) -> Vec<NormalEquations> {
        let stones = self.stones.par_iter().enumerate();
        stones
            .map(|(i, s)| self.observed(i, &s.with_field, Moving::WithField, error_m))
            .collect()
    }

    /// Normal equations of a stone that moves on its own; `None` where they are those of moving with the field.
    fn on_own(&self, i: usize, error_m: f64) -> Option<NormalEquations> {
        let stone = &self.stones[i];
        match &stone.on_own {
            Some(own) => Some(self.compared(i, self.observed(i, own, Moving::OnOwn, error_m))),
            None => self
                .is_in_photos(i)
                .then(|| self.observed(i, &stone.with_field, Moving::OnOwn, error_m)),
        }
    }

    /// The sum over all types of observation of a stone at one of its motions.
    fn observed(
        &self,
        i: usize,
        candidate: &CandidateMotion,
        moving: Moving,
        error_m: f64,
    ) -> NormalEquations {
        let mut sum = self.observed_by_clouds(i, candidate, error_m);
        if self.stones[i].info.usable
            && let Some(photos) = self.observed_by_photos(i, moving)
        {
            sum += photos;
        }
        sum
    }

    /// Whether photos show how a stone moved.
    pub fn is_in_photos(&self, i: usize) -> bool {
        self.photos.as_ref().is_some_and(|p| p.stone(i).is_some())
    }

    /// What photos say of a stone, where they show it.
    pub fn observed_by_photos(&self, i: usize, moving: Moving) -> Option<NormalEquations> {
        let photos = self.photos.as_ref()?.stone(i)?;
        Some(photos.normal_equations(
            &self.prior.common_in(i),
            self.prior.components.appearance_m(),
            moving,
        ))
    }

    /// What a stone's own points say at one of its motions.
    pub fn observed_by_clouds(&self, i: usize, candidate: &CandidateMotion, error_m: f64) -> NormalEquations {
        let stone = &self.stones[i];
        let mut sum = NormalEquations::nothing();
        if stone.info.usable {
            let inflation = self.surface.inflation(stone.surface());
            let origin = self.prior.common_in(i);
            let of_points = self
                .surface
                .normal_equations(&candidate.surface, &origin, inflation, error_m);
            sum += with_shift_error(of_points, self.sensor_error_m(i));
        }
        sum
    }

    /// Error of the sensor that measured a stone against the one that measured most stones, per axis, metres; 0
    /// where it is the same in both epochs.
    fn sensor_error_m(&self, i: usize) -> f64 {
        let factors = self.stones[i].info.noise_factors;
        let of_epoch = |(factor, sigma_m): (f64, f64)| match factor == 1.0 {
            true => 0.0,
            false => (SENSOR_ERROR * factor.max(1.0) * sigma_m).powi(2),
        };
        let epochs = factors.into_iter().zip(self.surface.noise.sigma_m);
        epochs.map(of_epoch).sum::<f64>().sqrt()
    }

    /// The equations of a stone on its own, with the likelihood that it has against the field's motion on the
    /// same points.
    fn compared(&self, i: usize, mut equations: NormalEquations) -> NormalEquations {
        let stone = &self.stones[i];
        let own = stone.on_own.as_ref().and_then(|c| c.surface.equations());
        if let (Some(with_field), Some(own)) = (stone.with_field.surface.equations(), own) {
            let on_its_own_points = 0.5 * (with_field.deviance - own.deviance);
            let Inflation { all, in_face } = self.surface.inflation(stone.surface());
            let inflation = all.max(in_face);
            equations.constant += (stone.log_ratio - on_its_own_points) / inflation;
        }
        equations
    }

    /// Variances of errors that all points of a stone share, beyond what its own cells show: translation,
    /// rotation. `octaves` of length, from the size of a stone up: one against its neighbours,
    /// [`Self::octaves`] against another epoch.
    pub fn shared_variances(&self, octaves: f64) -> [f64; 6] {
        let stones = self.stones.iter();
        let known: Vec<&Equations> = stones.filter_map(|s| s.with_field.surface.equations()).collect();
        self.surface
            .shared_variances(&known, octaves, self.params.systematic_share)
    }

    /// Octaves of length between a stone and the wall, at least one.
    pub fn octaves(&self) -> f64 {
        let places = self.prior.graph.nodes.iter().map(|n| n.centroid);
        let extent_m = Bounds::of(places).map_or(0.0, |b| (b.max - b.min).norm());
        (extent_m / self.step_m().unwrap_or(extent_m).max(SHORTEST_STEP_M))
            .log2()
            .max(0.0)
            + 1.0
    }

    /// Median distance of neighbours, metres.
    pub fn step_m(&self) -> Option<f64> {
        let mut lengths: Vec<f64> = self.prior.graph.edges.iter().map(|e| e.length_m).collect();
        upper_median(&mut lengths)
    }
}

/// Error of a sensor's registration (trajectory, targets) as a share of the noise of its points: 5 mm of a
/// drone's 11 mm, 0.5 mm of a scanner's 1 mm.
const SENSOR_ERROR: f64 = 0.5;
/// Guards the ratio where all stones share a place, metres.
const SHORTEST_STEP_M: f64 = 1e-3;
