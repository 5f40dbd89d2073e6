//! Where the numbers come from: warnings, parameters, digests, times.

use super::html::{details, section, table};
use crate::figure::{count, escape, number};
use crate::results::ResultSet;
use crate::results::records::StepTime;
use crate::warnings::Warning;
use serde::Serialize;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

/// Rows of a list of decisions at most.
const MAX_DECISIONS: usize = 150;

/// Decisions about masks, the adjustment, and everything in run.json, warnings first.
pub(super) fn audit(results: &ResultSet) -> String {
    let mut out = match &results.run {
        Some(run) => warnings(&run.warnings),
        None => "<p>There is no run.json beside the results.</p>".to_owned(),
    };
    out.push_str(&edits(&results.edits));
    out.push_str(&decision_counts(&results.decisions));
    if let Some(run) = &results.run {
        out.push_str(&details("Steps, times and memory", &steps(&run.steps)));
        out.push_str(&details("Epochs", &tree_of(&run.epochs)));
        out.push_str(&details("Parameters", &tree_of(&run.parameters)));
        if let Some(part) = &run.part {
            out.push_str(&details("Part of the survey", &tree_of(part)));
        }
    }
    if let Some(registration) = &results.registration {
        out.push_str(&details(
            "Adjustment of the motions (registration.json)",
            &tree_of(registration),
        ));
    }
    out.push_str(&decision_lists(&results.decisions));
    section("audit", "Audit", &out)
}

/// What a person corrected, with who, when and why, and what came of it; the head first.
fn edits(rows: &[Vec<String>]) -> String {
    let Some((head, rows)) = rows.split_first() else {
        return String::new();
    };
    let cells = |row: &Vec<String>| row.iter().map(|c| escape(c)).collect();
    let rows: Vec<Vec<String>> = rows.iter().map(cells).collect();
    let head: Vec<String> = head.iter().map(|h| words(h)).collect();
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let note = "<p class=\"note\">The maps draw the outlines of edited stones dashed.</p>";
    format!("<h3>Edits by hand</h3>{}{note}", table(&head, &rows, head.len()))
}

/// What was done, how long it took, and the highest memory up to its end.
fn steps(steps: &[StepTime]) -> String {
    let or_dash = |v: Option<f64>| v.map_or("\u{2013}".into(), |v| number(v, 1));
    let row = |step: &StepTime| {
        vec![
            escape(&step.step),
            number(step.seconds, 1),
            or_dash(step.processor_seconds),
            or_dash(step.peak_memory_bytes.map(|b| b as f64 / 1e6)),
            if step.resumed {
                "taken from an earlier run"
            } else {
                ""
            }
            .into(),
        ]
    };
    let rows: Vec<Vec<String>> = steps.iter().map(row).collect();
    let head = ["step", "seconds", "processor seconds", "highest memory MB", ""];
    table(&head, &rows, 1)
}

/// How many mask instances were merged, split, dropped, by epoch.
fn decision_counts(epochs: &[Vec<Vec<String>>]) -> String {
    let counted: Vec<BTreeMap<&str, usize>> = epochs
        .iter()
        .map(|rows| {
            let mut kinds = BTreeMap::new();
            rows.iter()
                .for_each(|row| *kinds.entry(row[0].as_str()).or_insert(0) += 1);
            kinds
        })
        .collect();
    let kinds: BTreeSet<&str> = counted.iter().flat_map(|k| k.keys().copied()).collect();
    if kinds.is_empty() {
        return String::new();
    }
    let mut head = vec!["decision of the majority of the photos".to_owned()];
    head.extend((1..=epochs.len()).map(|e| format!("epoch {e}")));
    let row = |kind: &&str| {
        let mut row = vec![escape(&words(kind))];
        row.extend(counted.iter().map(|e| count(e.get(*kind).copied().unwrap_or(0))));
        row
    };
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    format!(
        "<h3>Decisions about mask instances</h3>{}",
        table(&head, &kinds.iter().map(row).collect::<Vec<_>>(), 1)
    )
}

/// Which instances were merged, split, dropped.
fn decision_lists(epochs: &[Vec<Vec<String>>]) -> String {
    epochs
        .iter()
        .zip(1..)
        .map(|(rows, number)| decision_list(rows, number))
        .collect()
}

