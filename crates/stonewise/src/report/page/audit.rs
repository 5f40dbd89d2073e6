//! Where the numbers come from: warnings, parameters, digests, times.

use super::html::{details, section, table};
use crate::figure::{count, escape, number};
use crate::report::ResultSet;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// Rows of a list of decisions at most.
const MAX_DECISIONS: usize = 150;

/// Decisions about masks, the adjustment, and everything in run.json, warnings first.
pub(super) fn audit(results: &ResultSet) -> String {
    let mut more = String::new();
    if results.registration.is_object() {
        more.push_str(&details(
            "Adjustment of the motions (registration.json)",
            &tree(&results.registration),
        ));
    }
    let run = &results.run;
    let Value::Object(entries) = run else {
        let counts = decision_counts(&results.decisions);
        more.push_str(&decision_lists(&results.decisions));
        let body = format!("<p>There is no run.json beside the results.</p>{counts}{more}");
        return section("audit", "Audit", &body);
    };
    let mut out = warnings(
        run.get("warnings")
            .and_then(Value::as_array)
            .map_or(&[], Vec::as_slice),
    );
    out.push_str(&decision_counts(&results.decisions));
    for (key, value) in entries.iter().filter(|(k, _)| *k != "warnings") {
        match value {
            Value::Null => {}
            Value::Array(items) if key == "steps" => {
                out.push_str(&details("Steps, times and memory", &steps(items)))
            }
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
    out.push_str(&more);
    out.push_str(&decision_lists(&results.decisions));
    section("audit", "Audit", &out)
}

/// What was done, how long it took, and the highest memory up to its end.
fn steps(items: &[Value]) -> String {
    let number = |item: &Value, key: &str, unit: f64| {
        item.get(key)
            .and_then(Value::as_f64)
            .map_or("\u{2013}".into(), |v| self::number(v / unit, 1))
    };
    let row = |item: &Value| {
        let resumed = item.get("resumed").and_then(Value::as_bool) == Some(true);
        vec![
            escape(item.get("step").and_then(Value::as_str).unwrap_or("")),
            number(item, "seconds", 1.0),
            number(item, "peak_memory_bytes", 1e6),
            if resumed { "taken from an earlier run" } else { "" }.into(),
        ]
    };
    let rows: Vec<Vec<String>> = items.iter().map(row).collect();
    table(&["step", "seconds", "highest memory MB", ""], &rows, 1)
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
