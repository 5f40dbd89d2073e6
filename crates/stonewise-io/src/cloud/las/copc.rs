//! Writing COPC 1.0: a LAZ file whose chunks are the nodes of an octree, from coarse to fine.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{BufReader, Read, Seek, SeekFrom, Write};
use std::path::Path;

use las::{Builder, Vlr};
use laz::LazVlr;
use laz::laszip::ChunkTable;
use nalgebra::{Point3, Vector3};
use stonewise_core::geometry::Bounds;

use super::writer::{LazWriter, unwritable};
use crate::cloud::CloudError;

const USER_ID: &str = "copc";
const DESCRIPTION: &str = "https://copc.io";
const INFO: u16 = 1;
const HIERARCHY: u16 = 1000;
const INFO_BYTES: usize = 160;
/// Places in a file of LAS 1.4: offset of the points, first extended record and number of these, content of
/// the first record.
const POINTS_AT: u64 = 96;
const EXTENDED_AT: u64 = 235;
const INFO_AT: u64 = 375 + 54;
/// Header of an extended record.
const EXTENDED_HEADER: u64 = 60;
/// About as many points lie in a node; levels are added until they do.
const NODE_POINTS: f64 = 50_000.0;
const MAX_LEVEL: i32 = 16;
/// How far points may lie outside the box of their part by rounding, metres.
const MARGIN_M: f64 = 1e-3;

/// Level, and place among the cells of that level.
type NodeKey = (i32, [i32; 3]);

/// Records of a node that still gets points.
struct OpenNode {
    records: Vec<u8>,
    /// The last part of the cloud that reaches into the node.
    last_part: usize,
}

/// A COPC file that is being written.
///
/// Every point is drawn to a level: four times as many to each as to the one before, as many as the cells that a
/// surface crosses. Memory holds the nodes that parts to come reach into.
pub struct CopcWriter {
    file: LazWriter,
    lower: Point3<f64>,
    side_m: f64,
    finest: i32,
    parts: Vec<Bounds>,
    part: usize,
    drawn: u64,
    open: BTreeMap<NodeKey, OpenNode>,
    written: Vec<NodeKey>,
}

impl CopcWriter {
    /// Starts a file at `partial`; errors name it `name`. The points lie in the box `whole` and come in parts, about
    /// `points` of them in all.
    pub fn create(
        partial: &Path,
        name: &Path,
        mut builder: Builder,
        whole: &Bounds,
        parts: Vec<Bounds>,
        points: u64,
    ) -> Result<Self, CloudError> {
        let side_m = (whole.max - whole.min).amax().max(1e-3);
        builder.vlrs.insert(0, record(INFO, vec![0; INFO_BYTES]));
        Ok(Self {
            file: LazWriter::with_variable_chunks(partial, name, builder)?,
            lower: whole.centre() - Vector3::repeat(0.5 * side_m),
            side_m,
            finest: finest_level(points),
            parts,
            part: 0,
            drawn: 0,
            open: BTreeMap::new(),
            written: Vec::new(),
        })
    }

    /// The file that errors name.
    pub fn name(&self) -> &Path {
        self.file.name()
    }

    /// The records of the node to which a point of the current part belongs; its own record goes to their end.
    pub fn records(&mut self, position: Point3<f64>) -> &mut Vec<u8> {
        let key = self.key(drawn_level(self.drawn, self.finest), position);
        self.drawn += 1;
        let (parts, part, bounds) = (&self.parts, self.part, self.bounds(key));
        let node = self.open.entry(key).or_insert_with(|| OpenNode {
            records: Vec::new(),
            last_part: { (part..parts.len()).rev() }
                .find(|&p| parts[p].intersects(&bounds))
                .unwrap_or(part),
        });
        &mut node.records
    }

    fn key(&self, level: i32, position: Point3<f64>) -> NodeKey {
        let cells = 1 << level;
        let place = |axis: usize| {
            let share = (position[axis] - self.lower[axis]) / self.side_m;
            ((share * f64::from(cells)) as i32).clamp(0, cells - 1)
        };
        (level, [place(0), place(1), place(2)])
    }

    /// A box around the node and what rounding brings into it.
    fn bounds(&self, (level, place): NodeKey) -> Bounds {
        let side_m = self.side_m / f64::from(1 << level);
        let corner = |end: i32| self.lower + Vector3::from(place.map(|i| f64::from(i + end) * side_m));
        Bounds {
            min: corner(0) - Vector3::repeat(MARGIN_M),
            max: corner(1) + Vector3::repeat(MARGIN_M),
        }
    }

    /// Ends the current part, and writes the nodes that no later part reaches into.
    pub fn end_part(&mut self) -> Result<(), CloudError> {
        let part = self.part;
        self.part += 1;
        let done = self.open.extract_if(.., |_, node| node.last_part <= part);
        let (keys, chunks): (Vec<_>, Vec<_>) = done.map(|(key, node)| (key, node.records)).unzip();
        self.written.extend(keys);
        self.file.write_chunks(chunks)
    }

    /// Writes what comes after the points, and completes the file at `partial`.
    pub fn finish(self, partial: &Path) -> Result<(), CloudError> {
        let name = self.file.name().to_owned();
        let laszip = self.file.compression().clone();
        self.file.finish()?;

        let open = OpenOptions::new().read(true).write(true).open(partial);
        let mut file = open.map_err(|e| CloudError::write(&name, e))?;
        let octree = Octree {
            centre: self.lower + Vector3::repeat(0.5 * self.side_m),
            half_m: 0.5 * self.side_m,
            finest: self.finest,
            chunks: self.written,
        };
        octree
            .append(&mut file, &laszip)
            .map_err(|e| unwritable(&name, e))
    }
}

