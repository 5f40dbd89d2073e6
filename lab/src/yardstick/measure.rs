//! Measures a wall as a run does, from true labels and matches: adjustment, errors of the sources, deformation.

use super::points::{SurveyPoint, pairs, seen_stone};
use super::wall::{Area, Truth, Wall};
use nalgebra::{Matrix3, Point3, Vector3};
use std::collections::{BTreeMap, BTreeSet};
use stonewise_core::cloud::Cloud;
use stonewise_core::geometry::{DisplacementSample, FaceFrame, SmallMotion, lever};
use stonewise_core::id::StoneId;
use stonewise_core::progress::Silent;
use stonewise_core::registration::observers::{
    Datum, EpochErrorParams, EpochErrors, EpochPair, Response, SeenStone, Source, StablePoints, epoch_errors,
};
use stonewise_core::registration::{
    AdjustmentParams, AdjustmentReport, Deformation, DeformationZone, MemoryPairs, StoneDeformation, adjust,
    deformation,
};
use stonewise_core::statistics::{chi_square_p, discoveries};
use stonewise_core::stone::StoneMotion;

/// Width of a stone's border, in noise levels, where a point's place decides and not its label; as in a run.
const BORDER_NOISES: f64 = 3.0;
/// Share of false discoveries among moved stones, as in a run.
const FALSE_DISCOVERIES: f64 = 0.05;
/// A stone whose deformation is beyond this many standard deviations does not say where the wall kept its shape.
const DEFORMED_SD: f64 = 5.0;
/// A stone of a false area truly moved by less than this share of the area's largest motion.
const MOVED_SHARE: f64 = 0.1;

/// An error with its claimed covariance along, up and out of a stone's face, metres.
pub type Claim = (Vector3<f64>, Matrix3<f64>);

/// Claims about a stone.
pub struct Found {
    pub is_called_loose: bool,
    /// Moved, against the datum or where there is none against the wall.
    pub is_called_moved: bool,
    /// Its motion; `None` where the datum is unknown.
    pub absolute: Option<Claim>,
    /// Its motion less the rigid motion in common.
    pub free: Claim,
    /// Its motion against its neighbours.
    pub relative: Claim,
    /// Its deformation.
    pub deformation: Option<Claim>,
}

/// A survey as it was measured.
pub struct Measured {
    /// Each stone's truth, and what was found; `None`: no motion.
    pub stones: Vec<(Truth, Option<Found>)>,
    pub is_still: bool,
    pub is_deformed: bool,
    /// Whether each true area was found.
    pub areas: Vec<bool>,
    /// Of areas that were found, whether the interval of the size holds the true one; none where other motions add to
    /// it.
    pub held: Vec<bool>,
    /// Areas where nothing moved; `None` where the truth has motions besides those of areas and single stones.
    pub false_areas: Option<usize>,
}

pub type Places = BTreeMap<StoneId, Point3<f64>>;
pub type Failure = Box<dyn std::error::Error>;

/// A pair of epochs as it was adjusted.
pub struct Pair {
    /// Middle of each pair's points in the first epoch.
    pub places: Places,
    /// Those that were measured, in the order of their errors.
    ids: Vec<StoneId>,
    report: AdjustmentReport,
    errors: EpochErrors,
    pub deformation: Deformation,
}

impl Pair {
    pub fn new(wall: &Wall, params: &AdjustmentParams) -> Result<Self, Failure> {
        let normal = |id: u32| Some(wall.truth.get(&id)?.normal);
        let pairs = pairs(&wall.epochs, normal, BORDER_NOISES);
        let places = pairs.iter().map(|p| (p.first, p.centroid)).collect();
        let report = adjust(&MemoryPairs::new(pairs), params, &Silent)?;
        let seen = Seen::new(wall, &report);
        let errors = seen.errors(wall, &report)?;
        let joint = errors.joint.as_ref().map(|e| (e, seen.ids.as_slice()));
        let deformation = match &report.joint {
            Some(motions) => deformation(motions, joint, &Silent)?,
            None => Deformation::default(),
        };
        Ok(Self {
            places,
            ids: seen.ids,
            report,
            errors,
            deformation,
        })
    }
}

