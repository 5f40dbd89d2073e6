//! What is known of the scale of a later epoch against the reference.

use super::datum::is_one_survey;
use crate::error::Result;
use crate::pipeline::steps::label::Labelled;
use crate::project::{Distance, Origin, Project};
use nalgebra::{Point3, Vector3};
use stonewise_core::cloud::TileSource;
use stonewise_core::epoch::{EpochId, Pair};
use stonewise_core::geometry::Bounds;
use stonewise_core::registration::observers::{KnownScale, PhotoNetwork};
use stonewise_core::statistics::NONCENTRALITY;

/// Standard deviation of the scale of a scanner: 10 to 20 mm per km of its distance meter, and the air.
const SCANNER_SCALE: f64 = 2e-5;
/// That of photos without a known length: what control points and positions of cameras usually leave.
const PHOTO_SCALE: f64 = 1e-3;
/// Least standard deviation of a length, metres: no tape and no cloud is better.
const LEAST_SD_M: f64 = 1e-5;
/// Farthest that an end of a known length lies from the cloud, metres.
const REACH_M: f64 = 0.05;

/// The scale as instruments or known lengths leave it; `None` where the epochs share it.
///
/// # Errors
/// An end of a length lies off its cloud; a tile or a cloud cannot be read.
pub(super) fn known_scale(
    project: &Project,
    epochs: Pair<EpochId>,
    labelled: Pair<&Labelled>,
    network: Option<&PhotoNetwork>,
) -> Result<Option<KnownScale>> {
    let is_one_bundle = network.is_some_and(|n| n.is_joint && n.photos.iter().all(|p| !p.is_empty()));
    if is_one_survey(project, epochs) || is_one_bundle {
        return Ok(None);
    }
    for (id, labelled) in epochs.zip(labelled).into_iter() {
        { lengths_of(project, id) }.try_for_each(|distance| check_ends(distance, labelled))?;
    }
    let [first, later] = epochs.into_array();
    let (first_scale, later_scale) = (scale_of(project, first)?, scale_of(project, later)?);
    let mut both = [first, later].into_iter();
    Ok(Some(KnownScale {
        mean: later_scale[0] - first_scale[0],
        sd: later_scale[1].hypot(first_scale[1]),
        is_measured: both.any(|id| lengths_of(project, id).next().is_some()),
    }))
}

/// What a known length does to the scale.
pub struct LengthInfluence<'a> {
    /// The length.
    pub distance: &'a Distance,
    /// Its redundancy number.
    pub redundancy: f64,
    /// Smallest error of it that the other lengths of its epoch find, metres; `None` where there are none.
    pub smallest_blunder_m: Option<f64>,
    /// What leaving it out adds to the scale of the later epoch against the reference.
    pub change: f64,
}

/// What each known length of two epochs does to their scale.
///
/// # Errors
/// A cloud cannot be read.
pub fn length_influences(project: &Project, epochs: Pair<EpochId>) -> Result<Vec<LengthInfluence<'_>>> {
    let mut all = Vec::new();
    for (id, sign) in epochs.into_array().into_iter().zip([-1.0, 1.0]) {
        let lengths: Vec<&Distance> = lengths_of(project, id).collect();
        if !lengths.is_empty() {
            all.extend(influences(&lengths, by_instrument(project, id)?, sign));
        }
    }
    Ok(all)
}

/// `unmeasured`: the scale without any length, with its standard deviation; `sign`: of the epoch's scale in that of the
/// later epoch against the reference.
fn influences<'a>(lengths: &[&'a Distance], unmeasured: [f64; 2], sign: f64) -> Vec<LengthInfluence<'a>> {
    let [scale, sd] = measured(lengths.iter().copied()).unwrap_or(unmeasured);
    let of_one = |(k, distance): (usize, &&'a Distance)| {
        let others = lengths.iter().enumerate().filter(|(other, _)| *other != k);
        let [without, _] = measured(others.map(|(_, d)| *d)).unwrap_or(unmeasured);
        let redundancy = match lengths.len() {
            1 => 0.0,
            _ => 1.0 - sd * sd * information(distance),
        };
        let blunder_m = NONCENTRALITY * distance.sd_m.max(LEAST_SD_M) / redundancy.sqrt();
        LengthInfluence {
            distance,
            redundancy,
            smallest_blunder_m: Some(blunder_m).filter(|m| m.is_finite()),
            change: sign * (without - scale),
        }
    };
    lengths.iter().enumerate().map(of_one).collect()
}

fn lengths_of(project: &Project, id: EpochId) -> impl Iterator<Item = &Distance> {
    project.distances.iter().filter(move |d| d.epoch == id)
}

/// The scale of an epoch and its standard deviation.
fn scale_of(project: &Project, id: EpochId) -> Result<[f64; 2]> {
    let by_instrument = by_instrument(project, id)?;
    Ok(measured(lengths_of(project, id)).unwrap_or(by_instrument))
}

