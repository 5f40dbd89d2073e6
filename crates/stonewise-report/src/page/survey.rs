//! The survey data of the cover: what was measured with what.

use super::first_page::conditions;
use super::html::{details, table};
use crate::texts::{Texts, fill};
use serde_json::Value;
use std::fmt::Write;
use stonewise_core::evaluate::MotionField;
use stonewise_figure::{count, escape};
use stonewise_results::ResultSet;
use stonewise_results::records::{EpochRecord, InputRecord};

/// A table of the epochs, folded on the screen and open on the printed cover; empty without run.json.
pub(super) fn survey(results: &ResultSet, texts: &Texts) -> String {
    let names = &texts.audit;
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
        row(names.date, &|e| e.date.as_deref().map_or_else(dash, escape)),
        row(names.conditions, &|e| conditions(e, texts).unwrap_or_else(dash)),
        row(names.clouds, &|e| files(&e.clouds, texts)),
        row(names.points, &|e| {
            count(usize::try_from(e.points).unwrap_or(usize::MAX))
        }),
        row(names.cameras, &|e| {
            let views = || names.views.to_owned();
            e.cameras.as_ref().map_or_else(views, |c| file(c, texts))
        }),
        row(names.photos, &|e| count(e.photo_count)),
        row(names.masks, &|e| {
            let detector = || names.detector.to_owned();
            e.masks.as_ref().map_or_else(detector, |m| file(m, texts))
        }),
        row(names.stones, &|e| count(e.stones)),
        row(names.motion, &|e| {
            let motion = e.motion.as_ref();
            motion.map_or(names.none.into(), |m| known_motion(m, texts))
        }),
    ];

    let mut head = vec![names.epoch];
    head.extend(chosen.iter().map(|e| e.name.as_str()));
    let columns = head.len();
    let local = || names.local.to_owned();
    let frame = run.crs.as_ref().map_or_else(local, |crs| escape(&crs.name));
    details(
        names.survey,
        &format!(
            "{}<p class=\"note\">{}</p>",
            table(&head, &rows, columns),
            fill(names.coordinates, &[("frame", &*frame)])
        ),
    )
}

/// Names and sizes of inputs.
fn files(inputs: &[InputRecord], texts: &Texts) -> String {
    inputs
        .iter()
        .map(|i| file(i, texts))
        .collect::<Vec<_>>()
        .join("<br>")
}

/// Name and size of an input.
fn file(input: &InputRecord, texts: &Texts) -> String {
    let name = input.path.file_name().unwrap_or(input.path.as_os_str());
    format!(
        "{} ({})",
        escape(&name.to_string_lossy()),
        bytes(input.bytes, texts)
    )
}

/// A size of a file in the unit that suits it.
fn bytes(value: u64, texts: &Texts) -> String {
    let value = value as f64;
    if value < 1e5 {
        format!("{:.0}\u{a0}kB", (value / 1e3).max(1.0))
    } else {
        format!("{}\u{a0}MB", texts.number(value / 1e6, 1))
    }
}

/// Kind of the motion and its numbers, metres.
fn known_motion(motion: &MotionField, texts: &Texts) -> String {
    let Ok(Value::Object(parts)) = serde_json::to_value(motion) else {
        return String::new();
    };
    let kind = parts.get("kind").and_then(Value::as_str).unwrap_or("motion");
    let mut text = escape(kind);
    for (key, value) in parts.iter().filter(|(key, _)| *key != "kind") {
        let numbers: Vec<String> = match value {
            Value::Array(items) => items.iter().map(|i| metres(i, texts)).collect(),
            value => vec![metres(value, texts)],
        };
        let _ = write!(text, "; {} {}", escape(key), numbers.join(", "));
    }
    text
}

fn metres(value: &Value, texts: &Texts) -> String {
    texts.number(value.as_f64().unwrap_or(f64::NAN), 3)
}
