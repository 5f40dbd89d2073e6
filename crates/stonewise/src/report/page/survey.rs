//! The survey data of the cover: what was measured with what.

use super::html::{details, table};
use crate::figure::{count, escape, number};
use crate::report::ResultSet;
use serde_json::Value;
use std::fmt::Write;
use std::path::Path;

/// A table of the epochs, folded on the screen and open on the printed cover; empty where run.json has none.
pub(super) fn survey(results: &ResultSet) -> String {
    let Some(epochs) = results.run.get("epochs").and_then(Value::as_array) else {
        return String::new();
    };
    let compared = [0, results.pair];
    let chosen: Vec<&Value> = compared.iter().filter_map(|e| epochs.get(*e)).collect();
    let whole = |epoch: &Value, key: &str| {
        let value = epoch.get(key).and_then(Value::as_u64);
        value.map_or("\u{2013}".into(), |v| {
            count(usize::try_from(v).unwrap_or(usize::MAX))
        })
    };
    let row = |what: &str, cell: &dyn Fn(&Value) -> String| {
        let mut row = vec![what.to_owned()];
        row.extend(chosen.iter().map(|e| cell(e)));
        row
    };
    let rows = vec![
        row("point clouds", &|e| files(e.get("clouds"))),
        row("points", &|e| whole(e, "points")),
        row("camera file", &|e| files(e.get("cameras"))),
        row("photos used", &|e| whole(e, "photos")),
        row("masks", &|e| files(e.get("masks"))),
        row("stones found", &|e| whole(e, "stones")),
        row("known motion put in", &known_motion),
    ];
    let heads: Vec<String> = chosen
        .iter()
        .map(|e| e.get("name").and_then(Value::as_str).unwrap_or("").to_owned())
        .collect();
    let mut head = vec!["epoch"];
    head.extend(heads.iter().map(String::as_str));
    let columns = head.len();
    let crs = results
        .run
        .get("crs")
        .and_then(|c| c.get("name"))
        .and_then(Value::as_str);
    let frame = crs.map_or("the survey's own local frame, metres".into(), escape);
    details(
        "Survey data",
        &format!(
            "{}<p class=\"note\">Coordinates: {frame}.</p>",
            table(&head, &rows, columns)
        ),
    )
}

/// Names and sizes of one input or a list of them.
fn files(value: Option<&Value>) -> String {
    let one = |input: &Value| {
        let path = input.get("path").and_then(Value::as_str)?;
        let name = Path::new(path)
            .file_name()
            .map_or(path.into(), |n| n.to_string_lossy());
        let size = input.get("bytes").and_then(Value::as_u64);
        let size = size.map_or(String::new(), |b| format!(" ({})", bytes(b)));
        Some(format!("{}{size}", escape(&name)))
    };
    let list: Vec<String> = match value {
        Some(Value::Array(items)) => items.iter().filter_map(one).collect(),
        Some(item) => one(item).into_iter().collect(),
        None => Vec::new(),
    };
    if list.is_empty() {
        "\u{2013}".into()
    } else {
        list.join("<br>")
    }
}

/// A size of a file in the unit that suits it.
fn bytes(value: u64) -> String {
    let value = value as f64;
    if value < 1e5 {
        format!("{:.0}\u{a0}kB", (value / 1e3).max(1.0))
    } else {
        format!("{:.1}\u{a0}MB", value / 1e6)
    }
}

/// Kind of the motion and its numbers, metres.
fn known_motion(epoch: &Value) -> String {
    let Some(Value::Object(parts)) = epoch.get("motion") else {
        return "none".into();
    };
    let kind = parts.get("kind").and_then(Value::as_str).unwrap_or("motion");
    let mut text = escape(kind);
    for (key, value) in parts.iter().filter(|(key, _)| *key != "kind") {
        let numbers: Vec<String> = match value {
            Value::Array(items) => items.iter().map(metres).collect(),
            value => vec![metres(value)],
        };
        let _ = write!(text, "; {} {}", escape(key), numbers.join(", "));
    }
    text
}

fn metres(value: &Value) -> String {
    number(value.as_f64().unwrap_or(f64::NAN), 3)
}
