//! The page: what it says, in order.

mod audit;
mod block;
mod distributions;
mod evaluation;
mod excerpts;
mod explorer;
mod html;
mod maps;
mod method;
mod overview;
mod survey;

use super::comparison::compare;
use super::joints::joints;
use super::summary::Summary;
use super::{ReportError, ResultSet};
use crate::figure::escape;
use serde_json::Value;

#[cfg(test)]
pub(super) use explorer::{SCRIPT, STYLE};

const PAGE_STYLE: &str = include_str!("style.css");

/// Sections in the order of the page.
const SECTIONS: [(&str, &str); 8] = [
    ("summary", "Summary"),
    ("maps", "Maps"),
    ("tables", "Stones"),
    ("distributions", "Distributions"),
    ("datum", "Datum"),
    ("evaluation", "Known motion"),
    ("method", "Method"),
    ("audit", "Audit"),
];

/// File of the report on one pair of epochs.
pub(super) fn page_name(pair: usize) -> String {
    if pair == 1 {
        "index.html".into()
    } else {
        format!("epoch_{}.html", pair + 1)
    }
}

/// The whole report as one HTML document. The same results give the same bytes.
///
/// A policy in its head (Content Security Policy 3) lets only the embedded program run and nothing be fetched: markup
/// that a name from an input might smuggle in would stay dead.
///
/// # Errors
/// None in practice: compressing in memory does not fail.
pub(super) fn page(results: &ResultSet) -> Result<String, ReportError> {
    let facts = Summary::new(results);
    let (compared, joints) = (compare(results), joints(results));
    let mut body = String::new();
    body.push_str(&overview::summary(results, &facts));
    if !results.stones.is_empty() {
        body.push_str(&maps::maps(results, &facts, &joints));
        body.push_str(&overview::tables(results, &facts));
    }
    if !facts.measured.is_empty() {
        body.push_str(&distributions::distributions(
            results,
            &facts,
            &compared,
            known_translation_mm(results),
        ));
        body.push_str(&distributions::datum(results, &facts));
    }
    if let Some(evaluation) = &results.evaluation {
        body.push_str(&evaluation::evaluation(evaluation));
    }
    body.push_str(&method::method());
    body.push_str(&audit::audit(results));
    let title = title(&results.run);
    let present = SECTIONS
        .iter()
        .filter(|(id, _)| body.contains(&format!("<section id=\"{id}\">")));
    let links: String = present
        .map(|(id, name)| format!("<a href=\"#{id}\">{name}</a>"))
        .collect();
    let data = if results.stones.is_empty() {
        String::new()
    } else {
        explorer::data(results, &facts, &compared, &joints)?
    };
    let body = format!(
        "<body><svg width=\"0\" height=\"0\" class=\"patterns\"><defs>\
         <pattern id=\"hatch\" width=\"60\" height=\"60\" patternUnits=\"userSpaceOnUse\" patternTransform=\"rotate(45)\">\
         <path d=\"M0 0V60\" class=\"hatching\"/></pattern><pattern id=\"hatch-fine\" width=\"6\" height=\"6\" patternUnits=\"userSpaceOnUse\" patternTransform=\"rotate(45)\">\
         <path d=\"M0 0V6\" class=\"hatching fine\"/></pattern></defs></svg>\n\
         <header><p class=\"kind\">Deformation report, stone by stone</p><h1>{title}</h1>{}</header>\n<nav>{links}</nav>\n\
         <main>\n{body}</main>\n{data}",
        cover(results)
    );
    // Of all that the page holds, so that no input can guess it.
    let nonce = &blake3::hash(body.as_bytes()).to_hex()[..32];
    Ok(format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src 'nonce-{nonce}'; \
         style-src 'unsafe-inline'; img-src blob: data:; base-uri 'none'; form-action 'none'\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <meta name=\"color-scheme\" content=\"light dark\"><title>{title}: stone by stone</title>\n\
         <style>\n{PAGE_STYLE}{}</style></head>\n{body}<script nonce=\"{nonce}\">\n{}</script>\n</body></html>\n",
        explorer::STYLE,
        explorer::SCRIPT
    ))
}

fn title(run: &Value) -> String {
    let project = run.get("project");
    let name = project.and_then(|p| p.as_str().or_else(|| p.get("name").and_then(Value::as_str)));
    escape(name.filter(|n| !n.is_empty()).unwrap_or("Survey"))
}

/// Names of the first and of the compared epoch, as far as run.json has them.
fn epoch_names(run: &Value, pair: usize) -> Option<[String; 2]> {
    let name = |i: usize| {
        let epoch = run.get("epochs")?.get(i)?;
        epoch
            .as_str()
            .or_else(|| epoch.get("name")?.as_str())
            .map(str::to_owned)
    };
    Some([name(0)?, name(pair)?])
}

/// The same as one line of HTML.
fn epochs(run: &Value, pair: usize) -> Option<String> {
    epoch_names(run, pair).map(|[first, second]| format!("{} \u{2192} {}", escape(&first), escape(&second)))
}

/// Epochs, version and time of the run, and the way to the reports on other epochs.
fn cover(results: &ResultSet) -> String {
    let run = &results.run;
    let mut facts: Vec<String> = epochs(run, results.pair)
        .map(|e| format!("Epochs <b>{e}</b>"))
        .into_iter()
        .collect();
    for (key, word) in [("finished_at", "finished"), ("version", "stonewise")] {
        if let Some(text) = run.get(key).and_then(Value::as_str) {
            facts.push(format!("{word} <b>{}</b>", escape(text)));
        }
    }
    let others = (1..=results.pairs).filter(|p| *p != results.pair);
    facts.extend(others.map(|pair| {
        let name = epochs(run, pair).unwrap_or_else(|| format!("epoch {}", pair + 1));
        format!("<a href=\"{}\">{name}</a>", page_name(pair))
    }));
    let line = if facts.is_empty() {
        String::new()
    } else {
        format!("<p class=\"cover\">{}</p>", facts.join(" \u{b7} "))
    };
    format!("{line}{}", survey::survey(results))
}

/// In-plane part of a known translation of the compared epoch, millimetres, where run.json names one.
fn known_translation_mm(results: &ResultSet) -> Option<[f64; 2]> {
    let motion = results.run.get("epochs")?.get(results.pair)?.get("motion")?;
    if motion.get("kind")?.as_str()? != "translation" {
        return None;
    }
    let d: Vec<f64> = motion
        .get("d")?
        .as_array()?
        .iter()
        .filter_map(Value::as_f64)
        .collect();
    let d = (d.len() == 3).then(|| nalgebra::Vector3::from_column_slice(&d))?;
    let stone = results.stones.get(results.stones.len() / 2)?;
    let frame = results.facade.frame_at(&stone.centroid);
    Some([d.dot(&frame.along) * 1e3, d.dot(&frame.up) * 1e3])
}
