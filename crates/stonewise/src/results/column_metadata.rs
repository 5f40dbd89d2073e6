//! Units and meanings of the columns of a table, for people and programs.

use crate::error::{Error, Result};
use serde_json::{Value, json};
use std::path::Path;
use stonewise_io::atomic::write_atomically;

/// What a column of a CSV file holds.
pub(crate) struct ColumnNote {
    /// Name in the header.
    pub name: &'static str,
    /// Type of the cells in the words of XML Schema.
    pub datatype: &'static str,
    /// Unit; empty for counts, names and flags.
    pub unit: &'static str,
    /// What it holds.
    pub meaning: &'static str,
}

impl ColumnNote {
    pub(crate) const fn new(
        name: &'static str,
        datatype: &'static str,
        unit: &'static str,
        meaning: &'static str,
    ) -> Self {
        Self {
            name,
            datatype,
            unit,
            meaning,
        }
    }
}

/// Name of a cell's type that stands for any number of integers with spaces between them.
pub(crate) const INTEGERS: &str = "integers";

/// Writes `NAME.csv-metadata.json` beside `NAME.csv`: units and meanings of its columns, after the W3C's CSV
/// on the Web.
///
/// Source: Tennison & Kellogg 2015, "Metadata Vocabulary for Tabular Data"; units as schema.org's `unitText`.
///
/// # Errors
/// The file cannot be written.
pub(crate) fn write_csv_metadata(
    csv: &Path,
    description: &str,
    primary_key: Option<&str>,
    columns: impl IntoIterator<Item = ColumnNote>,
) -> Result<()> {
    let name = csv.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let text = column_metadata(&name, description, primary_key, columns);
    let metadata = csv.with_file_name(format!("{name}-metadata.json"));
    write_atomically(&metadata, |partial| std::fs::write(partial, text))
        .map_err(Error::io("writing the metadata of the columns", &metadata))
}

fn column_metadata(
    csv: &str,
    description: &str,
    primary_key: Option<&str>,
    columns: impl IntoIterator<Item = ColumnNote>,
) -> String {
    let columns = columns.into_iter().map(|column| {
        let is_list = column.datatype == INTEGERS;
        let mut document = json!({
            "name": column.name,
            "titles": column.name,
            "datatype": if is_list { "integer" } else { column.datatype },
            "dc:description": column.meaning,
        });
        if is_list {
            document["separator"] = Value::from(" ");
        }
        if !column.unit.is_empty() {
            document["schema:unitText"] = Value::from(column.unit);
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

/// Checks that the metadata beside a CSV file describe the columns of its header, in their order.
#[cfg(test)]
pub(crate) fn check_csv_metadata(csv: &Path) {
    let header = std::fs::read_to_string(csv).unwrap();
    let name = csv.file_name().unwrap().to_string_lossy().into_owned();
    let metadata = std::fs::read(csv.with_file_name(format!("{name}-metadata.json"))).unwrap();
    let document: Value = serde_json::from_slice(&metadata).unwrap();
    assert_eq!(document["url"], name.as_str());
    let columns = document["tableSchema"]["columns"].as_array().unwrap();
    let names: Vec<&str> = columns.iter().filter_map(|c| c["name"].as_str()).collect();
    let expected: Vec<&str> = header.lines().next().unwrap().split(',').collect();
    assert_eq!(names, expected);
    for column in columns {
        let meaning = column["dc:description"].as_str().unwrap();
        assert!(!meaning.is_empty(), "{column}");
    }
}
