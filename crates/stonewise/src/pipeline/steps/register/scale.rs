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
    let mut of_epochs = [None; 2];
    let mut instruments = [SCANNER_SCALE; 2];
    for (k, (id, labelled)) in epochs.zip(labelled).into_iter().enumerate() {
        let distances = || project.distances.iter().filter(|d| d.epoch == id);
        distances().try_for_each(|distance| check_ends(distance, labelled))?;
        of_epochs[k] = measured(distances());
        if project.epochs[id].found_origin()? == Some(Origin::Photos) {
            instruments[k] = PHOTO_SCALE;
        }
    }
    let [first, later] = [0, 1].map(|k| of_epochs[k].unwrap_or([0.0, instruments[k]]));
    Ok(Some(KnownScale {
        mean: later[0] - first[0],
        sd: later[1].hypot(first[1]),
        is_measured: of_epochs.iter().any(Option::is_some),
    }))
}

/// The scale that known lengths show, and its standard deviation; `None` without any. What the instrument promises does
/// not count beside them.
fn measured<'a>(distances: impl Iterator<Item = &'a Distance>) -> Option<[f64; 2]> {
    let (mut information, mut sum) = (0.0, 0.0);
    for distance in distances {
        let [from, to] = distance.ends;
        let scale = (to - from).norm() / distance.length_m - 1.0;
        let weight = (distance.length_m / distance.sd_m.max(LEAST_SD_M)).powi(2);
        (information, sum) = (information + weight, sum + weight * scale);
    }
    (information > 0.0).then(|| [sum / information, information.sqrt().recip()])
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
}
