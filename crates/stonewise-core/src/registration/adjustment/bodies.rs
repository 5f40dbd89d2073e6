//! Bodies: the parts of the wall that ties join.
//!
//! Nothing joins one body to another, so the motion of a small one is what its own few observations say, and
//! these may be wrong together.

use super::breaks::BROKEN;
use super::state::Adjustment;
use crate::components::components;
use crate::geometry::{DisplacementSample, SmallMotion};
use crate::statistics::chi_square_p;
use crate::stone::{MotionFailure, PairResult, StoneMotion};
use crate::switches::switchable;
use nalgebra::{Matrix3, Vector3};

/// Probability that a body which moves with the wall departs from it as far by chance, below which it
/// disagrees. A motion that nothing confirms must not be called significant; at one in a thousand, that would need a
/// wall of fewer than 50 stones.
const DISAGREES: f64 = 1e-3;
/// Share of the stones of a body that photos must find for its motion to be confirmed, relative to the share
/// that they find of all.
const CONFIRMED: f64 = 0.5;
/// Share of all stones below which photos find so few that a body which they do not find is no worse for it.
const INFORMATIVE: f64 = 0.5;
/// Stones of a body whose clouds may confirm each other: fewer have a false optimum alike too easily.
const CONFIRMING_STONES: usize = 3;
/// Stones of a body that need no other confirmation where there are no photos: a side of a crack has as many.
const SIDE_STONES: usize = 10;
/// Probability of as large a scatter of the stones' own clouds about the motion of their body, below which
/// they contradict each other.
const SCATTERED: f64 = 0.01;

/// The body of each stone, 1 the one of most stones.
pub(crate) fn bodies(adjustment: &Adjustment) -> Vec<u32> {
    let graph = &adjustment.prior.graph;
    let mut next = vec![Vec::new(); graph.nodes.len()];
    for (edge, tie) in graph.edges.iter().zip(&adjustment.prior.ties) {
        if !tie.is_parted && tie.weight >= BROKEN {
            next[edge.low].push(edge.high);
            next[edge.high].push(edge.low);
        }
    }
    let mut parts = components(next.len(), |stone| next[stone].iter().copied());
    // Of equally large ones the one with the lowest stone stays first.
    parts.sort_by_key(|part| std::cmp::Reverse(part.len()));
    let mut body = vec![0; next.len()];
    for (number, part) in (1..).zip(&parts) {
        for &i in part {
            body[i] = number;
        }
    }
    body
}

/// Refuses the motions of bodies that moved unlike the largest one by far more than chance, unless photos or
/// the agreement of their own clouds confirm them.
pub(crate) fn refuse_unconfirmed(adjustment: &Adjustment, results: &mut [PairResult]) {
    switchable!("bodies");
    let sample = |(i, result): (usize, &PairResult)| {
        let motion = result
            .motion
            .as_ref()
            .ok()
            .filter(|m| !m.loose && result.body == 1)?;
        Some(DisplacementSample {
            place: adjustment.prior.graph.nodes[i].centroid,
            displacement: motion.displacement,
            covariance: translation_covariance(motion),
        })
    };

    let Some(wall) = SmallMotion::fit(&results.iter().enumerate().filter_map(sample).collect::<Vec<_>>())
    else {
        return;
    };
    let most = results.iter().map(|r| r.body).max().unwrap_or(0);

    for number in 2..=most {
        let stones: Vec<usize> = (0..results.len())
            .filter(|&i| results[i].body == number)
            .collect();
        let body = Body {
            adjustment,
            results,
            stones: &stones,
        };
        if body.disagrees(&wall) && !body.is_confirmed() {
            for i in stones {
                results[i].motion = Err(MotionFailure::Disagreement);
            }
        }
    }
}

/// The stones that ties join.
struct Body<'a> {
    adjustment: &'a Adjustment,
    results: &'a [PairResult],
    stones: &'a [usize],
}

