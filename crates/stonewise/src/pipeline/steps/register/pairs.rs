//! Points of matched stones, gathered from the tiles of two epochs into batches of neighbours on disk.

use crate::error::{Error, Result};
use crate::pipeline::steps::label::Labelled;
use crate::storage::spill::{Spill, SpillBins};
use crate::storage::step::StepDir;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::{fs, io};
use stonewise_core::cloud::TileSource;
use stonewise_core::epoch::Pair;
use stonewise_core::id::StoneId;
use stonewise_core::progress::Progress;
use stonewise_core::registration::{
    MatchedPair, NearPoint, PairPlaces, PairPoints, PairSource, StoneExtents, Window, stone_points,
};

/// Stones in a batch: at 20,000 points an epoch, 30 MB, and twice as much while it is read. Up to eight are in memory
/// at a time.
const BATCH: usize = 64;

/// Matched pairs whose points lie in one file a batch.
pub struct DiskPairs {
    dir: PathBuf,
    /// All batches are full but the last.
    batches: Vec<Vec<MatchedPair>>,
    /// Where the points of each pair count, per batch.
    windows: Vec<Vec<Option<Arc<Window>>>>,
}

impl DiskPairs {
    /// Gathers the points of the matched stones of two epochs into the step's folder.
    ///
    /// Nearer to the border of a stone than `border_noises` times the noise, points are chosen by their place
    /// instead of by their label, see [`stone_points`].
    pub fn gather(
        labelled: Pair<&Labelled>,
        matches: &[(StoneId, StoneId)],
        border_noises: f64,
        step: &StepDir,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let mut pairs = Self {
            dir: step.path().to_path_buf(),
            batches: MatchedPair::of_matches(&labelled.first.stones, &labelled.later.stones, matches)
                .chunks(BATCH)
                .map(<[_]>::to_vec)
                .collect(),
            windows: Vec::new(),
        };
        let mut spill = Spill::new(&step.file("spill"), |k: &u32| format!("b{k}"))?;
        let extents = match border_noises > 0.0 {
            true => labelled.first.extents(progress)?,
            false => StoneExtents::default(),
        };
        pairs.spill(labelled.first, 0, &extents, &mut spill, progress)?;
        pairs.spill(labelled.later, 1, &extents, &mut spill, progress)?;
        let bins = spill.finish()?;
        pairs.windows = (0..pairs.batches.len())
            .into_par_iter()
            .map(|b| pairs.write_batch(&bins, b, border_noises))
            .collect::<Result<_>>()?;
        Ok(pairs)
    }

    /// How the stones around each pair of a batch moved, metres.
    pub fn shifts(&self, batch: usize) -> Vec<Vector3<f64>> {
        self.batches[batch].iter().map(|p| p.shift).collect()
    }

    /// Removes the files, which are not needed once the motions are known.
    pub fn remove(self) -> Result<()> {
        (0..self.batches.len()).try_for_each(|batch| {
            let path = self.file(batch);
            fs::remove_file(&path).map_err(Error::io("removing", &path))
        })
    }

    /// Writes the file of a batch, which every iteration reads again: for each pair the points of the first epoch, of
    /// the second, and of those near the stone in the second without its label. Each list is its number of points, then
    /// their offsets from the stone's centroid in the first epoch, metres; little-endian, 32 bits each. Returns the
    /// windows in which the points count.
    fn write_batch(
        &self,
        bins: &SpillBins<u32>,
        batch: usize,
        border_noises: f64,
    ) -> Result<Vec<Option<Arc<Window>>>> {
        let key = batch as u32;
        let bytes = if bins.keys().contains(&key) {
            bins.read(&key)?
        } else {
            Vec::new()
        };
        let mut near = vec![[Vec::new(), Vec::new()]; self.batches[batch].len()];

        for record in bytes.chunks_exact(RECORD) {
            let (slot, epoch, point) = decode(record);
            near[slot][epoch].push(point);
        }

        let mut bytes = Vec::new();
        let mut windows = Vec::new();
        for ([one, two], pair) in near.iter().zip(&self.batches[batch]) {
            let chosen = stone_points([one, two], &pair.first.normal, &pair.shift, border_noises);
            windows.push(chosen.window.map(Arc::new));
            for part in [chosen.first, chosen.second, chosen.nearby_second] {
                bytes.extend((part.len() as u32).to_le_bytes());
                bytes.extend(part.iter().flatten().flat_map(|x| x.to_le_bytes()));
            }
        }

        let path = self.file(batch);
        fs::write(&path, &bytes).map_err(Error::io("writing", &path))?;
        Ok(windows)
    }