/// Measures a wall.
pub fn measure(wall: &Wall, params: &AdjustmentParams) -> Result<Measured, Failure> {
    let pair = Pair::new(wall, params)?;
    let Pair {
        places, deformation, ..
    } = &pair;
    let mut found = found(wall, &pair);
    let zones: Vec<Option<&DeformationZone>> = wall
        .areas
        .iter()
        .map(|area| zone_over(area, places, deformation))
        .collect();
    let held = |(area, zone): (&Area, &Option<&DeformationZone>)| {
        Some((zone.as_ref()?.interval_m[0]..=zone.as_ref()?.interval_m[1]).contains(&area.largest_m))
    };
    let stone = |(id, truth): (&u32, &Truth)| (truth.clone(), found.remove(&StoneId(*id)));
    Ok(Measured {
        is_still: wall.is_still,
        is_deformed: deformation.is_shown(),
        areas: zones.iter().map(Option::is_some).collect(),
        held: match wall.is_still_elsewhere {
            true => wall.areas.iter().zip(&zones).filter_map(held).collect(),
            false => Vec::new(),
        },
        false_areas: wall
            .is_still_elsewhere
            .then(|| false_zones(wall, places, deformation)),
        stones: wall.truth.iter().map(stone).collect(),
    })
}

/// The claims about each measured stone with what is true of it.
fn found(wall: &Wall, pair: &Pair) -> BTreeMap<StoneId, Found> {
    let errors = &pair.errors;
    let is_known = errors.datum != Datum::Unknown;
    let motions: BTreeMap<StoneId, &StoneMotion> = pair
        .report
        .results
        .iter()
        .filter_map(|r| Some((r.first, r.motion.as_ref().ok()?)))
        .collect();
    let place = |k: usize| &pair.places[&pair.ids[k]];
    let motion = |k: usize| motions[&pair.ids[k]];
    let truth = |k: usize| &wall.truth[&pair.ids[k].0];
    let displacement = |k: usize| truth(k).displacement(place(k));
    let own = |k: usize| motion(k).covariance.fixed_view::<3, 3>(0, 0).into_owned();
    // The motion less the known error of the epochs, and what is claimed of it besides what all stones share.
    let corrected = |k: usize| match is_known {
        true => (
            motion(k).displacement - errors.at[k].mean,
            own(k) + errors.at[k].covariance,
        ),
        false => (motion(k).displacement, own(k) + errors.relative[k]),
    };
    let all = 0..pair.ids.len();
    let common = |of: &dyn Fn(usize) -> Vector3<f64>| {
        let sample = |k: usize| DisplacementSample {
            place: *place(k),
            displacement: of(k),
            covariance: own(k),
        };
        let samples: Vec<_> = all.clone().filter(|k| !motion(*k).loose).map(sample).collect();
        SmallMotion::fit(&samples).unwrap_or_else(|| SmallMotion::shift(Vector3::zeros()))
    };
    let of_motions = common(&|k| corrected(k).0);
    let of_errors = common(&|k| corrected(k).0 - displacement(k));
    let tested = |k: usize| {
        let (moved, spread) = corrected(k);
        match is_known {
            true => (moved, spread),
            false => (
                moved - of_motions.at(place(k)),
                spread + of_motions.covariance_at(place(k)),
            ),
        }
    };
    let p_still = |k: usize| {
        let (moved, spread) = tested(k);
        Some(chi_square_p(moved.dot(&spread.cholesky()?.solve(&moved)), 3))
    };
    let p_values: Vec<Option<f64>> = all.clone().map(p_still).collect();
    let moved: BTreeSet<usize> = discoveries(&p_values, FALSE_DISCOVERIES).into_iter().collect();
    let deformed = true_deformations(wall, pair);
    let claim = |k: usize| {
        let face = FaceFrame::from_normal(&truth(k).normal).face_from_world();
        let in_face = |(v, c): Claim| (face * v, face * c * face.transpose());
        let (corrected, spread) = corrected(k);
        // Of a known datum the rigid part of the claimed error is taken off with that of the error.
        let rigid = match is_known {
            true => {
                let lever = lever(&(place(k) - errors.rigid.centre));
                -lever * errors.rigid.covariance * lever.transpose()
            }
            false => of_motions.covariance_at(place(k)),
        };
        let error = corrected - displacement(k);
        let own = displacement(k) - truth(k).shared;
        let of_stone = Found {
            is_called_loose: motion(k).loose,
            is_called_moved: moved.contains(&k),
            absolute: is_known.then(|| in_face((error, spread))),
            free: in_face((error - of_errors.at(place(k)), spread + rigid)),
            relative: in_face((motion(k).relative - own, motion(k).relative_covariance)),
            deformation: deformed.get(&pair.ids[k]).copied().map(in_face),
        };
        (pair.ids[k], of_stone)
    };
    all.clone().map(claim).collect()
}

