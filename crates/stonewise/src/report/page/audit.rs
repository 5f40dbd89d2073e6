//! Where the numbers come from: warnings, parameters, digests, times.

use super::html::{details, section, table};
use crate::report::ResultSet;
use crate::report::draw::{count, escape, number};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// Decisions about masks, the adjustment, and everything in run.json, warnings first.
pub(super) fn audit(results: &ResultSet) -> String {
    let mut more = decisions(&results.decisions);
    if results.registration.is_object() {
        more.push_str(&details(
            "Adjustment of the motions (registration.json)",
            &tree(&results.registration),
        ));
    }
    let run = &results.run;
    let Value::Object(entries) = run else {
        let body = format!("<p>There is no run.json beside the results.</p>{more}");
        return section("audit", "Audit", &body);
    };
    let mut out = warnings(
        run.get("warnings")
            .and_then(Value::as_array)
            .map_or(&[], Vec::as_slice),
    );
    out.push_str(&more);
    for (key, value) in entries.iter().filter(|(k, _)| *k != "warnings") {
        match value {
            Value::Object(_) | Value::Array(_) => out.push_str(&details(&words(key), &tree(value))),
            _ => {
                let _ = write!(
                    out,
                    "<p class=\"fact\"><span>{}</span> {}</p>",
                    escape(&words(key)),
                    scalar(value)
                );
            }
        }
    }
    section("audit", "Audit", &out)
}

/// How many mask instances were merged, split, dropped, by epoch.
fn decisions(epochs: &[BTreeMap<String, usize>]) -> String {
    let kinds: BTreeSet<&String> = epochs.iter().flat_map(BTreeMap::keys).collect();
    if kinds.is_empty() {
        return String::new();
    }
    let mut head = vec!["decision of the majority of the photos".to_owned()];
    head.extend((1..=epochs.len()).map(|e| format!("epoch {e}")));
    let row = |kind: &&String| {
        let mut row = vec![escape(&words(kind))];
        row.extend(epochs.iter().map(|e| count(e.get(*kind).copied().unwrap_or(0))));
        row
    };
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    format!(
        "<h3>Decisions about mask instances</h3>{}<p class=\"note\">One row each in audit_epoch1.csv, audit_epoch2.csv.</p>",
        table(&head, &kinds.iter().map(row).collect::<Vec<_>>(), 1)
    )
}

fn warnings(warnings: &[Value]) -> String {
    if warnings.is_empty() {
        return "<p>No warnings.</p>".into();
    }
    let text = |w: &Value, key: &str| escape(w.get(key).and_then(Value::as_str).unwrap_or(""));
    let skipped = |w: &Value| w.get("skipped_input").and_then(Value::as_bool) == Some(true);
    let row = |w: &Value| {
        let message = if w.is_string() {
            scalar(w)
        } else {
            text(w, "message")
        };
        vec![
            text(w, "step"),
            text(w, "subject"),
            message,
            if skipped(w) { "<b>left out</b>" } else { "" }.into(),
        ]
    };
    let rows: Vec<Vec<String>> = warnings.iter().map(row).collect();
    let left_out = warnings.iter().filter(|w| skipped(w)).count();
    format!(
        "<h3>Warnings ({}; inputs left out: {})</h3>{}",
        count(warnings.len()),
        count(left_out),
        table(&["step", "about", "what happened", "input"], &rows, 4)
    )
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