    fn file(&self, batch: usize) -> PathBuf {
        self.dir.join(format!("pairs-{batch:05}.bin"))
    }

    /// Sends every point of a matched stone, and every other point in its box, to its batch, relative to the
    /// stone's centroid in the first epoch. `extents`: boxes of the first epoch's stones.
    fn spill(
        &self,
        epoch: &Labelled,
        which: u16,
        extents: &StoneExtents,
        spill: &mut Spill<u32>,
        progress: &dyn Progress,
    ) -> Result<()> {
        let places = PairPlaces::new(&self.batches.concat(), which > 0, extents);
        let tiles = &epoch.ingested.tiles;
        let records = |tile| -> Result<_> {
            let mut records: BTreeMap<u32, Vec<u8>> = BTreeMap::new();
            let labels = epoch.labels(tile)?;
            if places.reach_into(&tiles.bounds(tile)) || labels.stone.iter().any(|s| places.has(*s)) {
                let (cloud, origins) = (tiles.load(tile)?, tiles.surveyed.origins(tile)?);
                for (i, stone) in labels.stone.iter().enumerate() {
                    for (k, near) in places.near(cloud.world(i), *stone) {
                        let (batch, slot) = ((k / BATCH) as u32, (k % BATCH) as u16);
                        let source = origins.source[i];
                        let near = NearPoint { source, ..near };
                        let of_batch = records.entry(batch).or_default();
                        of_batch.extend(encode(slot, which, near));
                    }
                }
            }
            Ok(records)
        };
        let all = 0..tiles.tile_count();
        progress.each_prepared("gather stones", all, records, |_, records| {
            for (batch, records) in &records {
                spill.push(*batch, records)?;
            }
            Ok(())
        })
    }
}

impl PairSource for DiskPairs {
    type Error = Error;

    fn batch_count(&self) -> usize {
        self.batches.len()
    }

    fn load(&self, batch: usize) -> Result<Vec<PairPoints>> {
        let pairs = &self.batches[batch];
        let path = self.file(batch);
        let bytes = fs::read(&path).map_err(Error::io("reading", &path))?;
        let mut rest = bytes.as_slice();
        let mut part = || {
            let (count, after) = rest.split_first_chunk()?;
            let (points, after) = after.split_at_checked(POINT * u32::from_le_bytes(*count) as usize)?;
            rest = after;
            Some(points.as_chunks().0.iter().map(offset).collect())
        };
        let offsets: Option<Vec<[Vec<[f32; 3]>; 3]>> =
            pairs.iter().map(|_| Some([part()?, part()?, part()?])).collect();
        let offsets = offsets.filter(|_| rest.is_empty()).ok_or_else(|| {
            let damaged = io::Error::from(io::ErrorKind::InvalidData);
            Error::io("reading", &path)(damaged)
        })?;
        let loaded = pairs.iter().zip(offsets).zip(&self.windows[batch]);
        let loaded = loaded.map(|((pair, offsets), window)| pair.with_points(offsets, window.clone()));
        Ok(loaded.collect())
    }
}

/// Bytes of a point in a batch's file.
const POINT: usize = 12;

/// The offset of a point in a batch's file.
fn offset(bytes: &[u8; POINT]) -> [f32; 3] {
    let axes = bytes.as_chunks().0;
    [0, 1, 2].map(|k| f32::from_le_bytes(axes[k]))
}

const RECORD: usize = 16;

/// Bit beside the epoch's number: the point has the label of the stone. The source stands above it.
const LABELLED: u16 = 2;
const SOURCE_SHIFT: u32 = 2;
/// Sources beyond this share its number.
const LAST_SOURCE: u32 = (u16::MAX >> SOURCE_SHIFT) as u32;

