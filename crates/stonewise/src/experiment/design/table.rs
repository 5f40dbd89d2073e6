//! The stones of a prediction as a table.

use super::expected::{Expected, Foreseen};
use crate::error::Result;
use stonewise_io::table::Table;

/// One row for each stone.
pub(super) fn stone_table(stones: &[Foreseen]) -> Result<Table> {
    let mut table = Table::new();
    let ids: Vec<u32> = stones.iter().map(|s| s.stone.row.stone_id).collect();
    table.push("stone_id", "", "stone of the first epoch", ids)?;

    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let values: Vec<f64> = stones.iter().map(|s| s.stone.row.centroid[axis]).collect();
        table.push(name, "m", &format!("centroid, world {name}"), values)?;
    }

    let real = |of: fn(&Foreseen) -> f64| stones.iter().map(of).collect::<Vec<f64>>();
    let known = |of: fn(&Foreseen) -> Option<f64>| stones.iter().map(of).collect::<Vec<_>>();
    let count = |of: fn(&Foreseen) -> u32| stones.iter().map(of).collect::<Vec<u32>>();
    table.push(
        "area_m2",
        "m2",
        "area of the visible face",
        real(|s| s.stone.row.area_m2),
    )?;
    let status: Vec<String> = stones.iter().map(|s| s.status.to_string()).collect();
    table.push("status", "", "ok, or why there will be no motion", status)?;
    type Of = fn(&Expected, usize) -> Option<f64>;
    let columns: [(&str, &str, Of); 3] = [
        ("sd", "expected standard deviation of the motion", |e, axis| {
            Some(e.sd[axis])
        }),
        (
            "sd_def",
            "expected standard deviation of the deformation",
            |e, axis| e.deformation[axis],
        ),
        (
            "sd_one_more",
            "the same of the motion with one more station or strip",
            |e, axis| Some(e.one_more[axis]),
        ),
    ];

    for (name, meaning, of) in columns {
        for (axis, word) in ["along", "up", "out"].into_iter().enumerate() {
            let of = |s: &Foreseen| s.expected.as_ref().and_then(|e| of(e, axis));
            table.push(
                &format!("{name}_{word}"),
                "m",
                &format!("{meaning}, {word}"),
                stones.iter().map(of).collect::<Vec<_>>(),
            )?;
        }
    }

    let meaning = "place along the unrolled wall, from its left end";
    table.push("along_m", "m", meaning, real(|s| s.stone.row.along_m))?;
    let meaning = "place up the face, from the lowest stone";
    table.push("up_m", "m", meaning, real(|s| s.stone.row.up_m))?;
    let meaning = "extent along the wall";
    table.push("width_m", "m", meaning, known(|s| s.stone.size_m.map(|v| v[0])))?;
    let meaning = "extent up the face";
    table.push("height_m", "m", meaning, known(|s| s.stone.size_m.map(|v| v[1])))?;
    let meaning = "distance in front of the smooth face of the wall";
    table.push("out_m", "m", meaning, known(|s| s.stone.out_m))?;
    let meaning = "neighbours across a joint";
    table.push("neighbours", "", meaning, count(|s| s.stone.neighbours))?;
    let meaning = "mean width of its joints";
    table.push("joint_m", "m", meaning, known(|s| s.stone.joint_m))?;
    table.push("points", "", "points", count(|s| s.stone.row.points_1))?;
    table.push(
        "photos",
        "",
        "photos that show the stone",
        count(|s| s.stone.row.photos),
    )?;
    let meaning = "mean share of the photos' votes that its points gave it, 0 to 1";
    table.push("confidence", "", meaning, real(|s| s.stone.row.confidence))?;
    Ok(table)
}