/// The nodes of a file whose points are written.
struct Octree {
    centre: Point3<f64>,
    half_m: f64,
    finest: i32,
    /// The node of each chunk, in the order of the file.
    chunks: Vec<NodeKey>,
}

/// Where the points of a node are, and their number.
#[derive(Clone, Copy, Default)]
struct Entry {
    offset: u64,
    bytes: i32,
    points: i32,
}

impl Octree {
    /// Appends the list of nodes to a file, and tells its first record and its header of them.
    fn append(&self, file: &mut File, laszip: &LazVlr) -> las::Result<()> {
        let nodes = self.nodes(file, laszip)?;
        let mut data = Vec::new();
        for ((level, place), entry) in &nodes {
            data.extend(
                [*level, place[0], place[1], place[2]]
                    .into_iter()
                    .flat_map(i32::to_le_bytes),
            );
            data.extend(entry.offset.to_le_bytes());
            data.extend([entry.bytes, entry.points].into_iter().flat_map(i32::to_le_bytes));
        }
        let (start, size) = (file.seek(SeekFrom::End(0))?, data.len() as u64);
        record(HIERARCHY, data).into_raw(true)?.write_to(&mut *file)?;

        file.seek(SeekFrom::Start(INFO_AT))?;
        let centre = [self.centre.x, self.centre.y, self.centre.z];
        for value in centre.into_iter().chain([self.half_m, self.spacing_m(&nodes)]) {
            file.write_all(&value.to_le_bytes())?;
        }
        for value in [start + EXTENDED_HEADER, size] {
            file.write_all(&value.to_le_bytes())?;
        }

        file.seek(SeekFrom::Start(EXTENDED_AT))?;
        file.write_all(&start.to_le_bytes())?;
        file.write_all(&1_u32.to_le_bytes())?;
        Ok(())
    }

    /// All nodes; those above a node with points are among them, without points where they have none.
    fn nodes(&self, file: &mut File, laszip: &LazVlr) -> las::Result<BTreeMap<NodeKey, Entry>> {
        let mut points_at = [0; 4];
        file.seek(SeekFrom::Start(POINTS_AT))?;
        file.read_exact(&mut points_at)?;
        let points_at = u64::from(u32::from_le_bytes(points_at));
        file.seek(SeekFrom::Start(points_at))?;
        let sizes = ChunkTable::read_from(BufReader::new(&mut *file), laszip)?;

        let mut nodes = BTreeMap::new();
        let mut offset = points_at + ChunkTable::OFFSET_SIZE as u64;
        for (&(level, place), size) in self.chunks.iter().zip(&sizes) {
            let entry = Entry {
                offset,
                bytes: i32::try_from(size.byte_count)?,
                points: i32::try_from(size.point_count)?,
            };
            nodes.insert((level, place), entry);
            offset += size.byte_count;
            for up in 1..=level {
                nodes.entry((level - up, place.map(|i| i >> up))).or_default();
            }
        }
        Ok(nodes)
    }

    /// Distance between the points of the coarsest node, if the cells of the finest level are about filled by a surface.
    fn spacing_m(&self, nodes: &BTreeMap<NodeKey, Entry>) -> f64 {
        let cell_m = 2.0 * self.half_m / f64::from(1 << self.finest);
        let finest = nodes.keys().filter(|(level, _)| *level == self.finest).count();
        let coarsest = nodes.get(&(0, [0; 3])).map_or(0, |entry| entry.points);
        cell_m * (finest.max(1) as f64 / f64::from(coarsest.max(1))).sqrt()
    }
}

fn record(record_id: u16, data: Vec<u8>) -> Vlr {
    Vlr {
        user_id: USER_ID.to_owned(),
        record_id,
        description: DESCRIPTION.to_owned(),
        data,
    }
}

/// The finest level of a cloud with so many points.
fn finest_level(points: u64) -> i32 {
    let coarsest = |level: i32| 3.0 * points as f64 / 4_f64.powi(level + 1);
    (0..MAX_LEVEL)
        .find(|&l| coarsest(l) <= NODE_POINTS)
        .unwrap_or(MAX_LEVEL)
}

/// The level of a point by its number, up to the finest: each is four times as probable as the one before.
fn drawn_level(number: u64, finest: i32) -> i32 {
    // SplitMix64 (Steele, Lea & Flood 2014).
    let mut bits = number.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    let share = ((bits ^ (bits >> 31)) >> 11) as f64 / (1_u64 << 53) as f64;
    let all = 4_f64.powi(finest + 1) - 1.0;
    (0..finest)
        .find(|&level| share * all < 4_f64.powi(level + 1) - 1.0)
        .unwrap_or(finest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_level_gets_four_times_as_many_points_as_the_one_before() {
        assert_eq!(
            (finest_level(0), finest_level(66_000), finest_level(270_000)),
            (0, 0, 2)
        );
        let mut counts = [0; 4];
        (0..850_000).for_each(|i| counts[drawn_level(i, 3) as usize] += 1);
        for (count, expected) in counts.into_iter().zip([10_000, 40_000, 160_000, 640_000]) {
            assert!(
                (f64::from(count) / f64::from(expected) - 1.0).abs() < 0.03,
                "{counts:?}"
            );
        }
    }
}
