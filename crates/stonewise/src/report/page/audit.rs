//! Where the numbers come from: warnings, parameters, digests, times.

use super::html::{details, section, table};
use crate::report::draw::{count, escape, number};
use serde_json::Value;
use std::fmt::Write;

/// Everything in run.json, warnings first.
pub(super) fn audit(run: &Value) -> String {
    let Value::Object(entries) = run else {
        return section(
            "audit",
            "Audit",
            "<p>There is no run.json beside the results.</p>",
        );
    };
    let mut out = warnings(
        run.get("warnings")
            .and_then(Value::as_array)
            .map_or(&[], Vec::as_slice),
    );
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

/// A document as nested lists; arrays of plain values on one line.
fn tree(value: &Value) -> String {
    match value {
        Value::Object(map) => {
            let items: String = map
                .iter()
                .map(|(k, v)| format!("<dt>{}</dt><dd>{}</dd>", escape(k), tree(v)))
                .collect();
            format!("<dl>{items}</dl>")
        }
        Value::Array(items) if items.iter().any(|v| v.is_object() || v.is_array()) => {
            let items: String = items.iter().map(|v| format!("<li>{}</li>", tree(v))).collect();
            format!("<ol>{items}</ol>")
        }
        Value::Array(items) => items.iter().map(scalar).collect::<Vec<_>>().join(", "),
        _ => scalar(value),
    }
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
