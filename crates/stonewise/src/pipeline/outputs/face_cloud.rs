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
use stonewise_io::cloud::{Dimension, write_coloured_copc};

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

/// Writes `stones.copc.laz`: every point of a stone of the first epoch, coloured by its motion out of the wall on
/// the scale of the report, grey where that was not measured.
fn write_face_cloud(context: &Context, first: &Labelled, rows: &[StoneRow]) -> Result<()> {
    let colours = FaceColours::new(rows);
    let by_id: BTreeMap<u32, &StoneRow> = rows.iter().map(|r| (r.stone_id, r)).collect();
    let tiles = &first.ingested.tiles;
    let parts: Vec<_> = (0..tiles.tile_count()).map(|t| tiles.bounds(t)).collect();
    if parts.is_empty() {
        return Ok(());
    }
    let crs = coordinate_system(context.project)?;
    let crs = crs.map(|c| c.text());

    context.progress.begin("face cloud", parts.len() as u64);
    write_coloured_copc(
        &context.out.join(FILE),
        parts,
        tiles.surveyed.point_count(),
        &DIMENSIONS,
        crs.as_deref(),
        |tile, out| {
            context.progress.check()?;
            let labels = first.labels(tile)?;
            if labels.stone.iter().any(|s| *s != 0) {
                let cloud = tiles.load(tile)?;
                for (i, stone) in labels.stone.iter().enumerate().filter(|(_, s)| **s != 0) {
                    let row = by_id.get(stone).copied();
                    let motion = row.and_then(|r| r.motion.as_ref());
                    let mm = motion.map_or([f32::NAN; 5], |m| {
                        let [a, u, o] = [m.face.x, m.face.y, m.face.z];
                        [a, u, o, m.displacement.norm(), m.detection_limit_m].map(|v| (v * 1e3) as f32)
                    });
                    let numbers = [*stone as f32, mm[0], mm[1], mm[2], mm[3], mm[4]];
                    out.push(cloud.world(i), colours.of(row), &numbers)?;
                }
            }
            context.progress.advance(1);
            Ok(())
        },
    )
}
