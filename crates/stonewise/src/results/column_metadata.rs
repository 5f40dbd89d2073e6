//! Units and meanings of the columns of a stone table, for people and programs.

use super::columns::StoneColumn;
use serde_json::{Value, json};

/// The sidecar of a stone table as text, after the W3C's CSV on the Web; `csv`: name of the table's file.
///
/// Source: Tennison & Kellogg 2015, "Metadata Vocabulary for Tabular Data"; units as schema.org's `unitText`.
pub(super) fn column_metadata(csv: &str, columns: impl Iterator<Item = &'static StoneColumn>) -> String {
    let columns = columns.map(|column| {
        let mut document = json!({
            "name": column.name,
            "titles": column.name,
            "datatype": column.datatype(),
            "dc:description": column.meaning,
        });
        if !column.unit.is_empty() {
            document["schema:unitText"] = Value::from(column.unit);
        }
        document
    });
    let document = json!({
        "@context": "http://www.w3.org/ns/csvw",
        "url": csv,
        "dc:description": "One row per stone of the first epoch. Displacements are later epoch minus first. Empty cells: not measured.",
        "tableSchema": { "primaryKey": "stone_id", "columns": columns.collect::<Vec<_>>() },
    });
    format!("{document:#}\n")
}
