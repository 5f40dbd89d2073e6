//! The survey data of the cover: what was measured with what.

use super::html::{details, table};
use crate::figure::{count, escape, number};
use crate::results::ResultSet;
use crate::results::records::{EpochRecord, InputRecord};
use serde_json::Value;
use std::fmt::Write;
use stonewise_core::evaluate::MotionField;

/// A table of the epochs, folded on the screen and open on the printed cover; empty without run.json.
pub(super) fn survey(results: &ResultSet) -> String {
    let Some(run) = &results.run else {
        return String::new();
    };
    let chosen: Vec<&EpochRecord> = [0, results.pair]
        .into_iter()
        .filter_map(|epoch| run.epochs.get(epoch))
        .collect();
    let row = |what: &str, cell: &dyn Fn(&EpochRecord) -> String| {
        let mut row = vec![what.to_owned()];
        row.extend(chosen.iter().map(|e| cell(e)));
        row
    };
    let dash = || "\u{2013}".to_owned();
    let rows = vec![
        row("date", &|e| e.date.as_deref().map_or_else(dash, escape)),
        row("conditions", &conditions),
        row("point clouds", &|e| files(&e.clouds)),
        row("points", &|e| {
            count(usize::try_from(e.points).unwrap_or(usize::MAX))
        }),
        row("camera file", &|e| file(&e.cameras)),
        row("photos used", &|e| count(e.photos)),
        row("masks", &|e| e.masks.as_ref().map_or_else(dash, file)),
        row("stones found", &|e| count(e.stones)),
        row("known motion put in", &|e| {
            e.motion.as_ref().map_or("none".into(), known_motion)
        }),
    ];
    let mut head = vec!["epoch"];
    head.extend(chosen.iter().map(|e| e.name.as_str()));
    let columns = head.len();
    let local = || "the survey's own local frame, metres".to_owned();
    let frame = run.crs.as_ref().map_or_else(local, |crs| escape(&crs.name));
    details(
        "Survey data",
        &format!(
            "{}<p class=\"note\">Coordinates: {frame}.</p>",
            table(&head, &rows, columns)
        ),
    )
}

/// Conditions by name.
fn conditions(epoch: &EpochRecord) -> String {
    let one = |(name, value): (&String, &f64)| format!("{} {value}", escape(name));
    let list: Vec<String> = epoch.conditions.iter().map(one).collect();
    if list.is_empty() {
        "\u{2013}".into()
    } else {
        list.join("<br>")
    }
}

/// Names and sizes of inputs.
fn files(inputs: &[InputRecord]) -> String {
    inputs.iter().map(file).collect::<Vec<_>>().join("<br>")
}

/// Name and size of an input.
fn file(input: &InputRecord) -> String {
    let name = input.path.file_name().unwrap_or(input.path.as_os_str());
    format!("{} ({})", escape(&name.to_string_lossy()), bytes(input.bytes))
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
fn known_motion(motion: &MotionField) -> String {
    let Ok(Value::Object(parts)) = serde_json::to_value(motion) else {
        return String::new();
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
