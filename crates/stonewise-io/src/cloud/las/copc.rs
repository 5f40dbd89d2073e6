//! Writing COPC 1.0: a LAZ file whose chunks are the nodes of an octree, from coarse to fine.

use std::collections::btree_map::Entry as Slot;
use std::collections::{BTreeMap, BTreeSet};
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
/// At most about as many points lie in a node of the finest level.
const NODE_POINTS: f64 = 50_000.0;
const MAX_LEVEL: i32 = 16;
/// How far points may lie outside the box of their part at least, by rounding, metres.
const LEAST_MARGIN_M: f64 = 1e-3;
/// Smallest side of the cube, metres: that of a single point.
const LEAST_SIDE_M: f64 = 1e-3;

/// Level, and place among the cells of that level.
type NodeKey = (i32, [i32; 3]);

/// Records of a node that still gets points.
struct OpenNode {
    records: Vec<u8>,
    /// The last part of the cloud that reaches into the node.
    last_part: usize,
}

/// The cube of the octree.
struct Cube {
    lower: Point3<f64>,
    side_m: f64,
}

impl Cube {
    fn around(bounds: &Bounds) -> Self {
        let side_m = (bounds.max - bounds.min).amax().max(LEAST_SIDE_M);
        Self {
            lower: bounds.centre() - Vector3::repeat(0.5 * side_m),
            side_m,
        }
    }

    fn cell_m(&self, level: i32) -> f64 {
        self.side_m / f64::from(1 << level)
    }

    /// The node of a level that holds a place.
    fn node(&self, level: i32, at: Point3<f64>) -> NodeKey {
        let place = |axis: usize| {
            let cell = (at[axis] - self.lower[axis]) / self.cell_m(level);
            (cell as i32).clamp(0, (1 << level) - 1)
        };
        (level, [place(0), place(1), place(2)])
    }

    /// The box of a node, and as much around it.
    fn bounds(&self, (level, place): NodeKey, margin_m: f64) -> Bounds {
        let corner =
            |end: i32| self.lower + Vector3::from(place.map(|i| f64::from(i + end))) * self.cell_m(level);
        Bounds {
            min: corner(0) - Vector3::repeat(margin_m),
            max: corner(1) + Vector3::repeat(margin_m),
        }
    }
}

/// A COPC file that is being written.
///
/// Every point is drawn to a level: four times as many to each as to the one before, as many as the cells that a
/// surface crosses. Memory holds the nodes that parts to come reach into.
pub struct CopcWriter {
    file: LazWriter,
    cube: Cube,
    finest: i32,
    parts: Vec<Bounds>,
    /// How far points may lie outside the box of their part, metres.
    margin_m: f64,
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
        let cube = Cube::around(whole);
        let margin_m = builder.transforms.x.scale.max(LEAST_MARGIN_M);
        builder.vlrs.insert(0, record(INFO, vec![0; INFO_BYTES]));
        Ok(Self {
            file: LazWriter::with_variable_chunks(partial, name, builder)?,
            finest: finest_level(points, &parts, &cube),
            cube,
            parts,
            margin_m,
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
    pub fn records(&mut self, position: Point3<f64>) -> Result<&mut Vec<u8>, CloudError> {
        let key = self.cube.node(drawn_level(self.drawn, self.finest), position);
        self.drawn += 1;
        match self.open.entry(key) {
            Slot::Occupied(node) => Ok(&mut node.into_mut().records),
            Slot::Vacant(_) if self.written.contains(&key) => {
                let reason = "points lie outside the box of their part";
                Err(CloudError::unwritable(self.file.name(), reason))
            }
            Slot::Vacant(slot) => {
                let bounds = self.cube.bounds(key, self.margin_m);
                let later = self.parts.iter().rposition(|part| part.intersects(&bounds));
                let node = OpenNode {
                    records: Vec::new(),
                    last_part: later.unwrap_or(0).max(self.part),
                };
                Ok(&mut slot.insert(node).records)
            }
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
            cube: self.cube,
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
    cube: Cube,
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
        let half_m = 0.5 * self.cube.side_m;
        let centre = self.cube.lower + Vector3::repeat(half_m);
        for value in [centre.x, centre.y, centre.z, half_m, self.spacing_m(&nodes)] {
            file.write_all(&value.to_le_bytes())?;
        }
        for value in [start + EXTENDED_HEADER, size] {
            file.write_all(&value.to_le_bytes())?;
        }

        // Other extended records lie before this one.
        let mut extended = [0; 12];
        file.seek(SeekFrom::Start(EXTENDED_AT))?;
        file.read_exact(&mut extended)?;
        let (first, count) = extended.split_at_mut(8);
        if count.iter().all(|byte| *byte == 0) {
            first.copy_from_slice(&start.to_le_bytes());
        }
        count[0] += 1;
        file.seek(SeekFrom::Start(EXTENDED_AT))?;
        file.write_all(&extended)?;
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

        let mut nodes = BTreeMap::from([((0, [0; 3]), Entry::default())]);
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
        let cell_m = self.cube.cell_m(self.finest);
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

/// The first level whose nodes hold few points, of a surface in these parts. It crosses as many cells as parts do; of
/// cells smaller than a part, four times as many as of the level before.
fn finest_level(points: u64, parts: &[Bounds], cube: &Cube) -> i32 {
    let part_m = parts
        .iter()
        .map(|part| (part.max - part.min).amax())
        .fold(0.0, f64::max);
    let mut cells = 1.0;
    (0..MAX_LEVEL)
        .find(|&level| {
            cells = if cube.cell_m(level) < part_m {
                4.0 * cells
            } else {
                let nodes: BTreeSet<NodeKey> =
                    parts.iter().map(|part| cube.node(level, part.centre())).collect();
                nodes.len() as f64
            };
            0.75 * points as f64 / cells <= NODE_POINTS
        })
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
    fn nodes_of_a_long_wall_hold_as_many_points_as_those_of_a_high_one() {
        // Parts of 4 x 4 m.
        let parts = |along: u32, up: u32| -> Vec<Bounds> {
            let corner = |i: u32, j: u32| Point3::new(0.0, 4.0 * f64::from(i), 4.0 * f64::from(j));
            let part = |(i, j)| Bounds::of([corner(i, j), corner(i + 1, j + 1)]).unwrap();
            (0..along)
                .flat_map(|i| (0..up).map(move |j| (i, j)))
                .map(part)
                .collect()
        };
        for (along, up) in [(1, 1), (8, 8), (50, 1), (50, 7)] {
            let parts = parts(along, up);
            let whole = parts.iter().copied().reduce(|a, b| a.union(&b)).unwrap();
            let cube = Cube::around(&whole);
            let points = 200_000 * u64::from(along * up);
            let cell_m = cube.cell_m(finest_level(points, &parts, &cube));
            let of_node = 0.75 * 200_000.0 * (cell_m / 4.0).powi(2);
            assert!(
                (10_000.0..80_000.0).contains(&of_node),
                "{along} x {up}: {of_node}"
            );
        }
    }

    #[test]
    fn each_level_gets_four_times_as_many_points_as_the_one_before() {
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
