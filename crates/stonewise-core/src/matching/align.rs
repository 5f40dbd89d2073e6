//! The rigid motion between two frames, from the stones alone.

use super::centroids::area_ratio;
use super::constellation::{Agreement, Constellation, Nearness, Neighbours, RigidFit, rigid_fit};
use crate::geometry::{Rigid3, nearest_rotation};
use crate::stone::Stone;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::cmp::Reverse;
use std::f64::consts::PI;

/// Pairs of neighbours of the second epoch that are looked for in the first, spread over the wall.
const SEEDS: usize = 200;
/// Largest difference of the distance of two neighbours, in sizes of the usual stone.
const DISTANCE_SIZES: f64 = 0.1;
/// Least ratio of the faces of a stone of a pair in both epochs.
const PAIR_AREA_RATIO: f64 = 0.75;
/// Pairs of the first epoch that one pair of the second is compared with, at most; more only where most are equal.
const MAX_ALIKE: usize = 4000;
/// Stones around a pair that say whether a motion is worth a closer look.
const LOCAL: usize = 12;
/// Number of these stones that must agree: chance does not bring as many together once in a thousand.
const LOCAL_SAME: usize = 6;
/// Motions that are looked at closely.
const CANDIDATES: usize = 24;
/// Fewest stones that make a constellation.
const MIN_STONES: usize = 8;
/// By how much the best motion must bring together a larger share of the stones than any other. On a wall of equal
/// stones a motion by one stone brings nearly all together.
const MIN_LEAD: f64 = 0.25;
/// Least lead of the best motion in standard deviations of the difference of both shares.
const MIN_LEAD_SD: f64 = 4.0;

/// How the second epoch lies in the frame of the first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Alignment {
    /// `p_first = first_from_second * p_second`, metres.
    pub first_from_second: Rigid3,
    /// Stones that it brings together.
    pub stones: usize,
    /// Stones of the second epoch that come to lie where the first one has stones.
    pub covered: usize,
    /// Largest share of the stones that any other motion brings together, 0..1.
    pub rival_share: f64,
    /// Root mean square distance of the centroids that it brings together, metres.
    pub rms_m: f64,
}

/// Why the stones do not show how one epoch lies in the frame of another.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AlignError {
    /// Too few stones.
    #[error("{first} and {second} stones were found; at least {MIN_STONES} in each epoch are needed")]
    TooFew {
        /// Stones of the first epoch.
        first: usize,
        /// Stones of the second epoch.
        second: usize,
    },
    /// No motion brings more stones together than chance does.
    #[error("no motion brings the stones of both epochs together: the best one {:.0} % of them", 100.0 * .share)]
    NotFound {
        /// Share of the stones that the best motion brings together.
        share: f64,
    },
    /// Other motions bring as many stones together.
    #[error(
        "the alignment is not unique: one motion brings {:.0} % of the stones together, another one {:.0} %, as on a wall of \
         equal stones",
        100.0 * .share,
        100.0 * .rival_share
    )]
    NotUnique {
        /// Share of the stones that the best motion brings together.
        share: f64,
        /// Share of another motion.
        rival_share: f64,
    },
}

/// Finds the rigid motion between the frames of two epochs from their stones: centroids, areas and the side of the
/// wall that is outside.
///
/// As a star tracker finds its attitude (Lang et al. 2010): pairs of neighbours of the second epoch are looked for in
/// the first by their distance and their areas; each such pair proposes a motion, the stones around it test the motion,
/// and the best motions grow over the wall. No start is needed, and stones may be missing, new or moved. The motion is
/// unique only if no other one, among them all motions by about a stone and half turns, brings nearly as many stones
/// together.
///
/// # Errors
/// Too few stones, stones that do not fit, or a pattern that repeats.
pub fn align_stones(first: &[Stone], second: &[Stone]) -> Result<Alignment, AlignError> {
    if first.len().min(second.len()) < MIN_STONES {
        return Err(AlignError::TooFew {
            first: first.len(),
            second: second.len(),
        });
    }

    let search = Search {
        first: Constellation::new(first),
        second: Constellation::new(second),
    };
    let mut grown: Vec<Grown> = search
        .proposals()
        .into_iter()
        .filter_map(|proposal| search.grow(proposal.motion, proposal.seed))
        .collect();
    grown.sort_by_key(|g| Reverse(g.agreement.same.len()));
    let Some(best) = grown.first() else {
        return Err(AlignError::NotFound { share: 0.0 });
    };
    let others = grown[1..].iter().map(|g| g.fit.motion);

    let rival = others
        .chain(search.motions_like(best))
        .filter_map(|motion| search.settle(motion))
        .filter(|rival| search.differ(&best.fit.motion, &rival.fit.motion))
        .filter(|rival| 2 * rival.agreement.covered > best.agreement.covered)
        .max_by(|a, b| a.agreement.share().total_cmp(&b.agreement.share()));
    let share = best.agreement.share();
    let rival_share = rival.as_ref().map_or(0.0, |r| r.agreement.share());
    let variance = |a: &Agreement| a.share() * (1.0 - a.share()) / a.covered.max(1) as f64;
    let sd = (variance(&best.agreement) + rival.as_ref().map_or(0.0, |r| variance(&r.agreement))).sqrt();
    let leads = share - rival_share >= MIN_LEAD.max(MIN_LEAD_SD * sd);

    match leads && best.agreement.same.len() >= MIN_STONES {
        true => Ok(Alignment {
            first_from_second: best.fit.motion,
            stones: best.agreement.same.len(),
            covered: best.agreement.covered,
            rival_share,
            rms_m: best.fit.rms_m,
        }),
        false if share >= 0.5 => Err(AlignError::NotUnique { share, rival_share }),
        false => Err(AlignError::NotFound { share }),
    }
}

