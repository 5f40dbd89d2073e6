//! What the first survey shows of a wall: its stones, its joints, the shape of its face, and where nothing is covered.

mod face_shape;
mod gaps;

use crate::error::Result;
use crate::pipeline::{Context, Run, Until};
use crate::project::Project;
use crate::results::{Joint, ResultSet, StoneRow, joints};
use crate::storage::store::StepStore;
use face_shape::{FaceShape, ShapeFigures};
use gaps::{Cover, Gap};
use nalgebra::{Point2, Point3, Vector3};
use serde::Serialize;
use std::path::Path;
use std::sync::Arc;
use stonewise_core::cloud::TileSource;
use stonewise_core::epoch::EpochId;
use stonewise_core::progress::Progress;
use stonewise_core::statistics::{median, quantile};

/// A point of the cloud belongs to the face if it lies this close to its smooth shape, metres.
const FACE_M: f64 = 0.3;
/// Most gaps that are listed.
const LISTED: usize = 20;

/// What the first survey shows of a wall.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Baseline {
    /// Number of stones.
    pub stones: usize,
    /// Area of the visible face of a stone, m2: of 5, 50 and 95 of 100 stones at most.
    pub area_m2: Option<[f64; 3]>,
    /// Median width and height of a stone, metres.
    pub size_m: Option<[f64; 2]>,
    /// Number of joints between neighbouring stones.
    pub joints: usize,
    /// Width of a joint, millimetres: of 5, 50 and 95 of 100 joints at most.
    pub joint_mm: Option<[f64; 3]>,
    /// Length along the wall and height up its face, from the outermost stones, metres.
    pub extent_m: [f64; 2],
    /// Area of the face between the outermost stones, m2.
    pub face_m2: f64,
    /// Batter and radius in plan; absent where too few stones show them.
    pub shape: Option<ShapeFigures>,
    /// Distance of a stone's middle from that smooth face, millimetres: root mean square.
    pub relief_mm: Option<f64>,
    /// Share of the face that stones and the joints between them cover.
    pub covered: f64,
    /// The largest parts of the face without stones, at most 20.
    pub gaps: Vec<Gap>,
}

/// One stone of the inventory.
pub struct InventoryStone {
    /// Number, place, area, points, photos and confidence, as a run of the project gives them.
    pub row: StoneRow,
    /// Width along the wall and height up the face, metres; absent where the stone has no outline.
    pub size_m: Option<[f64; 2]>,
    /// Outline on the unrolled wall, metres.
    pub ring: Vec<[f64; 2]>,
    /// How far its middle lies in front of the smooth face, metres.
    pub out_m: Option<f64>,
    /// Number of neighbours across a joint.
    pub neighbours: u32,
    /// Mean width of its joints, weighted by their lengths, metres.
    pub joint_m: Option<f64>,
}

/// The stones of the project's reference alone, found in all of its photos, and what they make up; `outlines.json` is
/// written into `out`.
///
/// # Errors
/// What stops the steps of a run up to the labels.
pub fn baseline(
    project: &Project,
    out: &Path,
    store: &Arc<StepStore>,
    progress: &dyn Progress,
) -> Result<(Baseline, Vec<InventoryStone>)> {
    let alone = Project {
        epochs: vec![project.epochs.reference().clone()].into(),
        ..project.clone()
    };
    let context = Context::with_store(&alone, out, Arc::clone(store), progress)?;
    let run = Run::new(&context, Until::Labelled);
    let labelled = run.labelled(EpochId::REFERENCE)?;
    let outlined = run.outlined()?;
    let rows: Vec<StoneRow> = { labelled.stones.iter() }
        .map(|stone| {
            let place = outlined.facade.place(&stone.centroid);
            StoneRow {
                stone_id: stone.id.0,
                centroid: stone.centroid,
                along_m: place.x,
                up_m: place.y,
                area_m2: stone.area_m2,
                points_1: stone.points,
                photos: stone.photos,
                confidence: stone.confidence,
                edited: labelled.edited.get(&stone.id).copied(),
                ..StoneRow::default()
            }
        })
        .collect();
    let shown = ResultSet::of_stones(rows, outlined.outlines.clone(), outlined.facade.clone());
    let middles: Vec<Point3<f64>> = shown.stones.iter().map(|s| s.centroid).collect();
    let out_of_wall: Vector3<f64> = labelled.stones.iter().map(|s| s.normal).sum();
    let shape = FaceShape::fit(&middles, &out_of_wall);

    let has_outline = |s: &&StoneRow| shown.outlines.contains_key(&s.stone_id);
    let rings = { shown.stones.iter() }
        .filter(has_outline)
        .map(|s| shown.unrolled(s))
        .collect::<Vec<_>>();
    let mut cover = Cover::new(&rings);
    if let Some(cover) = &mut cover {
        let tiles = &labelled.ingested.tiles;
        for tile in 0..tiles.tile_count() {
            progress.check()?;
            let cloud = tiles.load(tile)?;
            for p in (0..cloud.len()).map(|i| cloud.world(i)) {
                if shape.as_ref().is_none_or(|s| s.out_m(&p).abs() <= FACE_M) {
                    cover.add_point(&shown.facade.place(&p));
                }
            }
        }
    }

    let joints = joints(&shown);
    let stones = inventory(&shown, shape.as_ref(), &joints);
    Ok((summary(&stones, &rings, shape, &joints, cover.as_ref()), stones))
}

