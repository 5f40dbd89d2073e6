//! GeoPackage (OGC 12-128, version 1.3) with spatial index and QGIS styles.

use super::geometry::encode;
use super::schema::{APPLICATION_ID, TABLES, USER_VERSION, rtree, rtree_triggers};
use super::{Layer, LayerStyle};
use crate::atomic::write_atomically;
use crate::crs::Crs;
#[cfg(doc)]
use crate::table::Table;
use crate::table::{Column, TableError};
use rusqlite::types::Value;
use rusqlite::{Connection, params, params_from_iter};
use std::path::{Path, PathBuf};

/// Reference system of local frames.
const UNDEFINED_CARTESIAN: i32 = -1;
/// Number of a system without a code of the EPSG, beyond all of those, as GDAL numbers them. The layers of a file have one
/// system at most.
const OWN_SYSTEM: i32 = 100_000;

/// Why layers could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LayerError {
    /// The name of a layer or column cannot be used.
    #[error("{0:?} cannot be the name of a layer or column: use letters, digits and underscores")]
    Name(String),
    /// Geometries and rows differ in number.
    #[error("layer {layer} has {rows} rows and {geometries} geometries")]
    Rows {
        /// The layer.
        layer: String,
        /// Rows of its table.
        rows: usize,
        /// Its geometries.
        geometries: usize,
    },
    /// SQLite refused.
    #[error("{path}: {source}", path = .path.display())]
    Sqlite {
        /// The file.
        path: PathBuf,
        /// What it said.
        source: rusqlite::Error,
    },
    /// A file does not hold the layer, or the layer not what it should.
    #[error("{path}: {message}", path = .path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is missing, and the fix.
        message: String,
    },
    /// The file could not be written.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// The table could not be written.
    #[error(transparent)]
    Table(#[from] TableError),
}

/// Writes layers into a new GeoPackage; replaces the file at `path` when all is written.
///
/// Columns are `fid`, `geom` and those of each layer's table; their units and meanings ([`Table::push`]) are in
/// `gpkg_data_columns`. A feature with too few or infinite vertices has no geometry. `last_change`: time stamp of the
/// content, as `2026-04-30T12:00:00.000Z`; given, not taken from the clock, so that the same results give the same
/// bytes.
///
/// # Errors
/// A name cannot be used, lengths differ, or the file cannot be written; an earlier file is kept then.
pub fn write_geopackage(path: &Path, layers: &[Layer], last_change: &str) -> Result<(), LayerError> {
    for layer in layers {
        check(layer)?;
    }
    write_atomically(path, |partial| {
        // What an interrupted earlier run may have left.
        let _ = std::fs::remove_file(partial);
        fill(partial, layers, last_change).map_err(|source| LayerError::Sqlite {
            path: path.to_owned(),
            source,
        })
    })
}

pub(super) fn check(layer: &Layer) -> Result<(), LayerError> {
    let usable = |name: &str| {
        name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
            && name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
    };
    let reserved = |name: &str| name.eq_ignore_ascii_case("fid") || name.eq_ignore_ascii_case("geom");
    let names = layer.attributes.names().filter(|n| !usable(n) || reserved(n));
    let bad = (!usable(&layer.name)).then_some(layer.name.as_str());
    if let Some(name) = bad.into_iter().chain(names).next() {
        return Err(LayerError::Name(name.to_owned()));
    }
    let (rows, geometries) = (layer.attributes.rows(), layer.vertices.len());
    if rows != geometries {
        return Err(LayerError::Rows {
            layer: layer.name.clone(),
            rows,
            geometries,
        });
    }
    Ok(())
}

fn fill(path: &Path, layers: &[Layer], last_change: &str) -> rusqlite::Result<()> {
    let mut connection = Connection::open(path)?;
    // The file is renamed into place when it is complete, so no journal is needed; first, because what is
    // written before has one, and a full disk leaves it behind.
    connection.pragma_update(None, "journal_mode", "OFF")?;
    connection.pragma_update(None, "synchronous", "OFF")?;
    connection.pragma_update(None, "application_id", APPLICATION_ID)?;
    connection.pragma_update(None, "user_version", USER_VERSION)?;
    let transaction = connection.transaction()?;
    transaction.execute_batch(TABLES)?;
    transaction.execute(
        "INSERT INTO gpkg_contents (table_name, data_type, identifier, last_change) VALUES ('layer_styles', 'attributes', \
         'layer_styles', ?1)",
        [last_change],
    )?;
    for layer in layers {
        add_layer(&transaction, layer, last_change)?;
    }
    transaction.commit()?;
    connection.close().map_err(|(_, error)| error)
}

