//! What the first survey shows of a wall: its stones, its joints, the shape of its face, and how much of it is covered.

mod cover;
mod face_shape;

use crate::error::Result;
use crate::pipeline::{Context, Run, Until};
use crate::project::Project;
use crate::results::{ResultSet, StoneRow, joints};
use crate::storage::store::StepStore;
use cover::{Cover, Coverage};
use face_shape::FaceShape;
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
    /// Batter and radius in plan; absent where too few stones show them.
    pub shape: Option<FaceShape>,
    /// Distance of a stone's middle from that smooth face, millimetres: root mean square.
    pub relief_mm: Option<f64>,
    /// How much of the face is covered.
    #[serde(flatten)]
    pub coverage: Coverage,
}

/// One stone of the inventory.
pub struct InventoryStone {
    /// Number, place, area, points, photos and confidence, as a run of the project gives them.
    pub row: StoneRow,
    /// Width along the wall and height up the face, metres; absent where the stone has no outline.
    pub size_m: Option<[f64; 2]>,
    /// Outline on the unrolled wall, metres.
    pub ring: Vec<Point2<f64>>,
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
    let (labelled, outlined) = (run.labelled(EpochId::REFERENCE)?, run.outlined()?);
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

    let joints = joints(&shown);
    // Lengths and widths of the joints of each stone.
    let mut around = vec![Vec::new(); shown.stones.len()];
    for joint in &joints {
        for &stone in &joint.stones {
            around[stone].push(((joint.line[1] - joint.line[0]).norm(), joint.width_m));
        }
    }
    let stones: Vec<InventoryStone> = { shown.stones.iter().zip(around) }
        .map(|(row, around)| {
            let lengths: f64 = around.iter().map(|(length, _)| length).sum();
            let areas: f64 = around.iter().map(|(length, width)| length * width).sum();
            let has_outline = shown.outlines.contains_key(&row.stone_id);
            let ring = shown.unrolled(row);
            InventoryStone {
                size_m: extent(&ring).filter(|_| has_outline),
                out_m: shape.as_ref().map(|s| s.out_m(&row.centroid)),
                neighbours: around.len() as u32,
                joint_m: (lengths > 0.0).then(|| areas / lengths),
                ring,
                row: row.clone(),
            }
        })
        .collect();
    let rings: Vec<Vec<Point2<f64>>> = { stones.iter() }
        .filter(|s| s.size_m.is_some())
        .map(|s| s.ring.clone())
        .collect();
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

    let side = |axis: usize| {
        let sizes = stones.iter().filter_map(|s| s.size_m);
        median(&mut sizes.map(|size| size[axis]).collect::<Vec<_>>())
    };
    let squares: Vec<f64> = stones.iter().filter_map(|s| s.out_m).map(|d| d * d).collect();
    let baseline = Baseline {
        stones: stones.len(),
        area_m2: spread(stones.iter().map(|s| s.row.area_m2)),
        size_m: side(0).zip(side(1)).map(|(w, h)| [w, h]),
        joints: joints.len(),
        joint_mm: spread(joints.iter().map(|j| 1e3 * j.width_m)),
        extent_m: extent(&rings.concat()).unwrap_or_default(),
        shape,
        relief_mm: (!squares.is_empty())
            .then(|| 1e3 * (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()),
        coverage: cover.as_ref().map(Cover::coverage).unwrap_or_default(),
    };
    Ok((baseline, stones))
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
