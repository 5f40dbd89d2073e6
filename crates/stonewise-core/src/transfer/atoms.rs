//! Pieces of surface that every photo sees alike.

use super::TransferError;
use super::visibility::{Observer, Sighting};
use crate::cloud::{Cloud, TileSource};
use crate::geometry::{CellMap, CellSet, cell_of};
use crate::progress::Progress;
use rayon::prelude::*;

/// All sampled points that have the same sightings: the photos that see them, and the instance in each.
///
/// The number of atoms follows the length of the mask borders, not the number of points; everything that must
/// be decided about stones as a whole is decided on atoms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Atom<'a> {
    /// Sightings in the order of photos, each with the mean weight over the atom.
    pub sightings: &'a [Sighting],
    /// Number of sampled points: area in units of the sampling voxel's face.
    pub area: u32,
}

/// Atoms one after the other: 12 bytes a sighting and 12 an atom.
#[derive(Default)]
pub(super) struct Atoms {
    sightings: Vec<Sighting>,
    /// Where the sightings of each atom end.
    ends: Vec<usize>,
    areas: Vec<u32>,
}

impl Atoms {
    pub(super) fn push(&mut self, sightings: impl IntoIterator<Item = Sighting>, area: u32) {
        self.sightings.extend(sightings);
        self.ends.push(self.sightings.len());
        self.areas.push(area);
    }

    fn append(&mut self, others: &Self) {
        let before = self.sightings.len();
        self.sightings.extend_from_slice(&others.sightings);
        self.ends.extend(others.ends.iter().map(|end| before + end));
        self.areas.extend_from_slice(&others.areas);
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = Atom<'_>> {
        (0..self.areas.len()).map(|i| self.get(i))
    }

    fn get(&self, i: usize) -> Atom<'_> {
        let start = i.checked_sub(1).map_or(0, |before| self.ends[before]);
        Atom {
            sightings: &self.sightings[start..self.ends[i]],
            area: self.areas[i],
        }
    }

    /// Joins those of equal sightings; the result ascends by them.
    fn joined(self) -> Self {
        let mut order: Vec<u32> = (0..self.areas.len() as u32).collect();
        let atom = |i: &u32| self.get(*i as usize);
        // A stable sort: sums run from cell to cell and from tile to tile for any number of threads.
        order.par_sort_by(|a, b| keys(atom(a).sightings).cmp(keys(atom(b).sightings)));
        let mut joined = Self::default();
        for equal in order.chunk_by(|a, b| keys(atom(a).sightings).eq(keys(atom(b).sightings))) {
            let area: u32 = equal.iter().map(|i| atom(i).area).sum();
            let mean = |(k, sighting): (usize, &Sighting)| {
                let weighted = |i| f64::from(atom(i).area) * f64::from(atom(i).sightings[k].weight);
                Sighting {
                    weight: (equal.iter().map(weighted).sum::<f64>() / f64::from(area)) as f32,
                    ..*sighting
                }
            };
            joined.push(atom(&equal[0]).sightings.iter().enumerate().map(mean), area);
        }
        joined
    }
}

/// Atoms of the whole cloud, thinned to one point a voxel, in ascending order of their sightings.
///
/// Deterministic: the first point of a voxel in the tile's order is its sample, and sums run in that order
/// within each cell of the surface, then from cell to cell of a tile, then from tile to tile. Memory: the atoms of
/// every tile, then the joined ones beside them.
pub(super) fn gather_atoms<T: TileSource>(
    tiles: &T,
    observer: &Observer,
    sample_m: f64,
    progress: &dyn Progress,
) -> Result<Atoms, TransferError> {
    let mut parts = Atoms::default();
    let load = |tile| -> Result<_, TransferError> {
        let candidates = observer.candidates(&tiles.bounds(tile));
        if candidates.is_empty() {
            return Ok(None);
        }
        let cloud = tiles.load(tile).map_err(|e| TransferError::tile(tile, e))?;
        let chosen = thin(&cloud, sample_m);
        Ok(Some((cloud, chosen, candidates)))
    };
    progress.each_prepared("sightings", 0..tiles.tile_count(), load, |tile, loaded| {
        if let Some((cloud, chosen, candidates)) = loaded {
            let mut in_tile = Atoms::default();
            for cell in observer.sight_cells(tile, &cloud, &chosen, &candidates, CellAtoms::add) {
                cell.finish(&mut in_tile);
            }
            parts.append(&in_tile.joined());
        }
        Ok(())
    })?;
    Ok(parts.joined())
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

/// Area, and the sum of the weights of each sighting.
type Sums = (u32, Vec<f64>);

/// The atoms of a cell of the surface while its points come in.
#[derive(Default)]
struct CellAtoms {
    sums: CellMap<Vec<(u32, u32)>, Sums>,
    /// Photos and instances of the last point.
    keys: Vec<(u32, u32)>,
}

impl CellAtoms {
    /// Adds a point, unless no photo shows it on a stone.
    fn add(&mut self, _: u32, sightings: &[Sighting]) {
        if sightings.iter().all(|s| s.instance == 0) {
            return;
        }
        self.keys.clear();
        self.keys.extend(keys(sightings));
        let weights = sightings.iter().map(|s| f64::from(s.weight));
        match self.sums.get_mut(&self.keys) {
            Some((area, sums)) => {
                *area += 1;
                sums.iter_mut()
                    .zip(weights)
                    .for_each(|(sum, weight)| *sum += weight);
            }
            None => {
                self.sums.insert(self.keys.clone(), (1, weights.collect()));
            }
        }
    }

    fn finish(self, atoms: &mut Atoms) {
        for (keys, (area, sums)) in self.sums {
            let mean = |(&(photo, instance), sum): (&(u32, u32), &f64)| Sighting {
                photo,
                instance,
                weight: (sum / f64::from(area)) as f32,
            };
            atoms.push(keys.iter().zip(&sums).map(mean), area);
        }
    }
}

fn keys(sightings: &[Sighting]) -> impl Iterator<Item = (u32, u32)> {
    sightings.iter().map(|s| (s.photo, s.instance))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn atoms_of_equal_sightings_are_joined() {
        let sighting = |instance, weight| Sighting {
            photo: 0,
            instance,
            weight,
        };
        let mut parts = Atoms::default();
        for (instance, weight, area) in [(2, 1.0, 1), (1, 4.0, 5), (2, 3.0, 3)] {
            parts.push([sighting(instance, weight)], area);
        }
        let joined = parts.joined();
        let found: Vec<_> = joined.iter().map(|a| (a.sightings.to_vec(), a.area)).collect();
        assert_eq!(found, [(vec![sighting(1, 4.0)], 5), (vec![sighting(2, 2.5)], 4)]);
    }
}
