//! Polygons of a layer, as another program left them.

use super::LayerError;
use super::polygon_blob::{Ring, polygons};
use rusqlite::types::ValueRef;
use rusqlite::{Connection, OpenFlags, Row};
use std::collections::BTreeMap;
use std::path::Path;

/// A feature of a layer.
#[derive(Clone, Debug, PartialEq)]
pub struct PolygonFeature {
    /// Its number in the layer.
    pub fid: i64,
    /// Its polygons: an outer ring and its holes each, vertices (x, y), the first not repeated.
    pub polygons: Vec<Vec<Ring>>,
    /// Its attributes as text; empty cells are left out.
    pub attributes: BTreeMap<String, String>,
}

/// Reads the features of a layer of polygons in a GeoPackage, by number; features without geometry are left
/// out.
///
/// # Errors
/// The file is no GeoPackage or lacks the layer, or a geometry is damaged or not a polygon.
pub fn read_polygons(path: &Path, layer: &str) -> Result<Vec<PolygonFeature>, LayerError> {
    let content = |message: String| LayerError::Content {
        path: path.to_owned(),
        message,
    };
    if !path.is_file() {
        return Err(content("no such file".to_owned()));
    }
    let sqlite = |source| LayerError::Sqlite {
        path: path.to_owned(),
        source,
    };
    let file = Connection::open_with_flags(path, OpenFlags::SQLITE_OPEN_READ_ONLY).map_err(sqlite)?;
    let column: Result<String, _> = file.query_row(
        "SELECT column_name FROM gpkg_geometry_columns WHERE table_name = ?1",
        [layer],
        |row| row.get(0),
    );

    let column = column.map_err(|error| match error {
        rusqlite::Error::QueryReturnedNoRows => content(format!("no layer {layer:?} in it")),
        other => sqlite(other),
    })?;

    // The name is one of the file's own tables; quotes in it are doubled.
    let table = layer.replace('"', "\"\"");
    let mut query = file
        .prepare(&format!("SELECT rowid, * FROM \"{table}\" ORDER BY rowid"))
        .map_err(sqlite)?;
    let names: Vec<String> = query.column_names().map(str::to_owned).collect();
    let mut rows = query.query([]).map_err(sqlite)?;
    let mut features = Vec::new();

    while let Some(row) = rows.next().map_err(sqlite)? {
        let (fid, blob, attributes) = cells(row, &names, &column).map_err(sqlite)?;
        let Some(blob) = blob else { continue };
        let polygons = polygons(&blob)
            .ok_or_else(|| content(format!("feature {fid} of {layer} is damaged or not a polygon")))?;
        features.push(PolygonFeature {
            fid,
            polygons,
            attributes,
        });
    }

    Ok(features)
}

/// Number, geometry and attributes of a row.
type Cells = (i64, Option<Vec<u8>>, BTreeMap<String, String>);

fn cells(row: &Row, names: &[String], geometry: &str) -> rusqlite::Result<Cells> {
    let (mut blob, mut attributes) = (None, BTreeMap::new());
    for (i, name) in names.iter().enumerate().skip(1) {
        let text = match row.get_ref(i)? {
            ValueRef::Blob(bytes) if name == geometry => {
                blob = Some(bytes.to_vec());
                continue;
            }
            ValueRef::Integer(v) => v.to_string(),
            ValueRef::Real(v) => v.to_string(),
            ValueRef::Text(v) => String::from_utf8_lossy(v).into_owned(),
            ValueRef::Null | ValueRef::Blob(_) => continue,
        };
        attributes.insert(name.clone(), text);
    }
    Ok((row.get(0)?, blob, attributes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layers::{Geometry, Layer, write_geopackage};
    use crate::table::Table;
    use nalgebra::Point3;

    #[test]
    fn a_written_layer_comes_back_and_other_files_are_named() {
        let mut attributes = Table::new();
        attributes
            .push("stone_id", "", "stone_id", vec![7u32, 9])
            .unwrap();
        attributes
            .push("status", "", "status", ["ok", "it's"].map(str::to_owned).to_vec())
            .unwrap();
        attributes
            .push("d_out", "", "d_out", vec![Some(0.5), None])
            .unwrap();
        let ring = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]];
        let layer = Layer {
            name: "stones_facade".into(),
            title: "Stones".into(),
            description: String::new(),
            geometry: Geometry::Polygon,
            crs: None,
            attributes,
            vertices: vec![ring.map(|[x, y]| Point3::new(x, y, 0.0)).to_vec(), Vec::new()],
            styles: Vec::new(),
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gpkg");
        write_geopackage(&path, &[layer], "2026-01-01T00:00:00.000Z").unwrap();
        let read = read_polygons(&path, "stones_facade").unwrap();
        assert_eq!(read.len(), 1, "the feature without geometry is left out");
        assert_eq!(read[0].polygons, vec![vec![ring.to_vec()]]);
        assert_eq!(read[0].attributes["stone_id"], "7");
        assert_eq!(read[0].attributes["d_out"], "0.5");
        let missing = read_polygons(&path, "joints").unwrap_err().to_string();
        assert!(
            missing.contains("no layer \"joints\"") && missing.contains("a.gpkg"),
            "{missing}"
        );
        std::fs::write(&path, "no database").unwrap();
        assert!(read_polygons(&path, "stones_facade").is_err());
        assert!(read_polygons(&folder.path().join("b.gpkg"), "x").is_err());
    }
}
