//! Pieces of surface that every photo sees alike.

use super::TransferError;
use super::visibility::{Observer, Sighting};
use crate::cloud::{Cloud, TileSource};
use crate::geometry::{CellMap, CellSet, cell_of};
use crate::progress::Progress;

/// All sampled points that have the same sightings: the photos that see them, and the instance in each.
///
/// The number of atoms follows the length of the mask borders, not the number of points; everything that must
/// be decided about stones as a whole is decided on atoms.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Atom {
    /// Sightings in the order of photos, each with the mean weight over the atom.
    pub sightings: Vec<Sighting>,
    /// Number of sampled points: area in units of the sampling voxel's face.
    pub area: u32,
}

type Signature = Vec<(u32, u32)>;

/// Atoms of the whole cloud, thinned to one point a voxel, in ascending order of their sightings.
///
/// Deterministic: the first point of a voxel in the tile's order is its sample, and sums run in that order.
pub(super) fn gather_atoms<T: TileSource>(
    tiles: &T,
    observer: &Observer,
    sample_m: f64,
    progress: &dyn Progress,
) -> Result<Vec<Atom>, TransferError> {
    let mut sums: CellMap<Signature, (u32, Vec<f64>)> = CellMap::default();
    progress.each(
        "sightings",
        0..tiles.tile_count(),
        |tile| -> Result<(), TransferError> {
            let candidates = observer.candidates(&tiles.bounds(tile));
            if !candidates.is_empty() {
                let cloud = tiles.load(tile).map_err(|e| TransferError::tile(tile, e))?;
                for sightings in sample(observer, tile, &cloud, &candidates, sample_m) {
                    add(&mut sums, &sightings);
                }
            }
            Ok(())
        },
    )?;
    let mut atoms: Vec<Atom> = sums.into_iter().map(finish).collect();
    atoms.sort_unstable_by(|a, b| keys(a).cmp(keys(b)));
    Ok(atoms)
}

/// Sightings of one point a voxel, without the points that no photo shows on a stone.
fn sample(
    observer: &Observer,
    tile: usize,
    cloud: &Cloud,
    candidates: &[u32],
    sample_m: f64,
) -> Vec<Vec<Sighting>> {
    let chosen = thin(cloud, sample_m);
    let mut sightings = observer.sight_all(tile, cloud, &chosen, candidates, <[Sighting]>::to_vec);
    sightings.retain(|found| found.iter().any(|s| s.instance != 0));
    sightings
}

/// The first point of every voxel of a world-aligned grid.
fn thin(cloud: &Cloud, voxel_m: f64) -> Vec<u32> {
    let mut taken = CellSet::default();
    let mut last = None;
    (0..cloud.len() as u32)
        .filter(|&i| {
            let voxel = cell_of(&cloud.world(i as usize), voxel_m);
            // Successive points mostly lie in the same voxel.
            last.replace(voxel) != Some(voxel) && taken.insert(voxel)
        })
        .collect()
}

fn add(sums: &mut CellMap<Signature, (u32, Vec<f64>)>, sightings: &[Sighting]) {
    let signature = sightings.iter().map(|s| (s.photo, s.instance)).collect();
    let (area, weights) = sums
        .entry(signature)
        .or_insert_with(|| (0, vec![0.0; sightings.len()]));
    *area += 1;
    for (sum, sighting) in weights.iter_mut().zip(sightings) {
        *sum += f64::from(sighting.weight);
    }
}

fn finish((signature, (area, weights)): (Signature, (u32, Vec<f64>))) -> Atom {
    let sightings = signature
        .iter()
        .zip(weights)
        .map(|(&(photo, instance), sum)| Sighting {
            photo,
            instance,
            weight: (sum / f64::from(area)) as f32,
        })
        .collect();
    Atom { sightings, area }
}

fn keys(atom: &Atom) -> impl Iterator<Item = (u32, u32)> {
    atom.sightings.iter().map(|s| (s.photo, s.instance))
}