fn add_layer(file: &Connection, layer: &Layer, last_change: &str) -> rusqlite::Result<()> {
    let number = |crs: &Crs| crs.epsg.unwrap_or(OWN_SYSTEM);
    let srs = layer.crs.as_ref().map_or(UNDEFINED_CARTESIAN, number);
    if let Some(crs) = &layer.crs {
        let organization = if crs.epsg.is_some() { "EPSG" } else { "NONE" };
        // A definition is mandatory; readers look a code of the EPSG up by themselves.
        let definition = if crs.wkt.is_empty() {
            "undefined"
        } else {
            crs.wkt.as_str()
        };
        file.execute(
            "INSERT OR IGNORE INTO gpkg_spatial_ref_sys VALUES (?1, ?2, ?4, ?2, ?3, NULL)",
            params![crs.name, srs, definition, organization],
        )?;
    }

    let name = &layer.name;
    let columns: String = layer
        .attributes
        .columns()
        .map(|(column, values)| format!(", {column} {}", sql_type(values)))
        .collect();
    let kind = layer.geometry.type_name();
    file.execute_batch(&format!(
        "CREATE TABLE {name} (fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, geom {kind}{columns});"
    ))?;
    file.execute(
        "INSERT INTO gpkg_contents (table_name, data_type, identifier, description, last_change, srs_id) \
         VALUES (?1, 'features', ?2, ?3, ?4, ?5)",
        params![name, layer.title, layer.description, last_change, srs],
    )?;

    file.execute(
        "INSERT INTO gpkg_geometry_columns VALUES (?1, 'geom', ?2, ?3, ?4, 0)",
        params![name, kind, srs, i32::from(layer.geometry.has_z())],
    )?;

    for column in layer.attributes.names() {
        if let Some((unit, meaning)) = layer.attributes.description(column) {
            let unit = if unit.is_empty() {
                String::new()
            } else {
                format!(" ({unit})")
            };
            file.execute(
                "INSERT INTO gpkg_data_columns (table_name, column_name, description) VALUES (?1, ?2, ?3)",
                params![name, column, format!("{meaning}{unit}")],
            )?;
        }
    }

    file.execute_batch(&rtree(name))?;
    let extent = add_features(file, layer, srs)?;
    if let Some([min_x, max_x, min_y, max_y]) = extent {
        file.execute(
            "UPDATE gpkg_contents SET min_x = ?2, max_x = ?3, min_y = ?4, max_y = ?5 WHERE table_name = ?1",
            params![name, min_x, max_x, min_y, max_y],
        )?;
    }

    file.execute_batch(&rtree_triggers(name))?;
    for (i, style) in layer.styles.iter().enumerate() {
        add_style(file, name, style, i == 0, last_change)?;
    }
    Ok(())
}

/// Rows and index entries; the extent of all features.
fn add_features(file: &Connection, layer: &Layer, srs: i32) -> rusqlite::Result<Option<[f64; 4]>> {
    let places: String = (0..layer.attributes.columns().len())
        .map(|i| format!(", ?{}", i + 3))
        .collect();
    let mut row = file.prepare(&format!("INSERT INTO {} VALUES (?1, ?2{places})", layer.name))?;
    let mut index = file.prepare(&format!(
        "INSERT INTO rtree_{}_geom VALUES (?1, ?2, ?3, ?4, ?5)",
        layer.name
    ))?;
    let mut extent: Option<[f64; 4]> = None;
    for (i, vertices) in layer.vertices.iter().enumerate() {
        let fid = i as i64 + 1;
        let encoded = encode(layer.geometry, srs, vertices);
        let blob = encoded
            .as_ref()
            .map_or(Value::Null, |(blob, _)| Value::Blob(blob.clone()));
        let cells = layer.attributes.columns().map(|(_, column)| cell(column, i));
        row.execute(params_from_iter(
            [Value::Integer(fid), blob].into_iter().chain(cells),
        ))?;
        if let Some((_, [min_x, max_x, min_y, max_y])) = encoded {
            index.execute(params![fid, min_x, max_x, min_y, max_y])?;
            let e = extent.get_or_insert([min_x, max_x, min_y, max_y]);
            *e = [e[0].min(min_x), e[1].max(max_x), e[2].min(min_y), e[3].max(max_y)];
        }
    }
    Ok(extent)
}

