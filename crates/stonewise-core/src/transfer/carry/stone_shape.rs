//! The face of a stone as one epoch shows it.

use super::super::each_tile::each_tile;
use super::super::{LabelStore, TransferError};
use crate::cloud::TileSource;
use crate::geometry::{Bounds, CellMap, FaceFrame, OutlineParams, face_outline, floor, ring_contains};
use crate::id::StoneId;
use crate::progress::Progress;
use nalgebra::{Point2, Point3, Vector3};
use std::collections::BTreeMap;

/// Side of the cells of a face, metres: coarser than the spacing of sparse clouds, a few cells across the
/// smallest stones.
const CELL_M: f64 = 0.03;

/// A cell of a face.
pub(super) type Cell = [i64; 2];

/// Outline and relief of a stone's face.
#[derive(Clone, Debug)]
pub struct StoneShape {
    frame: FaceFrame,
    centre: Point3<f64>,
    /// Outline as (along, up) about the centre.
    ring: Vec<Point2<f64>>,
    /// Mean height of the points of each cell above the plane of the face, metres.
    heights: CellMap<Cell, f64>,
    /// Root mean square of the points' heights about the mean of their cell, metres: noise and relief.
    spread_m: f64,
    /// Box around the outline and the surface, world.
    bounds: Bounds,
}

/// A point on or near the face of a stone.
#[derive(Clone, Copy, Debug)]
pub(super) struct FacePlace {
    pub cell: Cell,
    /// Distance in front of the stone's surface there, metres.
    pub height_m: f64,
}

impl StoneShape {
    /// The shape of a stone with these points; `outward`: normal of its face. `None` where they cover no
    /// area.
    pub fn of(points: &[Point3<f64>], outward: &Vector3<f64>) -> Option<Self> {
        let frame = FaceFrame::from_normal(outward);
        let outline = face_outline(points, outward, &OutlineParams::default())?;
        let centre = *outline.first()?;
        let flat = |p: &Point3<f64>| {
            let d = p - centre;
            Point2::new(frame.along.dot(&d), frame.up.dot(&d))
        };
        let mut sums: CellMap<Cell, [f64; 3]> = CellMap::default();

        for p in points {
            let height = frame.out.dot(&(p - centre));
            let sum = sums.entry(cell_of(&flat(p))).or_default();
            *sum = [sum[0] + 1.0, sum[1] + height, sum[2] + height * height];
        }

        // Sorted, because sums of floating-point numbers depend on their order.
        let sorted: BTreeMap<Cell, [f64; 3]> = sums.into_iter().collect();
        let (mut squares, mut freedoms) = (0.0, 0.0);

        for [n, sum, square] in sorted.values() {
            squares += (square - sum * sum / n).max(0.0);
            freedoms += n - 1.0;
        }

        let bounds = Bounds::of(points.iter().chain(&outline).copied())?;
        Some(Self {
            ring: outline.iter().map(flat).collect(),
            heights: sorted.into_iter().map(|(c, [n, sum, _])| (c, sum / n)).collect(),
            spread_m: (squares / f64::max(freedoms, 1.0)).sqrt(),
            frame,
            centre,
            bounds,
        })
    }

    /// Number of cells.
    pub(super) fn cell_count(&self) -> usize {
        self.heights.len()
    }

    pub(super) fn spread_m(&self) -> f64 {
        self.spread_m
    }

    /// Box around the stone, world.
    pub(super) fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// Where a point lies on the stone's face; `None` beyond its outline.
    pub(super) fn place(&self, point: &Point3<f64>) -> Option<FacePlace> {
        let d = point - self.centre;
        let flat = Point2::new(self.frame.along.dot(&d), self.frame.up.dot(&d));
        let cell = cell_of(&flat);
        let surface = *self.heights.get(&cell)?;
        ring_contains(&self.ring, &flat).then(|| FacePlace {
            cell,
            height_m: self.frame.out.dot(&d) - surface,
        })
    }
}

/// The shapes of some stones of an epoch; `wanted`: with the outward normals of their faces. Stones whose
/// points cover no area are left out. Cost: one pass over the tiles; memory holds the points of these stones.
///
/// # Errors
/// A tile or its labels cannot be read, interruption.
pub fn stone_shapes<T: TileSource, S: LabelStore>(
    tiles: &T,
    labels: &S,
    wanted: &BTreeMap<StoneId, Vector3<f64>>,
    progress: &dyn Progress,
) -> Result<BTreeMap<StoneId, StoneShape>, TransferError> {
    let mut points: BTreeMap<StoneId, Vec<Point3<f64>>> = BTreeMap::new();
    each_tile(tiles, labels, "shapes of stones", progress, |_, cloud, labels| {
        for (i, stone) in labels.stone.iter().map(|&s| StoneId(s)).enumerate() {
            if wanted.contains_key(&stone) {
                points.entry(stone).or_default().push(cloud.world(i));
            }
        }
    })?;
    let shape = |(stone, outward): (&StoneId, &Vector3<f64>)| {
        Some((*stone, StoneShape::of(points.get(stone)?, outward)?))
    };
    Ok(wanted.iter().filter_map(shape).collect())
}

fn cell_of(flat: &Point2<f64>) -> Cell {
    [flat.x, flat.y].map(|v| floor(v / CELL_M))
}
