//! Where the numbers come from: warnings, parameters, digests, times.

use super::first_page::said;
use super::html::{details, section, table};
use crate::texts::{AuditTexts, Texts, fill};
use serde::Serialize;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use stonewise_base::warnings::Warning;
use stonewise_figure::{count, escape, number};
use stonewise_results::ResultSet;
use stonewise_results::records::StepTime;

/// Rows of a list of decisions at most.
const MAX_DECISIONS: usize = 150;
/// Records in a list of records at most; longer ones are those of single stones.
const MAX_RECORDS: usize = 40;

/// Decisions about masks, the adjustment, and everything in run.json, warnings first.
pub(super) fn audit(results: &ResultSet, texts: &Texts) -> String {
    let names = &texts.audit;
    let mut out = match &results.run {
        Some(run) => warnings(&run.warnings, texts),
        None => format!("<p>{}</p>", names.no_run),
    };
    out.push_str(&listed(&results.edits, names.edits, names.edits_note));
    out.push_str(&listed(&results.carried, names.carried, names.carried_note));
    out.push_str(&decision_counts(&results.decisions, texts));
    if let Some(run) = &results.run {
        out.push_str(&details(names.steps, &steps(&run.steps, texts)));
        out.push_str(&details(names.epochs, &tree_of(&run.epochs, names)));
        out.push_str(&details(names.parameters, &tree_of(&run.parameters, names)));
        if let Some(part) = &run.part {
            out.push_str(&details(names.part, &tree_of(part, names)));
        }
    }
    if let Some(registration) = &results.registration {
        out.push_str(&details(names.adjustment, &tree_of(registration, names)));
    }
    out.push_str(&decision_lists(&results.decisions, names));
    section("audit", texts.sections.audit, &out)
}

/// A table of an audit, such as what a person corrected, with who, when and why; the head first.
fn listed(rows: &[Vec<String>], title: &str, note: &str) -> String {
    let Some((head, rows)) = rows.split_first() else {
        return String::new();
    };
    let cells = |row: &Vec<String>| row.iter().map(|c| escape(c)).collect();
    let rows: Vec<Vec<String>> = rows.iter().map(cells).collect();
    let head: Vec<String> = head.iter().map(|h| words(h)).collect();
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let table = table(&head, &rows, head.len());
    format!("<h3>{title}</h3>{table}<p class=\"note\">{note}</p>")
}

/// What was done, how long it took, and the highest memory up to its end.
fn steps(steps: &[StepTime], texts: &Texts) -> String {
    let names = &texts.audit;
    let or_dash = |v: Option<f64>| v.map_or("\u{2013}".into(), |v| texts.number(v, 1));
    let row = |step: &StepTime| {
        vec![
            escape(&step.step),
            texts.number(step.seconds, 1),
            or_dash(step.processor_seconds),
            or_dash(step.peak_memory_bytes.map(|b| b as f64 / 1e6)),
            if step.resumed { names.resumed } else { "" }.into(),
        ]
    };
    let rows: Vec<Vec<String>> = steps.iter().map(row).collect();
    let head = [
        names.step,
        names.seconds,
        names.processor,
        names.memory,
        names.origin,
    ];
    table(&head, &rows, 1)
}

/// How many mask instances were merged, split, dropped, by epoch.
fn decision_counts(epochs: &[Vec<Vec<String>>], texts: &Texts) -> String {
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
    let mut head = vec![texts.audit.decision_of.to_owned()];
    head.extend((1..=epochs.len()).map(|e| fill(texts.sections.epoch, &[("n", &*e.to_string())])));
    let row = |kind: &&str| {
        let mut row = vec![escape(&decision(kind, &texts.audit))];
        row.extend(counted.iter().map(|e| count(e.get(*kind).copied().unwrap_or(0))));
        row
    };
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    format!(
        "<h3>{}</h3>{}",
        texts.audit.decisions,
        table(&head, &kinds.iter().map(row).collect::<Vec<_>>(), 1)
    )
}

