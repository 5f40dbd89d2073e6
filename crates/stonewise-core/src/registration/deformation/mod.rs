//! Deformation: what the wall did besides moving as one rigid body.
//!
//! The deformation of a stone is its motion less the rigid motion of the part of the wall that kept its shape.
//! Errors that all stones share, the datum above all, drop out of it; those of single stations, strips and photos
//! stay in as far as they differ between the stones. The rigid part is the largest congruent one (`rigid_part`).
//! Whether the wall deformed at all is tested by the most likely bulge of any place, size and direction
//! (`scan`), and where it did follows from the peaks of its stones' deformation (`zones`). Congruence tests of point
//! networks: Pelzer 1971, Niemeier 1981.

mod areas;
mod body;
mod bulge;
mod extent;
mod found;
mod frames;
mod rigid_part;
mod scan;
mod shape;
mod shared_errors;
#[cfg(test)]
mod size_tests;
mod smoothed;
#[cfg(test)]
mod tests;
mod zones;

use super::adjustment::JointMotions;
use super::observers::JointErrors;
use crate::id::StoneId;
use crate::progress::{Interrupted, Progress};
use body::Body;
use found::LEVEL;
pub use found::{Against, Deformation, DeformationZone, StoneDeformation, ZONE_EXTENTS_M, ZoneKind};
use rigid_part::{RigidPart, rigid_part};
use scan::{Scan, scan};
use std::collections::BTreeMap;
use zones::Wall;

/// Fewest stones of a part of the wall whose shape is judged: four times what a rigid motion needs.
const LEAST_STONES: usize = 12;

/// How the wall deformed, from the motions of its stones and the error of the later epoch at them.
///
/// `error_stones`: the stones at which the error is given, in its order; stones without one count as free of it.
/// Parts of the wall that are not neighbours are judged by themselves; where there are several, `p` is that of the
/// least probable, times their number (Bonferroni).
///
/// Cost: about thirty solves of the field, and a thousand simulations of what the stones show of a still wall;
/// linear in the stones.
///
/// # Errors
/// The caller stopped the work.
pub fn deformation(
    motions: &JointMotions,
    errors: Option<(&JointErrors, &[StoneId])>,
    progress: &dyn Progress,
) -> Result<Deformation, Interrupted> {
    let mut found = Deformation::default();
    let bodies = Body::all(motions, errors, LEAST_STONES);
    let mut judged: Vec<(Body, RigidPart, Scan)> = Vec::new();
    for body in bodies {
        progress.check()?;
        let (Some(rigid), Some(scan)) = (rigid_part(&body), scan(&body)) else {
            continue;
        };
        judged.push((body, rigid, scan));
    }
    let count = judged.len() as f64;
    let least = judged.iter().map(|(_, _, scan)| scan.p).reduce(f64::min);
    found.p = least.map(|p| (p * count).min(1.0));
    if let Some((_, _, scan)) = judged.first() {
        found.detection_limits_m = scan.detection_limits_m;
        found.limits_in_face_m = scan.limits_in_face_m;
    }
    let mut by_stone: BTreeMap<StoneId, StoneDeformation> = BTreeMap::new();
    let against = match judged.len() {
        1 => Against::RestOfWall,
        _ => Against::RestOfPart,
    };
    for (body, rigid, scan) in &mut judged {
        let is_shown = scan.p * count <= LEVEL;
        if is_shown {
            rigid.doubt_smoothed(body, &scan.most_likely);
        }
        rigid.widen(&scan.smoothed);
        let found_of = rigid.deformations.iter().zip(&rigid.smoothed);
        for (stone, ((deformation, covariance), smoothed)) in body.stones.iter().zip(found_of) {
            let row = StoneDeformation {
                stone: stone.id,
                deformation: *deformation,
                covariance: *covariance,
                smoothed: *smoothed,
                zone: 0,
            };
            by_stone.insert(stone.id, row);
        }
        if is_shown {
            let wall = Wall::new(body, rigid, against);
            match wall.zones() {
                zones if zones.is_empty() => found.zones.push(wall.bulge(scan)),
                zones => found.zones.extend(zones),
            }
        }
    }
    found.zones.sort_by(|a, b| b.largest_m.total_cmp(&a.largest_m));
    for (number, zone) in (1..).zip(&mut found.zones) {
        zone.number = number;
        for stone in &zone.stones {
            if let Some(row) = by_stone.get_mut(stone).filter(|row| row.zone == 0) {
                row.zone = number;
            }
        }
    }
    found.stones = by_stone.into_values().collect();
    Ok(found)
}
