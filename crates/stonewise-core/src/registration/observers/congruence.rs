//! Which stable areas stood still.

use super::assumptions::{Model, OPEN};
use super::model::{Problem, Solution, Unknowns};
use super::observation::Observation;
use super::sight::StablePlane;
use nalgebra::{Matrix3, Vector3};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::collections::BTreeSet;

/// Probability at which something is left out that stood still, divided by the number of things tested: the first step of Benjamini &
/// Hochberg (1995).
const RATE: f64 = 0.01;
/// A direction is seen where the motion along it is known to this, metres.
const SEEN_M: f64 = 0.05;

/// The observations of what stood still, and the areas that moved.
///
/// One after the other, the area that moved most significantly against all others is left out (data snooping, Baarda 1968); the last one
/// stays, because nothing is there to doubt it. Areas are judged by each other, not by what the epochs may be off. Then the same with single planes, among which are edges, plants and things that somebody
/// put there.
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
    let (prior, components) = model.with_whole(OPEN);
    let solution = problem.solve(&prior, &components);
    let weights = solution.map_or_else(
        || vec![1.0; observations.len()],
        |s| problem.weights(&s.mean, &components),
    );
    let weighted = observations.iter().zip(weights).map(|(o, weight)| Observation {
        weight,
        ..(*o).clone()
    });
    weighted.collect()
}

/// Of the groups of cells, the one that moved most significantly, if any did; the only one there is never.
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
    let (prior, components) = model.with_whole(OPEN);
    let problem = Problem::new(unknowns, &all.iter().collect::<Vec<_>>());
    let solution: Solution = problem.solve(&prior, &components)?;
    let p_still = |g: G| {
        let (information, vector) = problem.motion_of(&solution, &components, |o| of(o) == Some(g));
        p_value(&information, &vector)
    };
    let tests = groups.len() as f64;
    let tested = groups.into_iter().map(|g| (p_still(g), g));
    let (p, least) = tested.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (p < RATE / tests).then_some(least)
}

/// Probability of so large an apparent motion of what stood still, along the directions that are seen.
fn p_value(information: &Matrix3<f64>, vector: &Vector3<f64>) -> f64 {
    let eigen = (0.5 * (information + information.transpose())).symmetric_eigen();
    let (mut chi_square, mut seen) = (0.0, 0);
    for (value, direction) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value * SEEN_M * SEEN_M > 1.0 {
            chi_square += direction.dot(vector).powi(2) / value;
            seen += 1;
        }
    }
    ChiSquared::new(f64::from(seen)).map_or(1.0, |law| law.sf(chi_square))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_that_nobody_sees_count_for_nothing() {
        // One direction seen with a standard deviation of 1 mm, a motion of 2 mm along it: 4.6 % (two-sided normal law).
        let information = Matrix3::from_diagonal(&Vector3::new(1e6, 1e-3, 0.0));
        let p = p_value(&information, &Vector3::new(2e3, 5.0, 0.0));
        assert!((p - 0.0455).abs() < 1e-4, "{p}");
        assert_eq!(p_value(&Matrix3::zeros(), &Vector3::zeros()), 1.0);
    }
}