struct Search<'a> {
    first: Constellation<'a>,
    second: Constellation<'a>,
}

/// A motion that a pair of neighbours proposes.
struct Proposal {
    motion: Rigid3,
    /// Stone of the second epoch around which the motion was tested.
    seed: usize,
    closeness: f64,
}

/// A motion that fits all stones it brings together.
struct Grown {
    fit: RigidFit,
    agreement: Agreement,
}

impl Search<'_> {
    /// The motions that most of the stones around some pair support, best first.
    fn proposals(&self) -> Vec<Proposal> {
        let mut known = self.first.pairs();
        known.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m));
        let seeds = self.second.pairs();
        let step = seeds.len().div_ceil(SEEDS).max(1);
        let mut proposals: Vec<Proposal> = seeds
            .par_iter()
            .step_by(step)
            .filter_map(|seed| self.proposal(seed, &known))
            .collect();
        proposals.sort_by(|a, b| b.closeness.total_cmp(&a.closeness));
        proposals.truncate(CANDIDATES);
        proposals
    }

    /// The motion that most of the stones around a pair support.
    fn proposal(&self, seed: &Neighbours, known: &[Neighbours]) -> Option<Proposal> {
        let [a, b] = seed.stones;
        let tolerance = DISTANCE_SIZES * self.first.size_m;
        let from = known.partition_point(|p| p.distance_m < seed.distance_m - tolerance);
        let to = known.partition_point(|p| p.distance_m <= seed.distance_m + tolerance);
        let fits =
            |i: usize, a: usize| area_ratio(&self.first.stones[i], &self.second.stones[a]) >= PAIR_AREA_RATIO;
        let alike: Vec<[usize; 2]> = known[from..to]
            .iter()
            .map(|p| p.stones)
            .filter(|&[i, j]| fits(i, a) && fits(j, b))
            .collect();
        let step = alike.len().div_ceil(MAX_ALIKE).max(1);
        let around: Vec<usize> = self
            .second
            .nearest(&self.second.stones[a].centroid, LOCAL)
            .into_iter()
            .map(|(j, _)| j)
            .collect();

        let frame_second = self.second.frame(seed.stones)?;
        let propose = |&[i, j]: &[usize; 2]| {
            let rotation = nearest_rotation(&(self.first.frame([i, j])? * frame_second.transpose()));
            let moved = rotation * self.second.stones[a].centroid.coords;
            let motion = Rigid3::from_parts((self.first.stones[i].centroid.coords - moved).into(), rotation);
            let around = around.iter().copied();
            let agreement = self
                .first
                .agreement(self.second.stones, around, &motion, Nearness::Rough);
            (agreement.same.len() >= LOCAL_SAME).then_some(Proposal {
                motion,
                seed: a,
                closeness: agreement.closeness,
            })
        };

        let proposals = alike.iter().step_by(step).filter_map(propose);
        proposals.max_by(|a, b| a.closeness.total_cmp(&b.closeness))
    }

    /// Lets a motion grow from the stones around one to all stones.
    fn grow(&self, mut motion: Rigid3, seed: usize) -> Option<Grown> {
        let centre = self.second.stones[seed].centroid;
        let mut order: Vec<usize> = (0..self.second.stones.len()).collect();
        let distance = |j: &usize| (self.second.stones[*j].centroid - centre).norm_squared();
        order.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        let mut count = LOCAL;
        while count < order.len() {
            let among = order[..count].iter().copied();
            motion = self.fit(among, &motion, Nearness::Rough)?.fit.motion;
            count *= 2;
        }
        self.settle(motion)
    }

    /// Fits a motion to all stones that it brings together until these stay the same.
    fn settle(&self, mut motion: Rigid3) -> Option<Grown> {
        let all = || 0..self.second.stones.len();
        let mut grown = self.fit(all(), &motion, Nearness::Rough)?;
        for _ in 0..20 {
            motion = grown.fit.motion;
            let next = self.fit(all(), &motion, Nearness::Fine)?;
            let settled = next.agreement.same == grown.agreement.same;
            grown = next;
            if settled {
                break;
            }
        }
        Some(grown)
    }

    fn fit(
        &self,
        among: impl IntoIterator<Item = usize>,
        motion: &Rigid3,
        nearness: Nearness,
    ) -> Option<Grown> {
        let agreement = self.first.agreement(self.second.stones, among, motion, nearness);
        let place = |&[i, j]: &[usize; 2]| [self.first.stones[i].centroid, self.second.stones[j].centroid];
        let places: Vec<_> = agreement.same.iter().map(place).collect();
        let fit = rigid_fit(&places, Some(motion))?;
        Some(Grown { fit, agreement })
    }

    /// Motions that a wall of equal stones would allow beside the best one: by the way from a stone to one of its
    /// neighbours, with and without half a turn about the face.
    fn motions_like(&self, best: &Grown) -> Vec<Rigid3> {
        let same = &best.agreement.same;
        let step = same.len().div_ceil(4).max(1);
        let mut motions = Vec::new();
        for [i, _] in same.iter().step_by(step) {
            let stone = &self.first.stones[*i];
            let Some(axis) = stone.normal.try_normalize(1e-9) else {
                continue;
            };
            let turn = UnitQuaternion::from_scaled_axis(axis * PI);
            let about = Translation3::from(stone.centroid.coords);
            let half_turn: Isometry3<f64> = about * turn * about.inverse();
            for (k, _) in self.first.nearest(&stone.centroid, LOCAL) {
                let way: Vector3<f64> = self.first.stones[k].centroid - stone.centroid;
                let shift = Translation3::from(way);
                motions.push(shift * best.fit.motion);
                motions.push(shift * half_turn * best.fit.motion);
            }
        }
        motions
    }

    /// Whether two motions bring some stone of the second epoch to different places.
    fn differ(&self, a: &Rigid3, b: &Rigid3) -> bool {
        let stones = self.second.stones;
        let step = stones.len().div_ceil(50).max(1);
        let mut sampled = stones.iter().step_by(step);
        sampled.any(|s| (a * s.centroid - b * s.centroid).norm() > 0.5 * self.second.size_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::id::StoneId;
    use nalgebra::{Point3, Vector3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use stonewise_testing::normal;

    /// Courses of stones on a cylinder: along, up; radius in metres.
    fn wall(rng: &mut ChaCha8Rng, length_m: f64, courses: usize, radius_m: f64) -> Vec<Stone> {
        let mut stones = Vec::new();
        let mut bottom = 0.0;
        for _ in 0..courses {
            let height = rng.random_range(0.25..0.5);
            let mut at = -rng.random_range(0.0..0.5);
            while at < length_m {
                let length = rng.random_range(0.3..1.0);
                stones.push([at + length / 2.0, bottom + height / 2.0, length * height]);
                at += length;
            }
            bottom += height;
        }
        on_cylinder(&stones, radius_m)
    }

    /// Equal bricks in running bond.
    fn bricks(columns: u32, courses: u32) -> Vec<Stone> {
        let bricks: Vec<[f64; 3]> = (0..columns * courses)
            .map(|n| {
                let (column, course) = (f64::from(n % columns), f64::from(n / columns));
                [0.25 * column + 0.125 * (course % 2.0), 0.08 * course, 0.25 * 0.08]
            })
            .collect();
        on_cylinder(&bricks, 100.0)
    }

    fn on_cylinder(stones: &[[f64; 3]], radius_m: f64) -> Vec<Stone> {
        let place = |(n, &[along, up, area_m2]): (usize, &[f64; 3])| {
            let (sin, cos) = (along / radius_m).sin_cos();
            Stone {
                id: StoneId(n as u32 + 1),
                centroid: Point3::new(radius_m * sin, radius_m * (cos - 1.0), up),
                normal: Vector3::new(sin, cos, 0.0),
                area_m2,
                points: 1000,
                photos: 5,
                confidence: 0.9,
            }
        };
        stones.iter().enumerate().map(place).collect()
    }

    /// The wall in another frame, as another detector would show it: a share of the stones missing, centroids off by
    /// some millimetres, areas by a tenth, normals by degrees.
    fn seen(
        stones: &[Stone],
        rng: &mut ChaCha8Rng,
        missing: f64,
        sd_m: f64,
        second_from_first: &Rigid3,
    ) -> Vec<Stone> {
        let kept: Vec<&Stone> = stones.iter().filter(|_| rng.random::<f64>() >= missing).collect();
        let mut noise = |sd: f64| Vector3::from_fn(|_, _| sd * normal(rng));
        let mut see = |s: &Stone| Stone {
            centroid: second_from_first * (s.centroid + noise(sd_m)),
            normal: second_from_first * (s.normal + noise(0.05)).normalize(),
            area_m2: s.area_m2 * (1.0 + noise(0.1).x),
            ..s.clone()
        };
        kept.into_iter().map(&mut see).collect()
    }

    fn motion(rng: &mut ChaCha8Rng, degrees: f64, metres: f64) -> Rigid3 {
        let mut direction = || Vector3::from_fn(|_, _| normal(rng)).normalize();
        Rigid3::new(direction() * metres, direction() * degrees.to_radians())
    }

    /// Largest distance between where two motions bring the stones, metres.
    fn error_m(stones: &[Stone], found: &Rigid3, true_motion: &Rigid3) -> f64 {
        let errors = stones
            .iter()
            .map(|s| (found * s.centroid - true_motion * s.centroid).norm());
        errors.fold(0.0, f64::max)
    }

    #[test]
    fn any_turn_and_any_distance_are_found_from_two_looks_at_a_wall() {
        let turns = [(0.0, 0.0), (25.0, 3.6), (90.0, 40.0), (180.0, 1000.0)];
        for (seed, (degrees, metres)) in turns.into_iter().enumerate() {
            let rng = &mut ChaCha8Rng::seed_from_u64(seed as u64);
            let wall = wall(rng, 8.0, 8, if seed % 2 == 0 { 1e4 } else { 12.0 });
            let second_from_first = motion(rng, degrees, metres);
            let first = seen(&wall, rng, 0.15, 0.01, &Rigid3::identity());
            let second = seen(&wall, rng, 0.15, 0.01, &second_from_first);
            let found = align_stones(&first, &second).unwrap();
            let error = error_m(&second, &found.first_from_second, &second_from_first.inverse());
            assert!(error < 0.02, "{degrees} degrees: {error} m");
            assert!(found.stones * 3 > first.len() * 2, "{found:?}");
        }
    }

    #[test]
    fn part_of_a_wall_is_found_in_the_whole() {
        let rng = &mut ChaCha8Rng::seed_from_u64(7);
        let wall = wall(rng, 30.0, 12, 60.0);
        let first: Vec<Stone> = wall.iter().filter(|s| s.centroid.x < 18.0).cloned().collect();
        let second_from_first = motion(rng, 120.0, 700.0);
        let mut second = seen(&wall, rng, 0.1, 0.01, &second_from_first);
        second.retain(|s| (second_from_first.inverse() * s.centroid).x > 12.0);
        let found = align_stones(&first, &second).unwrap();
        let error = error_m(&second, &found.first_from_second, &second_from_first.inverse());
        assert!(error < 0.03, "{error} m");
        assert!(found.covered < second.len(), "{found:?}");
    }

    #[test]
    fn equal_stones_are_never_aligned() {
        for seed in 0..10 {
            let rng = &mut ChaCha8Rng::seed_from_u64(seed);
            let wall = bricks(20, 20 + 2 * seed as u32);
            let first = seen(&wall, rng, 0.1, 0.003, &Rigid3::identity());
            let frame = motion(rng, 40.0, 5.0);
            let second = seen(&wall, rng, 0.1, 0.003, &frame);
            let error = align_stones(&first, &second).unwrap_err();
            assert!(matches!(error, AlignError::NotUnique { .. }), "{error}");
        }
    }

    #[test]
    fn another_wall_is_not_aligned() {
        for seed in 0..5 {
            let rng = &mut ChaCha8Rng::seed_from_u64(seed);
            let [first, second] = [0, 1].map(|_| wall(rng, 8.0, 8, 1e4));
            let error = align_stones(&first, &second).unwrap_err();
            assert!(matches!(error, AlignError::NotFound { .. }), "{error}");
        }
    }
}