/// The decisions of one epoch, one a row.
fn decision_list(rows: &[Vec<String>], number: usize) -> String {
    if rows.is_empty() {
        return String::new();
    }
    let text = |row: &Vec<String>| {
        let mut cells: Vec<String> = row.iter().map(|c| escape(c)).collect();
        cells.resize(6, String::new());
        cells[0] = escape(&words(&row[0]));
        cells
    };
    let shown: Vec<Vec<String>> = rows.iter().take(MAX_DECISIONS).map(text).collect();
    let rest = if rows.len() > MAX_DECISIONS {
        format!(
            "<p class=\"note\">{MAX_DECISIONS} of {}; all are in audit_epoch{number}.csv.</p>",
            count(rows.len())
        )
    } else {
        String::new()
    };
    let head = ["decision", "photo", "instance", "stones", "share", "points"];
    details(
        &format!(
            "Merged, split and dropped masks of epoch {number} ({})",
            count(rows.len())
        ),
        &format!("{}{rest}", table(&head, &shown, 2)),
    )
}

fn warnings(warnings: &[Warning]) -> String {
    if warnings.is_empty() {
        return "<p>No warnings.</p>".into();
    }
    let row = |w: &Warning| {
        vec![
            escape(&w.step),
            escape(&w.subject),
            escape(&w.message),
            if w.skipped_input { "<b>left out</b>" } else { "" }.into(),
        ]
    };
    let rows: Vec<Vec<String>> = warnings.iter().map(row).collect();
    let left_out = warnings.iter().filter(|w| w.skipped_input).count();
    format!(
        "<h3>Warnings ({}; inputs left out: {})</h3>{}",
        count(warnings.len()),
        count(left_out),
        table(&["step", "about", "what happened", "input"], &rows, 4)
    )
}

/// A record as nested lists, see [`tree`].
fn tree_of(record: &impl Serialize) -> String {
    serde_json::to_value(record).map_or_else(|_| String::new(), |value| tree(&value))
}

/// A document as nested lists; arrays of plain values on one line, arrays of plain objects as a table.
fn tree(value: &Value) -> String {
    match value {
        Value::Object(map) => {
            let items: String = map
                .iter()
                .map(|(k, v)| format!("<dt>{}</dt><dd>{}</dd>", escape(k), tree(v)))
                .collect();
            format!("<dl>{items}</dl>")
        }
        Value::Array(items) if !items.is_empty() && items.iter().all(is_flat_object) => rows(items),
        Value::Array(items) if items.iter().any(|v| v.is_object() || v.is_array()) => {
            let items: String = items.iter().map(|v| format!("<li>{}</li>", tree(v))).collect();
            format!("<ol>{items}</ol>")
        }
        Value::Array(items) => items.iter().map(scalar).collect::<Vec<_>>().join(", "),
        _ => scalar(value),
    }
}

fn is_flat_object(value: &Value) -> bool {
    value
        .as_object()
        .is_some_and(|o| o.values().all(|v| !v.is_object() && !v.is_array()))
}

/// Objects of plain values as a table, columns in the order of the first.
fn rows(items: &[Value]) -> String {
    let keys: Vec<&String> = items
        .first()
        .and_then(Value::as_object)
        .map_or(Vec::new(), |o| o.keys().collect());
    let head: Vec<String> = keys.iter().map(|k| words(k)).collect();
    let row = |item: &Value| {
        keys.iter()
            .map(|k| scalar(item.get(k.as_str()).unwrap_or(&Value::Null)))
            .collect()
    };
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    table(&head, &items.iter().map(row).collect::<Vec<_>>(), head.len())
}

fn scalar(value: &Value) -> String {
    match value {
        Value::Null => "–".into(),
        Value::String(s) => escape(s),
        Value::Number(n) if n.is_f64() => float(n.as_f64().unwrap_or(f64::NAN)),
        other => escape(&other.to_string()),
    }
}

/// A number as short as it reads back to six digits.
fn float(value: f64) -> String {
    let rounded: f64 = format!("{value:.5e}").parse().unwrap_or(value);
    if rounded != 0.0 && !(1e-4..1e7).contains(&rounded.abs()) {
        return format!("{rounded:e}");
    }
    let text = rounded.to_string();
    let decimals = text.split('.').nth(1).map_or(0, str::len);
    number(rounded, decimals)
}

/// "peak_memory_bytes" as words.
fn words(key: &str) -> String {
    let mut text = key.replace('_', " ");
    if let Some(first) = text.get_mut(0..1) {
        first.make_ascii_uppercase();
    }
    text
}
