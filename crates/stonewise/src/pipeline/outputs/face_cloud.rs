//! The stones' points in the colours of their motion.

use crate::error::Result;
use crate::export::FaceColours;
use crate::pipeline::context::Context;
use crate::pipeline::graph::{Need, Step};
use crate::pipeline::outputs::crs::coordinate_system;
use crate::pipeline::steps::label::Labelled;
use crate::pipeline::steps::measure::MEASURE;
use crate::pipeline::until::Until;
use crate::results::StoneRow;
use crate::results::names::FACE_CLOUD as FILE;
use std::collections::BTreeMap;
use stonewise_core::cloud::TileSource;
use stonewise_core::epoch::EpochId;
use stonewise_io::cloud::{Dimension, ExtraColumn, ExtraType, stream_coloured_laz};

/// Writes the points of stones in the colours of the first later epoch.
pub static FACE_CLOUD: Step = Step {
    name: "face-cloud",
    needs: &[Need::first_later(&MEASURE)],
    wanted: |until| until == Until::Reported,
    make: |run, _| match run.context.project.epochs.later_ids().next() {
        Some(later) => {
            let (first, measured) = (run.labelled(EpochId::REFERENCE)?, run.measured(later)?);
            run.context.timed("face cloud", || {
                write_face_cloud(run.context, &first, &measured.rows)
            })
        }
        None => Ok(()),
    },
    ..Step::PLAIN
};

/// Extra dimensions; NaN where the motion was not measured.
const DIMENSIONS: [Dimension; 6] = [
    Dimension::new("stone_id", "", "number of the stone"),
    Dimension::new("d_along_mm", "mm", "displacement along the wall"),
    Dimension::new("d_up_mm", "mm", "displacement up the face"),
    Dimension::new("d_out_mm", "mm", "displacement out of the face"),
    Dimension::new("norm_mm", "mm", "length of the displacement"),
    Dimension::new("lod95_mm", "mm", "95 % detection limit"),
];

/// How far points may lie outside the boxes of their tiles, by rounding, metres.
const ROUNDING_M: f64 = 1e-3;

/// Writes `stones.laz`: every point of a stone of the first epoch, coloured by its motion out of the wall on the
/// scale of the report, grey where that was not measured.
fn write_face_cloud(context: &Context, first: &Labelled, rows: &[StoneRow]) -> Result<()> {
    let colours = FaceColours::new(rows, &context.project.settings.thresholds);
    let by_id: BTreeMap<u32, &StoneRow> = rows.iter().map(|r| (r.stone_id, r)).collect();
    let tiles = &first.ingested.tiles;
    let boxes = (0..tiles.tile_count()).map(|t| tiles.bounds(t));
    let Some(bounds) = boxes.reduce(|a, b| a.union(&b)) else {
        return Ok(());
    };
    let crs = coordinate_system(context.project)?;
    let crs = crs.map(|c| c.text());

    context.progress.begin("face cloud", tiles.tile_count() as u64);
    stream_coloured_laz(
        &context.out.join(FILE),
        crs.as_deref(),
        &bounds.grown(ROUNDING_M),
        &DIMENSIONS.map(|dimension| (dimension, ExtraType::F32)),
        |out| {
            for tile in 0..tiles.tile_count() {
                context.progress.check()?;
                let labels = first.labels(tile)?;
                let of_stones = || labels.stone.iter().enumerate().filter(|(_, stone)| **stone != 0);
                if of_stones().next().is_some() {
                    let cloud = tiles.load(tile)?;
                    let positions: Vec<_> = of_stones().map(|(i, _)| cloud.world(i)).collect();
                    let rows = || of_stones().map(|(_, stone)| (*stone, by_id.get(stone).copied()));
                    let shown: Vec<_> = rows().map(|(_, row)| colours.of(row)).collect();
                    let numbers = columns(rows());
                    let numbers = numbers.each_ref().map(|column| ExtraColumn::F32(column));
                    out.append_coloured(&positions, &shown, &numbers)?;
                }
                context.progress.advance(1);
            }
            Ok(())
        },
    )
}

/// The values of the dimensions, of points of these stones.
fn columns<'a>(stones: impl Iterator<Item = (u32, Option<&'a StoneRow>)>) -> [Vec<f32>; DIMENSIONS.len()] {
    let mut columns = [const { Vec::new() }; DIMENSIONS.len()];
    for (stone, row) in stones {
        let motion = row.and_then(|r| r.motion.as_ref());
        let [along, up, out, norm, lod] = motion.map_or([f32::NAN; 5], |m| {
            let [along, up, out] = [m.face.x, m.face.y, m.face.z];
            [along, up, out, m.displacement.norm(), m.detection_limit_m].map(|v| (v * 1e3) as f32)
        });
        for (column, value) in columns.iter_mut().zip([stone as f32, along, up, out, norm, lod]) {
            column.push(value);
        }
    }
    columns
}