impl Body<'_> {
    /// Its measured stones that move with it.
    fn moved(&self) -> impl Iterator<Item = (usize, &StoneMotion)> {
        let measured = self
            .stones
            .iter()
            .filter_map(|&i| Some((i, self.results[i].motion.as_ref().ok()?)));
        measured.filter(|(_, motion)| !motion.loose)
    }

    /// Whether it departs from the motion of the wall by more than chance. Its stones share the errors of their
    /// common motion: no number of them averages these away.
    fn disagrees(&self, wall: &SmallMotion) -> bool {
        let count = self.moved().count().max(1) as f64;
        let (mut apart, mut covariance) = (Vector3::zeros(), Matrix3::zeros());
        for (i, motion) in self.moved() {
            let place = self.adjustment.prior.graph.nodes[i].centroid;
            apart += (motion.displacement - wall.at(&place)) / count;
            covariance += (translation_covariance(motion) + wall.covariance_at(&place)) / count;
        }
        let square = covariance
            .try_inverse()
            .map_or(0.0, |inverse| apart.dot(&(inverse * apart)));
        chi_square_p(square, 3) < DISAGREES
    }

    /// Whether something other than the ties confirms its motion: photos, where they find most stones, or else
    /// that its stones are many or agree with each other.
    fn is_confirmed(&self) -> bool {
        let share = |stones: &mut dyn Iterator<Item = usize>| {
            let photos = self.adjustment.photos.as_ref()?;
            let (mut found, mut all) = (0.0, 0.0);
            for i in stones {
                found += f64::from(u8::from(photos.stone(i).is_some()));
                all += 1.0;
            }
            Some(found / f64::max(all, 1.0))
        };
        match share(&mut (0..self.results.len())).filter(|of_all| *of_all >= INFORMATIVE) {
            Some(of_all) => share(&mut self.stones.iter().copied()) >= Some(CONFIRMED * of_all),
            None => self.stones.len() >= SIDE_STONES || self.agrees_with_itself(),
        }
    }

    /// Whether the clouds of its stones, each by itself, show one motion.
    fn agrees_with_itself(&self) -> bool {
        let (mut square, mut stones) = (0.0, 0);
        for (i, motion) in self.moved() {
            let frame = &self.adjustment.prior.graph.nodes[i].face_from_world;
            let Some(clouds) = self.adjustment.cloud_motion(i, [0.0; 2]) else {
                continue;
            };
            let apart = clouds.mean - frame * motion.displacement;
            let Some(inverse) = clouds.covariance.try_inverse() else {
                continue;
            };
            square += apart.dot(&(inverse * apart));
            stones += 1;
        }
        stones >= CONFIRMING_STONES && chi_square_p(square, 3 * (stones - 1)) >= SCATTERED
    }
}

fn translation_covariance(motion: &StoneMotion) -> Matrix3<f64> {
    motion.covariance.fixed_view::<3, 3>(0, 0).into_owned()
}

#[cfg(test)]
mod tests {
    use super::super::adjust::adjust;
    use super::super::params::{AdjustmentParams, AdjustmentReport};
    use super::super::testing::wall_apart;
    use crate::progress::Silent;
    use crate::registration::points::MemoryPairs;
    use crate::stone::MotionFailure;
    use nalgebra::Vector3;

    const MOTION: Vector3<f64> = Vector3::new(0.0, 0.03, -0.04);

    /// A wall whose stones from `first` on stand 5 m apart and moved on their own.
    fn adjusted(first: u32) -> AdjustmentReport {
        let is_apart = |k| f64::from(u8::from(k >= first));
        let apart = |k| Vector3::new(0.0, 5.0, 0.0) * is_apart(k);
        let pairs = wall_apart(6, [0.001; 2], apart, |k| MOTION * is_apart(k));
        adjust(&MemoryPairs::new(pairs), &AdjustmentParams::default(), &Silent).unwrap()
    }

    #[test]
    fn stones_that_no_tie_joins_to_the_wall_are_a_body_of_their_own() {
        let report = adjusted(43);
        for (k, result) in report.results.iter().enumerate() {
            assert_eq!(result.body, if k < 43 { 1 } else { 2 });
            let motion = result.motion.as_ref().unwrap();
            let truth = if k < 43 { Vector3::zeros() } else { MOTION };
            assert!((motion.displacement - truth).norm() < 0.001, "{k} {motion:?}");
        }
    }

    #[test]
    fn the_motion_of_two_stones_apart_is_refused_unless_something_confirms_it() {
        let report = adjusted(46);
        for (k, result) in report.results.iter().enumerate() {
            let is_refused = matches!(result.motion, Err(MotionFailure::Disagreement));
            assert_eq!(is_refused, k >= 46, "{k} {:?}", result.motion);
        }
    }
}
