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
/// Farthest that an end of a known length lies from the cloud, metres.
const REACH_M: f64 = 0.05;

/// The scale as instruments and known lengths leave it; `None` where the epochs share it. `noise_m`: of single points, which
/// the ends of a length have.
///
/// # Errors
/// An end of a length lies off its cloud; a tile or a cloud cannot be read.
pub(super) fn known_scale(
    project: &Project,
    epochs: Pair<EpochId>,
    labelled: Pair<&Labelled>,
    network: Option<&PhotoNetwork>,
    noise_m: f64,
) -> Result<Option<KnownScale>> {
    let is_one_bundle = network.is_some_and(|n| n.is_joint && n.photos.iter().all(|p| !p.is_empty()));
    if is_one_survey(project, epochs) || is_one_bundle {
        return Ok(None);
    }
    let mut known = KnownScale {
        mean: 0.0,
        sd: 0.0,
        is_measured: false,
    };
    for ((id, labelled), sign) in epochs.zip(labelled).into_iter().zip([-1.0, 1.0]) {
        let sd = match project.epochs[id].found_origin()? {
            Some(Origin::Photos) => PHOTO_SCALE,
            Some(Origin::Scanner) | None => SCANNER_SCALE,
        };
        let (mut information, mut sum) = (sd.powi(-2), 0.0);
        for distance in project.distances.iter().filter(|d| d.epoch == id) {
            check_ends(distance, labelled)?;
            let [from, to] = distance.ends;
            let scale = (to - from).norm() / distance.length_m - 1.0;
            let variance = (distance.sd_m.powi(2) + 2.0 * noise_m.powi(2)) / distance.length_m.powi(2);
            let weight = variance.max(f64::MIN_POSITIVE).recip();
            (information, sum) = (information + weight, sum + weight * scale);
            known.is_measured = true;
        }
        known.mean += sign * sum / information;
        known.sd = known.sd.hypot(information.sqrt().recip());
    }
    Ok(Some(known))
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
