//! The stones of a prediction as a table.

use super::expected::{Expected, Foreseen};
use crate::error::Result;
use crate::experiment::tables::Columns;
use stonewise_io::table::Table;

/// One row for each stone.
pub(super) fn stone_table(stones: &[Foreseen]) -> Result<Table> {
    let mut columns = Columns::of(stones);
    columns.add("stone_id", "", "stone of the first epoch", |s| {
        s.stone.row.stone_id
    })?;
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let meaning = format!("centroid, world {name}");
        columns.add(name, "m", &meaning, |s| s.stone.row.centroid[axis])?;
    }
    columns.add("area_m2", "m2", "area of the visible face", |s| {
        s.stone.row.area_m2
    })?;
    columns.add("status", "", "ok, or why there will be no motion", |s| {
        s.status.to_string()
    })?;
    type Of = fn(&Expected) -> [Option<f64>; 3];
    let deviations: [(&str, &str, Of); 3] = [
        ("sd", "expected standard deviation of the motion", |e| {
            e.sd.map(Some)
        }),
        ("sd_def", "expected standard deviation of the deformation", |e| {
            e.deformation
        }),
        (
            "sd_one_more",
            "the same of the motion with one more station or strip",
            |e| e.one_more.map(Some),
        ),
    ];
    for (name, meaning, of) in deviations {
        for (axis, word) in ["along", "up", "out"].into_iter().enumerate() {
            let value = |s: &Foreseen| s.expected.as_ref().and_then(|e| of(e)[axis]);
            columns.add(
                &format!("{name}_{word}"),
                "m",
                &format!("{meaning}, {word}"),
                value,
            )?;
        }
    }
    let meaning = "place along the unrolled wall, from its left end";
    columns.add("along_m", "m", meaning, |s| s.stone.row.along_m)?;
    let meaning = "place up the face, from the lowest stone";
    columns.add("up_m", "m", meaning, |s| s.stone.row.up_m)?;
    columns.add("width_m", "m", "extent along the wall", |s| {
        s.stone.size_m.map(|v| v[0])
    })?;
    columns.add("height_m", "m", "extent up the face", |s| {
        s.stone.size_m.map(|v| v[1])
    })?;
    let meaning = "distance in front of the smooth face of the wall";
    columns.add("out_m", "m", meaning, |s| s.stone.out_m)?;
    columns.add("neighbours", "", "neighbours across a joint", |s| {
        s.stone.neighbours
    })?;
    columns.add("joint_m", "m", "mean width of its joints", |s| s.stone.joint_m)?;
    columns.add("points", "", "points", |s| s.stone.row.points_1)?;
    columns.add("photos", "", "photos that show the stone", |s| s.stone.row.photos)?;
    let meaning = "mean share of the photos' votes that its points gave it, 0 to 1";
    columns.add("confidence", "", meaning, |s| s.stone.row.confidence)?;
    Ok(columns.table)
}
