//! Units and meanings of the columns of a CSV file, for people and programs.

use std::path::Path;

use serde_json::{Value, json};

use super::column::Values;
use super::{Column, Table, TableError};
use crate::atomic::write_atomically;

/// Writes `NAME.csv-metadata.json` beside `NAME.csv`, for the columns of `table`; it may have no rows.
///
/// `description`: what the file as a whole holds. `primary_key`: the column that identifies a row, if there
/// is one.
///
/// Source: Tennison & Kellogg 2015, "Metadata Vocabulary for Tabular Data"; units as schema.org's `unitText`.
///
/// # Errors
/// The file cannot be written.
pub fn write_csv_metadata(
    csv: &Path,
    table: &Table,
    description: &str,
    primary_key: Option<&str>,
) -> Result<(), TableError> {
    let name = csv.file_name().unwrap_or_default().to_string_lossy();
    let path = csv.with_file_name(format!("{name}-metadata.json"));
    write_metadata_of(&name, &path, table, description, primary_key)
}

/// Writes the metadata of a table into the file `path`; `csv`: the way from its folder to the table, with `/`.
pub(super) fn write_metadata_of(
    csv: &str,
    path: &Path,
    table: &Table,
    description: &str,
    primary_key: Option<&str>,
) -> Result<(), TableError> {
    let text = csv_metadata(csv, table, description, primary_key);
    write_atomically(path, |partial| std::fs::write(partial, text))
        .map_err(|e: std::io::Error| TableError::unwritable(path, e))
}

fn csv_metadata(csv: &str, table: &Table, description: &str, primary_key: Option<&str>) -> String {
    let columns = table.columns().map(|(name, column)| {
        let (unit, meaning) = table.description(name).unwrap_or_default();
        let mut document = json!({
            "name": name,
            "titles": name,
            "datatype": datatype(column),
            "dc:description": meaning,
        });
        if column.is_list() {
            document["separator"] = Value::from(" ");
        }
        if !unit.is_empty() {
            document["schema:unitText"] = Value::from(unit);
        }
        document
    });
    let mut schema = json!({ "columns": columns.collect::<Vec<_>>() });
    if let Some(key) = primary_key {
        schema["primaryKey"] = Value::from(key);
    }
    let document = json!({
        "@context": "http://www.w3.org/ns/csvw",
        "url": csv,
        "dc:description": description,
        "tableSchema": schema,
    });
    format!("{document:#}\n")
}

/// Type of the cells in the terms of XML Schema; for lists, that of their items.
fn datatype(column: &Column) -> &'static str {
    match column.raw() {
        Values::F64(_) | Values::F32(_) => "number",
        Values::I64(_) | Values::U64(_) | Values::U32(_) | Values::U16(_) | Values::U8(_) => "integer",
        Values::Bool(_) => "boolean",
        Values::Text(_) if column.is_list() => "integer",
        Values::Text(_) => "string",
        Values::Bytes(_) => "hexBinary",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::write_csv;

    #[test]
    fn metadata_hold_type_unit_and_meaning_of_each_column() {
        let folder = tempfile::tempdir().unwrap();
        let csv = folder.path().join("stones.csv");
        let mut table = Table::new();
        table.push("stone_id", "", "number", vec![1u32, 2]).unwrap();
        table.push("dx", "m", "shift", vec![Some(0.5), None]).unwrap();
        table
            .push("parts", "", "its parts", vec![vec![3u32, 14], vec![]])
            .unwrap();
        write_csv(&csv, &table, "Stones.", Some("stone_id")).unwrap();
        assert_eq!(
            std::fs::read_to_string(&csv).unwrap(),
            "stone_id,dx,parts\n1,0.5,3 14\n2,,\"\"\n"
        );
        let text = std::fs::read(folder.path().join("stones.csv-metadata.json")).unwrap();
        let found: Value = serde_json::from_slice(&text).unwrap();
        let expected = r#"{
            "@context": "http://www.w3.org/ns/csvw",
            "url": "stones.csv",
            "dc:description": "Stones.",
            "tableSchema": {
                "columns": [
                    {"name": "stone_id", "titles": "stone_id", "datatype": "integer", "dc:description": "number"},
                    {"name": "dx", "titles": "dx", "datatype": "number", "dc:description": "shift", "schema:unitText": "m"},
                    {"name": "parts", "titles": "parts", "datatype": "integer", "separator": " ", "dc:description": "its parts"}
                ],
                "primaryKey": "stone_id"
            }
        }"#;
        assert_eq!(found, serde_json::from_str::<Value>(expected).unwrap());
    }
}