/// The scale of an epoch without known lengths, and its standard deviation.
fn by_instrument(project: &Project, id: EpochId) -> Result<[f64; 2]> {
    let sd = match project.epochs[id].found_origin()? {
        Some(Origin::Photos) => PHOTO_SCALE,
        _ => SCANNER_SCALE,
    };
    Ok([0.0, sd])
}

/// The scale that known lengths show, and its standard deviation; `None` without any. What the instrument promises does
/// not count beside them.
fn measured<'a>(distances: impl Iterator<Item = &'a Distance>) -> Option<[f64; 2]> {
    let (mut total, mut sum) = (0.0, 0.0);
    for distance in distances {
        let [from, to] = distance.ends;
        let scale = (to - from).norm() / distance.length_m - 1.0;
        let weight = information(distance);
        (total, sum) = (total + weight, sum + weight * scale);
    }
    (total > 0.0).then(|| [sum / total, total.sqrt().recip()])
}

/// What a length says of the scale, as the inverse of a variance.
fn information(distance: &Distance) -> f64 {
    (distance.length_m / distance.sd_m.max(LEAST_SD_M)).powi(2)
}

/// Refuses ends that lie off the cloud of their epoch.
fn check_ends(distance: &Distance, labelled: &Labelled) -> Result<()> {
    let tiles = &labelled.ingested.tiles;
    let reach = Vector3::repeat(REACH_M);
    for (name, end) in ["from", "to"].into_iter().zip(distance.ends) {
        let around = Bounds {
            min: end - reach,
            max: end + reach,
        };
        let mut is_near = false;
        for tile in (0..tiles.tile_count()).filter(|&t| tiles.bounds(t).intersects(&around)) {
            let cloud = tiles.load(tile)?;
            let apart = |place: Point3<f64>| (place - end).norm();
            is_near |= (0..cloud.len()).any(|i| apart(cloud.world(i)) <= REACH_M);
        }
        if !is_near {
            let [x, y, z] = [end.x, end.y, end.z];
            return Err(distance.error(format!(
                "{name} = [{x}, {y}, {z}] lies more than 5 cm from every point of the epoch's cloud: read the ends off the cloud"
            )));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    fn distance(found_m: f64, length_m: f64, sd_m: f64) -> Distance {
        Distance {
            epoch: EpochId::REFERENCE,
            ends: [Point3::new(1.0, 2.0, 3.0), Point3::new(1.0, 2.0 + found_m, 3.0)],
            length_m,
            sd_m,
            stated: (PathBuf::new(), 1),
        }
    }

    #[test]
    fn lengths_count_by_their_accuracy() {
        assert_eq!(measured([].iter()), None);
        let one = measured([distance(10.01, 10.0, 0.002)].iter()).unwrap();
        assert!(
            (one[0] - 1e-3).abs() < 1e-12 && (one[1] - 2e-4).abs() < 1e-12,
            "{one:?}"
        );
        // 1.0e-3 +- 2e-4 and 0.5e-3 +- 1e-4: weights of one to four.
        let two = measured([distance(10.01, 10.0, 0.002), distance(20.01, 20.0, 0.002)].iter()).unwrap();
        assert!((two[0] - 0.6e-3).abs() < 1e-12, "{two:?}");
        assert!((two[1] - 2e-4 / 5f64.sqrt()).abs() < 1e-12, "{two:?}");
    }

    #[test]
    fn a_length_that_is_left_out_leaves_the_scale_of_the_others() {
        let lengths = [distance(10.01, 10.0, 0.002), distance(20.01, 20.0, 0.002)];
        let both = influences(&[&lengths[0], &lengths[1]], [0.0, 1e-3], -1.0);
        // Weights of one to four: 1.0e-3 without the second, 0.5e-3 without the first, 0.6e-3 with both.
        let near = |found: f64, expected: f64| (found - expected).abs() < 1e-9;
        assert!(near(both[0].redundancy, 0.8) && near(both[1].redundancy, 0.2));
        assert!(near(both[0].change, 0.1e-3) && near(both[1].change, -0.4e-3));
        // The difference of the lengths' scales, 2.236e-4, in metres of each.
        let blunders = [10.0, 20.0].map(|length_m| 4.13 * 2.236_068e-4 * length_m);
        assert!(near(both[0].smallest_blunder_m.unwrap(), blunders[0]));
        assert!(near(both[1].smallest_blunder_m.unwrap(), blunders[1]));
        let alone = influences(&[&lengths[0]], [0.0, 1e-3], 1.0);
        assert_eq!((alone[0].redundancy, alone[0].smallest_blunder_m), (0.0, None));
        assert!(near(alone[0].change, -1e-3));
    }
}
