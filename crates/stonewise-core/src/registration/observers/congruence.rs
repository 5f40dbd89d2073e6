//! Which stable areas stood still.

use super::assumptions::Model;
use super::model::{Problem, Solution, Unknowns};
use super::observation::Observation;
use super::sight::StablePlane;
use crate::statistics::chi_square_p;
use nalgebra::{Matrix3, Vector3};
use std::cmp::Ordering;
use std::collections::BTreeSet;

/// Probability at which something is left out that stood still, divided by the number of things tested: the
/// first step of Benjamini & Hochberg (1995).
const RATE: f64 = 0.01;
/// A motion is distinguished from the errors of the sources where it is larger than these; of how large they are at
/// most, in units of what sources of the class differ by at least.
const MOST: f64 = 5.0;
/// A direction is seen where the motion along it is known to this, metres: the normals of a plane's cells scatter by a
/// thousandth, which seems to show motions along the plane to some centimetres.
const SEEN_M: f64 = 0.01;

/// The observations of what stood still, and the areas that moved.
///
/// One after the other, the area that moved most significantly against all others is left out (data snooping,
/// Baarda 1968); the last one stays, because nothing is there to doubt it. Areas are judged by each other,
/// not by what the epochs may be off. Then the same with single planes, among which are edges, plants and
/// things that somebody put there.
pub(super) fn standing(
    unknowns: &Unknowns,
    within: &[Vec<Observation>; 2],
    stable: Vec<Observation>,
    model: &Model,
) -> (Vec<Observation>, Vec<usize>) {
    let within: Vec<&Observation> = within.iter().flatten().collect();
    let mut kept = stable;
    let mut moved = Vec::new();
    while let Some(area) = most_moved(unknowns, &within, &kept, model, |p| p.area) {
        kept.retain(|o| o.plane().is_none_or(|p| p.area != area));
        moved.push(area);
    }
    while let Some(plane) = most_moved(unknowns, &within, &kept, model, |p| p) {
        kept.retain(|o| o.plane() != Some(plane));
    }
    moved.sort_unstable();
    (kept, moved)
}

/// The observations with their weights, the error of the whole epoch left open.
pub(super) fn reweighted(
    unknowns: &Unknowns,
    observations: &[&Observation],
    model: &Model,
) -> Vec<Observation> {
    let problem = Problem::new(unknowns, observations);
    let (prior, components) = model.opened();
    let weights = problem.mean(&prior, &components).map_or_else(
        || vec![1.0; observations.len()],
        |mean| problem.weights(&mean, &components),
    );
    let weighted = observations.iter().zip(weights).map(|(o, weight)| Observation {
        weight,
        ..(*o).clone()
    });
    weighted.collect()
}

/// The group of cells that moved most significantly, if any did; never the only one there is.
fn most_moved<G: Ord + Copy>(
    unknowns: &Unknowns,
    within: &[&Observation],
    stable: &[Observation],
    model: &Model,
    group: impl Fn(StablePlane) -> G,
) -> Option<G> {
    let of = |o: &Observation| o.plane().map(&group);
    let groups: BTreeSet<G> = stable.iter().filter_map(of).collect();
    if groups.len() < 2 {
        return None;
    }
    let all: Vec<&Observation> = within.iter().copied().chain(stable).collect();
    let all = reweighted(unknowns, &all, model);
    let (prior, components) = model.opened();
    let problem = Problem::new(unknowns, &all.iter().collect::<Vec<_>>());
    let solution: Solution = problem.solve(&prior, &components)?;
    // Where epochs were compared on few stones, one still area in ten differs from the others by what its
    // sources are off.
    let least_m = model.class.least_m();
    let least_m = model.components.translation_m.clamp(least_m, MOST * least_m);
    let tests = groups.len() as f64;
    let tested = groups.into_iter().filter_map(|g| {
        let (information, vector) = problem.motion_of(&solution, &components, |o| of(o) == Some(g));
        let motion = Motion::of(&information, &vector);
        (motion.length_m > least_m).then_some((motion, g))
    });
    let (motion, moved) = tested.min_by(|a, b| a.0.by_significance(&b.0))?;
    (motion.p_still < RATE / tests).then_some(moved)
}

/// The apparent motion of a group of cells, along the directions that are seen.
struct Motion {
    /// Probability of so large a motion of what stood still.
    p_still: f64,
    chi_square: f64,
    length_m: f64,
}

impl Motion {
    fn of(information: &Matrix3<f64>, vector: &Vector3<f64>) -> Self {
        let eigen = (0.5 * (information + information.transpose())).symmetric_eigen();
        let (mut chi_square, mut square, mut seen) = (0.0, 0.0, 0);
        for (value, direction) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            if *value * SEEN_M * SEEN_M > 1.0 {
                let along = direction.dot(vector);
                chi_square += along * along / value;
                square += (along / value).powi(2);
                seen += 1;
            }
        }
        Self {
            p_still: chi_square_p(chi_square, seen),
            chi_square,
            length_m: f64::sqrt(square),
        }
    }

    /// Orders the more significant motion first. The probabilities of large motions underflow to zero in
    /// 64-bit numbers; chi-square then decides.
    fn by_significance(&self, other: &Self) -> Ordering {
        let by_p = self.p_still.total_cmp(&other.p_still);
        by_p.then(other.chi_square.total_cmp(&self.chi_square))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_that_nobody_sees_count_for_nothing() {
        // One direction seen with a standard deviation of 1 mm, a motion of 2 mm along it: 4.6 % (two-sided
        // normal law).
        let information = Matrix3::from_diagonal(&Vector3::new(1e6, 1e-3, 0.0));
        let motion = Motion::of(&information, &Vector3::new(2e3, 5.0, 0.0));
        assert!((motion.p_still - 0.0455).abs() < 1e-4, "{}", motion.p_still);
        assert!((motion.length_m - 0.002).abs() < 1e-12, "{}", motion.length_m);
        assert_eq!(Motion::of(&Matrix3::zeros(), &Vector3::zeros()).p_still, 1.0);
    }
}