fn inventory(shown: &ResultSet, shape: Option<&FaceShape>, joints: &[Joint]) -> Vec<InventoryStone> {
    // Joints, their length and their length times their width.
    let mut sums = vec![(0, 0.0, 0.0); shown.stones.len()];
    for joint in joints {
        let length = (joint.line[1] - joint.line[0]).norm();
        for &stone in &joint.stones {
            let (count, lengths, areas) = &mut sums[stone];
            *count += 1;
            *lengths += length;
            *areas += length * joint.width_m;
        }
    }
    { shown.stones.iter().zip(sums) }
        .map(|(row, (neighbours, lengths, areas))| InventoryStone {
            size_m: { shown.outlines.get(&row.stone_id) }.and_then(|_| extent(&shown.unrolled(row))),
            out_m: shape.map(|s| s.out_m(&row.centroid)),
            neighbours,
            joint_m: (lengths > 0.0).then(|| areas / lengths),
            ring: shown.unrolled(row).iter().map(|p| [p.x, p.y]).collect(),
            row: row.clone(),
        })
        .collect()
}

fn summary(
    stones: &[InventoryStone],
    rings: &[Vec<Point2<f64>>],
    shape: Option<FaceShape>,
    joints: &[Joint],
    cover: Option<&Cover>,
) -> Baseline {
    let [widths, heights] = [0, 1].map(|axis| {
        let sizes = stones.iter().filter_map(|s| s.size_m).map(|s| s[axis]);
        median(&mut sizes.collect::<Vec<_>>())
    });
    let squares: Vec<f64> = stones.iter().filter_map(|s| s.out_m).map(|d| d * d).collect();
    let (face_m2, covered, mut gaps) = cover.map_or((0.0, 0.0, Vec::new()), Cover::gaps);
    gaps.truncate(LISTED);
    let outer: Vec<Point2<f64>> = rings.iter().flatten().copied().collect();
    Baseline {
        stones: stones.len(),
        area_m2: spread(stones.iter().map(|s| s.row.area_m2)),
        size_m: widths.zip(heights).map(|(w, h)| [w, h]),
        joints: joints.len(),
        joint_mm: spread(joints.iter().map(|j| 1e3 * j.width_m)),
        extent_m: extent(&outer).unwrap_or_default(),
        face_m2,
        shape: shape.map(|s| s.figures()),
        relief_mm: (!squares.is_empty())
            .then(|| 1e3 * (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()),
        covered,
        gaps,
    }
}

/// Quantiles of 5, 50 and 95 %.
fn spread(values: impl Iterator<Item = f64>) -> Option<[f64; 3]> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    (!values.is_empty()).then(|| [0.05, 0.5, 0.95].map(|q| quantile(&values, q)))
}

/// Extent of points along and up.
fn extent(points: &[Point2<f64>]) -> Option<[f64; 2]> {
    let low = points.iter().copied().reduce(|a, b| a.inf(&b))?;
    let high = points.iter().copied().reduce(|a, b| a.sup(&b))?;
    Some([high.x - low.x, high.y - low.y])
}
