//! GeoParquet (version 1.1): a Parquet table with a column of geometries.

use super::geometry::well_known_binary;
use super::geopackage::check;
use super::{Geometry, Layer, LayerError};
use crate::crs::projjson;
use crate::table::write_parquet;
use serde_json::{Value, json};
use std::path::Path;

/// Name of the column of geometries.
const GEOMETRY: &str = "geometry";

/// Writes a layer as a table whose last column, `geometry`, is the feature as well-known binary.
///
/// The metadata entry `geo` names the reference system as PROJJSON: null, which means unknown, for local frames, for
/// systems without a code and for those that [`projjson`] does not have. Coordinates are x, y, z whatever the order of the system's axes, as the
/// format demands. A feature with too few or infinite vertices has no geometry.
///
/// # Errors
/// Lengths differ, or the file cannot be written; an earlier file is kept then.
pub fn write_geoparquet(path: &Path, layer: &Layer) -> Result<(), LayerError> {
    check(layer)?;
    let geometries = layer.vertices.iter();
    let geometries: Vec<Option<Vec<u8>>> = geometries
        .map(|vertices| well_known_binary(layer.geometry, vertices))
        .collect();
    let geo = json!({
        "version": "1.1.0",
        "primary_column": GEOMETRY,
        "columns": { GEOMETRY: described(layer, &geometries) },
    });
    let mut table = layer.attributes.clone();
    let meaning = "outline in the coordinates of the survey";
    table.push(GEOMETRY, "", meaning, geometries)?;
    table.set_metadata("geo", geo.to_string());
    Ok(write_parquet(path, &table)?)
}

fn described(layer: &Layer, geometries: &[Option<Vec<u8>>]) -> Value {
    let kind = match layer.geometry {
        Geometry::PolygonZ => "Polygon Z",
        Geometry::Polygon => "Polygon",
        Geometry::LineStringZ => "LineString Z",
        Geometry::LineString => "LineString",
    };
    let code = layer.crs.as_ref().and_then(|crs| u32::try_from(crs.epsg?).ok());
    let mut column = json!({ "encoding": "WKB", "geometry_types": [kind], "crs": code.and_then(projjson) });
    let there = layer.vertices.iter().zip(geometries);
    let there = there.filter(|(_, geometry)| geometry.is_some());
    let points = || there.clone().flat_map(|(vertices, _)| vertices);
    let axes = if layer.geometry.has_z() { 3 } else { 2 };
    let ends =
        [f64::min, f64::max].map(|of| (0..axes).filter_map(move |axis| points().map(|p| p[axis]).reduce(of)));
    let bounds: Vec<f64> = ends.into_iter().flatten().collect();
    if !bounds.is_empty() {
        column["bbox"] = json!(bounds);
    }
    column
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crs::Crs;
    use crate::table::{Table, read_parquet};
    use nalgebra::Point3;

    fn written(crs: Option<Crs>) -> (Table, Value) {
        let mut attributes = Table::new();
        attributes.push("stone_id", "", "stone", vec![7u32, 9]).unwrap();
        let p = Point3::new;
        let layer = Layer {
            name: "stones".into(),
            title: String::new(),
            description: String::new(),
            geometry: Geometry::PolygonZ,
            crs,
            attributes,
            vertices: vec![
                vec![p(1.0, 2.0, 3.0), p(4.0, 2.0, 3.0), p(4.0, 6.0, 5.0)],
                Vec::new(),
            ],
            styles: Vec::new(),
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.parquet");
        write_geoparquet(&path, &layer).unwrap();
        let table = read_parquet(&path).unwrap();
        let geo = serde_json::from_str(table.metadata("geo").unwrap()).unwrap();
        (table, geo)
    }

    #[test]
    fn features_and_bounds_are_laid_out_as_the_format_says() {
        let (table, geo) = written(Crs::parse("EPSG:31467"));
        let geometries = table.optional::<Vec<u8>>("geometry").unwrap();
        // Little-endian, polygon with z, one ring of four corners.
        let ring = geometries[0].as_ref().unwrap();
        assert_eq!(&ring[..13], [1, 235, 3, 0, 0, 1, 0, 0, 0, 4, 0, 0, 0]);
        assert_eq!(ring.len(), 13 + 4 * 24);
        assert_eq!(geometries[1], None);
        let column = &geo["columns"]["geometry"];
        assert_eq!(column["bbox"], json!([1.0, 2.0, 3.0, 4.0, 6.0, 5.0]));
        assert_eq!(column["geometry_types"], json!(["Polygon Z"]));
        assert_eq!(column["crs"]["id"]["code"], 31467);
    }

    #[test]
    fn a_local_frame_has_an_unknown_system_and_not_the_default() {
        let (_, geo) = written(None);
        assert_eq!(geo["columns"]["geometry"].get("crs"), Some(&Value::Null));
    }
}