/// Errors of the deformations: against the true motion less its rigid part, which is that of the stones outside
/// zones that kept their shape as far as they show.
fn true_deformations(wall: &Wall, pair: &Pair) -> BTreeMap<StoneId, Claim> {
    let Pair {
        places, deformation, ..
    } = pair;
    let results = pair.report.results.iter();
    let loose: BTreeSet<StoneId> = results
        .filter(|r| r.motion.as_ref().is_ok_and(|m| m.loose))
        .map(|r| r.first)
        .collect();
    let truth = |id: &StoneId| wall.truth[&id.0].displacement(&places[id]);
    let kept = deformation.stones.iter().filter(|s| {
        let in_sd = s
            .deformation
            .component_div(&s.covariance.diagonal().map(f64::sqrt));
        s.zone == 0 && !loose.contains(&s.stone) && in_sd.amax() < DEFORMED_SD
    });
    let sample = |s: &StoneDeformation| DisplacementSample {
        place: places[&s.stone],
        displacement: truth(&s.stone),
        covariance: Matrix3::identity(),
    };
    let Some(rigid) = SmallMotion::fit(&kept.map(sample).collect::<Vec<_>>()) else {
        return BTreeMap::new();
    };
    let error = |s: &StoneDeformation| {
        let deformed = truth(&s.stone) - rigid.at(&places[&s.stone]);
        (s.stone, (s.deformation - deformed, s.covariance))
    };
    deformation.stones.iter().map(error).collect()
}

/// The zone that holds the stone nearest to the middle of an area.
fn zone_over<'a>(area: &Area, places: &Places, deformation: &'a Deformation) -> Option<&'a DeformationZone> {
    let apart = |s: &&StoneDeformation| (places[&s.stone] - area.middle).norm();
    let nearest = deformation
        .stones
        .iter()
        .min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
    deformation.zones.iter().find(|z| z.number == nearest.zone)
}

/// Zones in which nothing truly moved; one where a deformation is claimed of a still wall without saying where.
fn false_zones(wall: &Wall, places: &Places, deformation: &Deformation) -> usize {
    let is_false = |zone: &&DeformationZone| {
        let moved = |id: &StoneId| wall.truth[&id.0].displacement(&places[id]).norm();
        zone.stones
            .iter()
            .all(|id| moved(id) < MOVED_SHARE * zone.largest_m)
    };
    match wall.is_still && deformation.is_shown() && deformation.zones.is_empty() {
        true => 1,
        false => deformation.zones.iter().filter(is_false).count(),
    }
}

/// The measured stones as the sources show them.
struct Seen {
    sources: Vec<Source>,
    ids: Vec<StoneId>,
    stones: Vec<SeenStone>,
    stable: Vec<StablePoints>,
}

impl Seen {
    fn new(wall: &Wall, report: &AdjustmentReport) -> Self {
        let all: BTreeSet<(usize, usize)> = (0..2)
            .flat_map(|e| wall.epochs[e].values().flatten().map(move |p| (e, p.source)))
            .collect();
        let source = |(epoch, number): &(usize, usize)| Source {
            name: format!("{epoch}/{number}"),
            epoch: *epoch,
            has_times: wall.has_times[*epoch],
            same_as: None,
        };
        let sources = all.iter().map(source).collect();
        let numbers: BTreeMap<(usize, usize), usize> = all.into_iter().zip(0..).collect();
        let number = |epoch, source| numbers[&(epoch, source)];
        let measured = report.results.iter().filter(|r| r.motion.is_ok());
        let (ids, stones) = measured
            .filter_map(|r| {
                let normal = wall.truth.get(&r.first.0)?.normal;
                Some((r.first, seen_stone(&wall.epochs, r.first.0, &normal, number)?))
            })
            .unzip();
        let mut areas: BTreeMap<usize, Vec<&SurveyPoint>> = BTreeMap::new();
        for (epoch, points) in wall.epochs.iter().enumerate().filter(|_| wall.has_stable) {
            for p in points
                .get(&0)
                .into_iter()
                .flatten()
                .filter(|p| is_stable(&p.place))
            {
                areas.entry(number(epoch, p.source)).or_default().push(p);
            }
        }
        let stable = |(source, points): (usize, Vec<&SurveyPoint>)| StablePoints {
            area: 0,
            source,
            points: Cloud::from_world(Point3::origin(), points.iter().map(|p| p.place)),
            times_s: points.iter().map(|p| p.time_s).collect(),
        };
        Self {
            sources,
            ids,
            stones,
            stable: areas.into_iter().map(stable).collect(),
        }
    }

    fn errors(&self, wall: &Wall, report: &AdjustmentReport) -> Result<EpochErrors, Failure> {
        let pair = EpochPair {
            stable: &self.stable,
            network: wall.network.as_ref(),
            response: report.joint.as_ref().map(|motions| Response {
                motions,
                stones: &self.ids,
            }),
            ..EpochPair::new(
                &self.sources,
                &self.stones,
                report.sigma_m[0].max(report.sigma_m[1]),
            )
        };
        Ok(epoch_errors(&pair, &EpochErrorParams::default(), &Silent)?)
    }
}

/// The ground and the small building before the wall.
fn is_stable(place: &Point3<f64>) -> bool {
    place.x > 0.35 && place.z < 2.6
}
