//! What the stones of a zone do together, which may be shown where no single one of them shows it.
//!
//! Zones come from the pairs of epochs, which test them with the joint covariance of their stones. Here the mean of a
//! zone is one more stone. Where it stepped, those of its stones take part whose own step is nearer to that of the zone
//! than to none.

use super::answers::LEVEL;
use super::fit::Fit;
use super::look::Look;
use super::moderated::{VarianceFactor, p_value};
use super::stone_model::{Coefficient, Seen, coefficient, with_step};
use super::terms::Model;
use nalgebra::{DMatrix, Vector3};

/// Fewest stones of a zone, so that the error of one does not decide.
const LEAST_STONES: usize = 5;

/// A zone as one stone.
pub(super) struct Zone {
    /// Places of its stones.
    members: Vec<usize>,
    /// The mean of them.
    seen: Seen,
}

impl Zone {
    /// The stones at `members` of `seen`, in the epochs that show half of them or more. The mean is as certain as one
    /// stone, as if errors were common to all. `None` where few stones are seen in all of these epochs.
    pub fn new(members: Vec<usize>, seen: &[&Seen], epochs: usize) -> Option<Self> {
        let shows = |epoch: &usize| {
            let showing = members.iter().filter(|&&m| seen[m].epochs.contains(epoch));
            2 * showing.count() >= members.len()
        };
        let epochs: Vec<usize> = (0..epochs).filter(shows).collect();
        let of_member = |m: &usize| -> Option<Vec<Look>> {
            let place = |epoch| seen[*m].epochs.binary_search(epoch).ok();
            epochs.iter().map(|e| Some(seen[*m].looks[place(e)?])).collect()
        };
        let complete: Vec<Vec<Look>> = members.iter().filter_map(of_member).collect();
        if complete.len() < LEAST_STONES {
            return None;
        }
        let count = complete.len() as f64;

        let mean = |k: usize| {
            let value: Vector3<f64> = complete.iter().map(|looks| looks[k].value).sum();
            let sd: Vector3<f64> = complete
                .iter()
                .map(|looks| looks[k].variance.map(f64::sqrt))
                .sum();
            Look {
                value: value / count,
                variance: (sd / count).map(|sd| sd * sd),
            }
        };

        let looks = (0..epochs.len()).map(mean).collect();
        Some(Self {
            members,
            seen: Seen { epochs, looks },
        })
    }

    /// The last coefficient of a design. By chance it is as large only if it stands out neither from the errors that are
    /// claimed nor from what the design leaves of the zone's own path.
    pub fn last(&self, design: &DMatrix<f64>, typical: &[VarianceFactor; 3]) -> Option<Coefficient> {
        let last = design.ncols() - 1;
        let fits = self.seen.fit(design).filter(|fits| fits[0].freedom > 0)?;
        let of_axis = |(fit, typical): (&Fit, &VarianceFactor)| {
            let (value, variance) = (fit.coefficients[last], fit.covariance[(last, last)]);
            let freedom = fit.freedom as f64;
            match p_value(value, variance, fit.residuals / freedom, freedom) <= LEVEL {
                true => p_value(value, variance, typical.factor, f64::INFINITY),
                false => 1.0,
            }
        };
        let smallest = fits.iter().zip(typical).map(of_axis).fold(1.0, f64::min);
        Some(Coefficient {
            p: (3.0 * smallest).min(1.0),
            ..coefficient(&fits, typical, last)
        })
    }

    /// The most probable step, and its probability by chance over all places.
    pub fn likeliest_step(
        &self,
        model: &Model,
        typical: &[VarianceFactor; 3],
    ) -> Option<(usize, Coefficient)> {
        let later = self.seen.epochs.get(1..)?;
        let at = |&epoch: &usize| Some((epoch, self.last(&with_step(&model.design, epoch), typical)?));
        let (epoch, best) = later
            .iter()
            .filter_map(at)
            .min_by(|a, b| a.1.p.total_cmp(&b.1.p))?;
        let p = (best.p * later.len() as f64).min(1.0);
        Some((epoch, Coefficient { p, ..best }))
    }

    /// The stones that take part in what the zone does, of what each of them does.
    pub fn taking_part(
        &self,
        zone: &Coefficient,
        of_stone: impl Fn(usize) -> Option<Coefficient>,
    ) -> Vec<(usize, Coefficient)> {
        let direction = zone.value.component_div(&zone.sd.component_mul(&zone.sd));
        let half = 0.5 * direction.dot(&zone.value);
        let takes_part = |does: &Coefficient| direction.dot(&does.value) >= half;
        let members = self.members.iter().filter_map(|&m| Some((m, of_stone(m)?)));
        members.filter(|(_, does)| takes_part(does)).collect()
    }
}
