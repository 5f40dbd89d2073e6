//! The stones' points in the colours of their motion.

use crate::error::Result;
use crate::export::FaceColours;
use crate::pipeline::context::Context;
use crate::pipeline::outputs::crs::coordinate_system;
use crate::pipeline::steps::label::Labelled;
use crate::results::StoneRow;
use crate::results::names::FACE_CLOUD;
use std::collections::BTreeMap;
use stonewise_core::cloud::TileSource;
use stonewise_core::geometry::Bounds;
use stonewise_io::cloud::{Dimension, write_coloured_laz};

/// Extra dimensions; NaN where the motion was not measured.
const DIMENSIONS: [Dimension; 6] = [
    Dimension::new("stone_id", "", "number of the stone"),
    Dimension::new("d_along_mm", "mm", "displacement along the wall"),
    Dimension::new("d_up_mm", "mm", "displacement up the face"),
    Dimension::new("d_out_mm", "mm", "displacement out of the face"),
    Dimension::new("norm_mm", "mm", "length of the displacement"),
    Dimension::new("lod95_mm", "mm", "95 % detection limit"),
];

/// Writes `stones.laz`: every point of a stone of the first epoch, coloured by its motion out of the wall on
/// the scale of the report, grey where that was not measured.
pub fn write_face_cloud(context: &Context, first: &Labelled, rows: &[StoneRow]) -> Result<()> {
    let colours = FaceColours::new(rows);
    let by_id: BTreeMap<u32, &StoneRow> = rows.iter().map(|r| (r.stone_id, r)).collect();
    let tiles = &first.ingested.tiles;
    let Some(bounds) = (0..tiles.tile_count())
        .map(|t| tiles.bounds(t))
        .reduce(|a: Bounds, b| a.union(&b))
    else {
        return Ok(());
    };
    let crs = coordinate_system(context.project)?;
    let crs = crs.map(|c| c.text());
    write_coloured_laz(
        &context.out.join(FACE_CLOUD),
        &bounds,
        &DIMENSIONS,
        crs.as_deref(),
        |out| {
            context
                .progress
                .each("face cloud", 0..tiles.tile_count(), |tile| {
                    let labels = first.labels(tile)?;
                    if labels.stone.iter().any(|s| *s != 0) {
                        let cloud = tiles.load(tile)?;
                        for (i, stone) in labels.stone.iter().enumerate().filter(|(_, s)| **s != 0) {
                            let row = by_id.get(stone).copied();
                            let motion = row.and_then(|r| r.motion.as_ref());
                            let mm = motion.map_or([f32::NAN; 5], |m| {
                                let [a, u, o] = [m.face.x, m.face.y, m.face.z];
                                [a, u, o, m.displacement.norm(), m.detection_limit_m]
                                    .map(|v| (v * 1e3) as f32)
                            });
                            let numbers = [*stone as f32, mm[0], mm[1], mm[2], mm[3], mm[4]];
                            out.push(cloud.world(i), colours.of(row), &numbers)?;
                        }
                    }
                    Ok(())
                })
        },
    )
}