fn encode(slot: u16, epoch: u16, point: NearPoint) -> [u8; RECORD] {
    let mut record = [0; RECORD];
    let flags = epoch
        | if point.labelled { LABELLED } else { 0 }
        | (point.source.min(LAST_SOURCE) as u16) << SOURCE_SHIFT;
    record[..2].copy_from_slice(&slot.to_le_bytes());
    record[2..4].copy_from_slice(&flags.to_le_bytes());
    for axis in 0..3 {
        record[4 + 4 * axis..8 + 4 * axis].copy_from_slice(&point.offset[axis].to_le_bytes());
    }
    record
}

fn decode(record: &[u8]) -> (usize, usize, NearPoint) {
    let short = |at: usize| u16::from_le_bytes([record[at], record[at + 1]]);
    let real = |at: usize| f32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]]);
    let flags = short(2);
    let point = NearPoint {
        offset: [real(4), real(8), real(12)],
        labelled: flags & LABELLED != 0,
        source: u32::from(flags >> SOURCE_SHIFT),
    };
    (usize::from(short(0)), usize::from(flags & 1), point)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;
    use stonewise_core::stone::Stone;

    fn stone(id: u32) -> Stone {
        Stone {
            id: StoneId(id),
            centroid: Point3::new(f64::from(id), 0.0, 0.0),
            normal: Vector3::y(),
            area_m2: 0.1,
            points: 100,
            photos: 1,
            confidence: 1.0,
        }
    }

    /// Points of a stone of 10 x 10 cm in an epoch, `count` of them.
    fn points(epoch: u16, count: u16) -> Vec<NearPoint> {
        let place = |k: u16| f32::from(k % 10) * 0.01 + f32::from(epoch) * 1e-4;
        (0..count)
            .map(|k| NearPoint {
                offset: [place(k), 0.0, f32::from(k / 10) * 0.01],
                labelled: true,
                source: 3,
            })
            .collect()
    }

    #[test]
    fn points_that_were_written_are_read_again_and_a_cut_off_file_is_an_error() {
        let dir = tempfile::tempdir().unwrap();
        let pair = |id| MatchedPair {
            first: stone(id),
            second: stone(id),
            shift: Vector3::zeros(),
        };
        // The second pair has no point in the second epoch.
        let near = [[points(0, 60), points(1, 90)], [points(0, 20), Vec::new()]];
        let mut spill = Spill::new(&dir.path().join("spill"), |k: &u32| format!("b{k}")).unwrap();
        for (slot, epochs) in (0..).zip(&near) {
            for (epoch, points) in (0..).zip(epochs) {
                for point in points {
                    spill.push(0, &encode(slot, epoch, *point)).unwrap();
                }
            }
        }
        let mut pairs = DiskPairs {
            dir: dir.path().to_path_buf(),
            batches: vec![vec![pair(1), pair(2)]],
            windows: Vec::new(),
        };
        let windows = pairs.write_batch(&spill.finish().unwrap(), 0, 0.0).unwrap();
        pairs.windows.push(windows);

        let found = pairs.load(0).unwrap();
        assert_eq!(found.len(), 2);
        for (found, [one, two]) in found.iter().zip(&near) {
            let chosen = stone_points([one, two], &Vector3::y(), &Vector3::zeros(), 0.0);
            for (cloud, expected) in [
                (&found.points_first, &chosen.first),
                (&found.points_second, &chosen.second),
                (&found.nearby_second, &chosen.nearby_second),
            ] {
                assert_eq!(cloud.len(), expected.len());
                for (i, point) in expected.iter().enumerate() {
                    assert_eq!(cloud.local(i).coords.cast::<f32>(), Vector3::from(*point));
                }
            }
        }
        assert!(found[0].points_second.len() == 90 && found[1].points_second.is_empty());

        let bytes = fs::read(pairs.file(0)).unwrap();
        for damaged in [
            &bytes[..bytes.len() - 1],
            &bytes[..2],
            &[bytes.as_slice(), &[0]].concat(),
        ] {
            fs::write(pairs.file(0), damaged).unwrap();
            let message = pairs.load(0).unwrap_err().to_string();
            assert!(message.contains("pairs-00000.bin"), "{message}");
        }
    }
}
