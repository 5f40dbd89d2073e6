//! Units and meanings of the columns of stones.csv, for people and programs.

use super::stone_table::STONE_COLUMNS;
use serde_json::{Value, json};

/// The sidecar of stones.csv after the W3C's CSV on the Web.
pub(super) fn column_notes() -> String {
    let column = |name: &str| {
        let (datatype, unit, meaning) = note(name);
        let mut column =
            json!({ "name": name, "titles": name, "datatype": datatype, "dc:description": meaning });
        if !unit.is_empty() {
            column["unit"] = Value::from(unit);
        }
        column
    };
    let document = json!({
        "@context": "http://www.w3.org/ns/csvw",
        "url": "stones.csv",
        "dc:description": "One row per stone of the first epoch. Displacements are second epoch minus first. Empty cells: not measured.",
        "tableSchema": { "primaryKey": "stone_id", "columns": STONE_COLUMNS.iter().map(|name| column(name)).collect::<Vec<_>>() },
    });
    format!("{document:#}\n")
}

/// Type, unit (empty where there is none) and meaning.
fn note(name: &str) -> (&'static str, &'static str, &'static str) {
    match name {
        "stone_id" => ("integer", "", "stone of the first epoch"),
        "x" | "y" | "z" => ("number", "m", "centroid in the first epoch, world frame"),
        "area_m2" => ("number", "m2", "area of the visible face in the first epoch"),
        "points_1" => ("integer", "", "points in the first epoch"),
        "points_2" => ("integer", "", "points in the second epoch"),
        "photos" => ("integer", "", "photos of the first epoch that show the stone"),
        "confidence" => ("number", "", "mean share of the votes for this stone, 0 to 1"),
        "matched_id" => ("integer", "", "partner in the second epoch"),
        "status" => ("string", "", "ok, or the reason why there is no motion"),
        "dx" | "dy" | "dz" => ("number", "m", "displacement of the centroid, world frame"),
        "d_along" => (
            "number",
            "m",
            "displacement along the wall, to the right of a viewer who faces it",
        ),
        "d_up" => ("number", "m", "displacement up the face, along the batter"),
        "d_out" => ("number", "m", "displacement out of the face, towards the viewer"),
        "rx" | "ry" | "rz" => ("number", "rad", "rotation vector, world frame"),
        "lod95" => (
            "number",
            "m",
            "length beyond which a displacement of this direction is significant at 95 %",
        ),
        "significant" => (
            "integer",
            "",
            "1 where the displacement differs from zero at 95 %, else 0",
        ),
        "rel_dx" | "rel_dy" | "rel_dz" => ("number", "m", "displacement against the neighbours, world frame"),
        "loose" => (
            "integer",
            "",
            "1 where the stone moves unlike its neighbours, significantly, else 0",
        ),
        "sep_obs" => (
            "number",
            "",
            "observability of the least observable direction, 0 to 1",
        ),
        _ => (
            "number",
            "m2",
            "covariance of dx, dy, dz, registration error included",
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_covariances_fall_through() {
        let covariances = STONE_COLUMNS
            .iter()
            .filter(|c| note(c).2.starts_with("covariance"));
        assert!(covariances.clone().all(|c| c.starts_with("cov_")));
        assert_eq!(covariances.count(), 6);
    }
}
