//! GeoJSON (RFC 7946) in the survey's own frame.

use super::geopackage::{cell, check};
use super::{Geometry, Layer, LayerError};
use crate::atomic::write_atomically;
use rusqlite::types::Value as Cell;
use serde_json::{Map, Value, json};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Writes a layer as a feature collection, one feature a line, coordinates rounded to a micrometre.
///
/// RFC 7946 requires longitude and latitude; coordinates here are those of the layer. A layer with a
/// reference system says so in the member `crs` of the format's 2008 version; for a local frame the reader
/// sets it by hand (QGIS opens a dialog). A feature with too few or infinite vertices has geometry null.
///
/// # Errors
/// Lengths differ, or the file cannot be written; an earlier file is kept then.
pub fn write_geojson(path: &Path, layer: &Layer) -> Result<(), LayerError> {
    check(layer)?;
    write_atomically(path, |partial| {
        let mut out = BufWriter::new(File::create(partial)?);
        // The member "crs" of the format before RFC 7946, which GDAL and QGIS still read.
        let crs = layer.crs.as_ref().map_or(String::new(), |c| {
            let name = format!("urn:ogc:def:crs:EPSG::{}", c.epsg);
            format!(
                "\"crs\":{},",
                json!({ "type": "name", "properties": { "name": name } })
            )
        });
        writeln!(
            out,
            "{{\"type\":\"FeatureCollection\",\"name\":{},{crs}\"features\":[",
            json!(layer.name)
        )?;
        for row in 0..layer.vertices.len() {
            let end = if row + 1 < layer.vertices.len() { "," } else { "" };
            writeln!(out, "{}{end}", feature(layer, row))?;
        }
        writeln!(out, "]}}")?;
        Ok(out.flush()?)
    })
}

fn feature(layer: &Layer, row: usize) -> Value {
    let property = |(name, column)| {
        let value = match cell(column, row) {
            Cell::Integer(v) => json!(v),
            Cell::Real(v) => json!(v),
            Cell::Text(v) => json!(v),
            Cell::Null | Cell::Blob(_) => Value::Null,
        };
        (str::to_owned(name), value)
    };
    let properties: Map<String, Value> = layer.attributes.columns().map(property).collect();
    json!({ "type": "Feature", "properties": properties, "geometry": geometry(layer, row) })
}

fn geometry(layer: &Layer, row: usize) -> Value {
    let vertices = &layer.vertices[row];
    if super::geometry::encode(layer.geometry, 0, vertices).is_none() {
        return Value::Null;
    }
    let axes = if layer.geometry.has_z() { 3 } else { 2 };
    let place = |p: &nalgebra::Point3<f64>| {
        p.iter()
            .take(axes)
            .map(|v| (v * 1e6).round() / 1e6)
            .collect::<Vec<_>>()
    };
    let mut line: Vec<Vec<f64>> = vertices.iter().map(place).collect();
    match layer.geometry {
        Geometry::LineString | Geometry::LineStringZ => json!({ "type": "LineString", "coordinates": line }),
        Geometry::Polygon | Geometry::PolygonZ => {
            line.extend(line.first().cloned());
            json!({ "type": "Polygon", "coordinates": [line] })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::Table;
    use nalgebra::Point3;

    #[test]
    fn rings_are_closed_and_missing_values_null() {
        let mut attributes = Table::new();
        attributes
            .push("d_out", "", "d_out", vec![Some(0.25), None])
            .unwrap();
        let p = Point3::new;
        let layer = Layer {
            name: "stones".into(),
            title: String::new(),
            description: String::new(),
            geometry: Geometry::Polygon,
            crs: crate::crs::Crs::parse("EPSG:25832"),
            attributes,
            vertices: vec![
                vec![p(0.0, 0.0, 9.0), p(1.0, 0.0, 9.0), p(1.0, 1.000_000_4, 9.0)],
                vec![],
            ],
            styles: Vec::new(),
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.geojson");
        write_geojson(&path, &layer).unwrap();
        let value: Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
        let expected =
            json!({"type": "Polygon", "coordinates": [[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0]]]});
        assert_eq!(value["features"][0]["geometry"], expected);
        assert_eq!(value["crs"]["properties"]["name"], "urn:ogc:def:crs:EPSG::25832");
        assert_eq!(value["features"][0]["properties"]["d_out"], json!(0.25));
        assert_eq!(
            value["features"][1],
            json!({"type": "Feature", "geometry": null, "properties": {"d_out": null}})
        );
    }
}