fn add_style(
    file: &Connection,
    table: &str,
    style: &LayerStyle,
    default: bool,
    time: &str,
) -> rusqlite::Result<()> {
    file.execute(
        "INSERT INTO layer_styles (f_table_catalog, f_table_schema, f_table_name, f_geometry_column, styleName, styleQML, \
         styleSLD, useAsDefault, description, owner, update_time) VALUES ('', '', ?1, 'geom', ?2, ?3, '', ?4, ?5, '', ?6)",
        params![table, style.name, style.qml, default, style.description, time],
    )?;
    Ok(())
}

/// Type of a column in the GeoPackage standard's words.
fn sql_type(column: &Column) -> &'static str {
    if column.values::<String>().is_some() {
        "TEXT"
    } else if column.values::<f64>().is_some() || column.values::<f32>().is_some() {
        "DOUBLE"
    } else if column.values::<bool>().is_some() {
        "BOOLEAN"
    } else if column.values::<Vec<u8>>().is_some() {
        "BLOB"
    } else {
        "INTEGER"
    }
}

/// A cell; empty cells and numbers that are not finite become NULL.
fn cell(column: &Column, row: usize) -> Value {
    if !column.is_filled(row) {
        return Value::Null;
    }

    let real = |v: f64| {
        if v.is_finite() {
            Value::Real(v)
        } else {
            Value::Null
        }
    };

    let integer = column
        .values::<u32>()
        .map(|v| i64::from(v[row]))
        .or_else(|| column.values::<i64>().map(|v| v[row]))
        .or_else(|| column.values::<u16>().map(|v| i64::from(v[row])))
        .or_else(|| column.values::<u8>().map(|v| i64::from(v[row])))
        .or_else(|| {
            column
                .values::<u64>()
                .map(|v| i64::try_from(v[row]).unwrap_or(i64::MAX))
        })
        .or_else(|| column.values::<bool>().map(|v| i64::from(v[row])));

    if let Some(value) = integer {
        Value::Integer(value)
    } else if let Some(v) = column.values::<f64>() {
        real(v[row])
    } else if let Some(v) = column.values::<f32>() {
        real(f64::from(v[row]))
    } else {
        let text = column.values::<String>().map(|v| Value::Text(v[row].clone()));
        text.or_else(|| column.values::<Vec<u8>>().map(|v| Value::Blob(v[row].clone())))
            .unwrap_or(Value::Null)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layers::Geometry;
    use crate::table::Table;
    use nalgebra::Point3;

    fn layer() -> Layer {
        let mut attributes = Table::new();
        attributes
            .push("stone_id", "", "stone", vec![7u32, 9, 11])
            .unwrap();
        attributes
            .push(
                "d_out",
                "m",
                "displacement out of the wall",
                vec![Some(0.012), None, Some(f64::NAN)],
            )
            .unwrap();
        attributes
            .push(
                "status",
                "",
                "status",
                ["ok", "<script>'\"", ""].map(str::to_owned).to_vec(),
            )
            .unwrap();
        attributes
            .push("loose", "", "flag", vec![Some(1u8), Some(0), None])
            .unwrap();
        let p = Point3::new;
        let triangle = vec![p(1.0, 2.0, 3.0), p(4.0, 2.0, 3.0), p(4.0, 6.0, 5.0)];
        let style = LayerStyle {
            name: "out".into(),
            description: String::new(),
            qml: "<qgis/>".into(),
        };
        Layer {
            name: "stones".into(),
            title: "Stones".into(),
            description: "test".into(),
            geometry: Geometry::PolygonZ,
            crs: None,
            attributes,
            vertices: vec![
                triangle.clone(),
                Vec::new(),
                triangle.iter().map(|p| p * 10.0).collect(),
            ],
            styles: vec![style],
        }
    }

    fn written(layers: &[Layer]) -> (tempfile::TempDir, Connection) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gpkg");
        write_geopackage(&path, layers, "2026-01-01T00:00:00.000Z").unwrap();
        (folder, Connection::open(path).unwrap())
    }

    #[test]
    fn rows_index_extent_and_style_are_there() {
        let (_folder, file) = written(&[layer()]);
        let one = |sql: &str| file.query_row(sql, [], |r| r.get::<_, Value>(0)).unwrap();
        assert_eq!(one("PRAGMA integrity_check"), Value::Text("ok".into()));
        assert_eq!(one("PRAGMA application_id"), Value::Integer(0x4750_4B47));
        assert_eq!(
            one("SELECT count(*) FROM stones WHERE d_out IS NULL AND geom IS NOT NULL"),
            Value::Integer(1)
        );
        assert_eq!(
            one("SELECT status FROM stones WHERE stone_id = 9"),
            Value::Text("<script>'\"".into())
        );
        assert_eq!(
            one("SELECT max_y FROM gpkg_contents WHERE table_name = 'stones'"),
            Value::Real(60.0)
        );
        assert_eq!(
            one("SELECT id FROM rtree_stones_geom WHERE minx < 5 AND maxx > 2"),
            Value::Integer(1)
        );
        assert_eq!(one("SELECT count(*) FROM rtree_stones_geom"), Value::Integer(2));
        assert_eq!(
            one("SELECT group_concat(column_name || ': ' || description) FROM gpkg_data_columns"),
            Value::Text(
                "stone_id: stone,d_out: displacement out of the wall (m),status: status,loose: flag".into()
            )
        );
        assert_eq!(
            one("SELECT styleQML FROM layer_styles WHERE useAsDefault"),
            Value::Text("<qgis/>".into())
        );
        assert_eq!(
            one("SELECT count(*) FROM pragma_foreign_key_check"),
            Value::Integer(0)
        );
    }

    #[test]
    fn the_index_follows_edits() {
        let (_folder, file) = written(&[layer()]);
        // The functions that a GeoPackage reader brings, as far as the test needs them.
        let flags = rusqlite::functions::FunctionFlags::SQLITE_DETERMINISTIC;
        for (name, value) in [
            ("ST_MinX", 1.0),
            ("ST_MaxX", 2.0),
            ("ST_MinY", 3.0),
            ("ST_MaxY", 4.0),
            ("ST_IsEmpty", 0.0),
        ] {
            file.create_scalar_function(name, 1, flags, move |_| Ok(value))
                .unwrap();
        }
        let count = || {
            file.query_row("SELECT count(*) FROM rtree_stones_geom", [], |r| {
                r.get::<_, i64>(0)
            })
            .unwrap()
        };
        file.execute_batch("INSERT INTO stones (fid, geom) VALUES (50, x'00')")
            .unwrap();
        assert_eq!(count(), 3);
        let entry = |id: i64| {
            let sql = "SELECT minx, maxx, miny, maxy FROM rtree_stones_geom WHERE id = ?1";
            let numbers = |r: &rusqlite::Row| Ok([r.get::<_, f64>(0)?, r.get(1)?, r.get(2)?, r.get(3)?]);
            file.query_row(sql, [id], numbers).unwrap()
        };
        assert_eq!(entry(50), [1.0, 2.0, 3.0, 4.0]);
        file.execute_batch(
            "UPDATE stones SET fid = 51 WHERE fid = 50; UPDATE stones SET geom = x'01' WHERE fid = 51",
        )
        .unwrap();
        assert_eq!((count(), entry(51)), (3, [1.0, 2.0, 3.0, 4.0]));
        file.execute_batch("UPDATE stones SET geom = NULL WHERE fid = 51; DELETE FROM stones WHERE fid = 1")
            .unwrap();
        assert_eq!(count(), 1);
    }

    #[test]
    fn names_that_sql_could_misread_and_uneven_layers_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gpkg");
        let mut bad = layer();
        bad.name = "stones; DROP TABLE x".into();
        assert!(matches!(
            write_geopackage(&path, &[bad], ""),
            Err(LayerError::Name(_))
        ));
        let mut uneven = layer();
        uneven.vertices.pop();
        assert!(matches!(
            write_geopackage(&path, &[uneven], ""),
            Err(LayerError::Rows { .. })
        ));
        assert!(!path.exists());
    }

    #[test]
    fn the_same_layers_give_the_same_bytes() {
        let bytes = || {
            let (folder, file) = written(&[layer()]);
            drop(file);
            std::fs::read(folder.path().join("a.gpkg")).unwrap()
        };
        assert_eq!(bytes(), bytes());
    }
}