/// A kind of decision in words.
fn decision(kind: &str, names: &AuditTexts) -> String {
    match kind {
        "merged_instance" => names.merged.to_owned(),
        "joined_fragment" => names.joined.to_owned(),
        "split_instance" => names.split.to_owned(),
        "outvoted_instance" => names.outvoted.to_owned(),
        "dropped_islands" => names.dropped_islands.to_owned(),
        "dropped_stone" => names.dropped_stone.to_owned(),
        other => words(other),
    }
}

/// Which instances were merged, split, dropped.
fn decision_lists(epochs: &[Vec<Vec<String>>], names: &AuditTexts) -> String {
    epochs
        .iter()
        .zip(1..)
        .map(|(rows, number)| decision_list(rows, number, names))
        .collect()
}

/// The decisions of one epoch, one a row.
fn decision_list(rows: &[Vec<String>], number: usize, names: &AuditTexts) -> String {
    if rows.is_empty() {
        return String::new();
    }

    let text = |row: &Vec<String>| {
        let mut cells: Vec<String> = row.iter().map(|c| escape(c)).collect();
        cells.resize(6, String::new());
        cells[0] = escape(&decision(&row[0], names));
        cells
    };

    let shown: Vec<Vec<String>> = rows.iter().take(MAX_DECISIONS).map(text).collect();
    let rest = if rows.len() > MAX_DECISIONS {
        let values = [
            ("shown", &*MAX_DECISIONS.to_string()),
            ("n", &*count(rows.len())),
            ("e", &*number.to_string()),
        ];
        format!("<p class=\"note\">{}</p>", fill(names.decision_rest, &values))
    } else {
        String::new()
    };
    let head = [
        names.decision,
        names.photo,
        names.instance,
        names.of_stones,
        names.share,
        names.points,
    ];

    details(
        &fill(
            names.decision_list,
            &[("e", &*number.to_string()), ("n", &*count(rows.len()))],
        ),
        &format!("{}{rest}", table(&head, &shown, 2)),
    )
}

fn warnings(warnings: &[Warning], texts: &Texts) -> String {
    let names = &texts.audit;
    if warnings.is_empty() {
        return format!("<p>{}</p>", names.no_warnings);
    }
    let row = |w: &Warning| {
        vec![
            escape(&w.step),
            escape(&w.subject),
            said(&w.message, &w.translations, texts),
            match w.skipped_input {
                true => format!("<b>{}</b>", names.left_out),
                false => String::new(),
            },
        ]
    };
    let rows: Vec<Vec<String>> = warnings.iter().map(row).collect();
    let left_out = warnings.iter().filter(|w| w.skipped_input).count();
    format!(
        "<h3>{}</h3>{}",
        fill(
            names.warnings,
            &[("n", &*count(warnings.len())), ("out", &*count(left_out))]
        ),
        table(&[names.step, names.about, names.happened, names.input], &rows, 4)
    )
}

/// A record as nested lists, see [`tree`].
fn tree_of(record: &impl Serialize, names: &AuditTexts) -> String {
    serde_json::to_value(record).map_or_else(|_| String::new(), |value| tree(&value, names))
}

/// A document as nested lists; arrays of plain values on one line, arrays of plain objects as a table, of many
/// records only their number.
fn tree(value: &Value, names: &AuditTexts) -> String {
    match value {
        Value::Object(map) => {
            let items: String = map
                .iter()
                .map(|(k, v)| format!("<dt>{}</dt><dd>{}</dd>", escape(k), tree(v, names)))
                .collect();
            format!("<dl>{items}</dl>")
        }
        Value::Array(items) if !items.is_empty() && items.iter().all(is_flat_object) => rows(items),
        Value::Array(items) if items.len() > MAX_RECORDS && items.iter().any(Value::is_object) => {
            fill(names.many_records, &[("n", &*count(items.len()))])
        }
        Value::Array(items) if items.iter().any(|v| v.is_object() || v.is_array()) => {
            let items: String = items
                .iter()
                .map(|v| format!("<li>{}</li>", tree(v, names)))
                .collect();
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
