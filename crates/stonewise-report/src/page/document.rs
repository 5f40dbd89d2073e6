//! What documents have in common: head, foot, title, patterns.

use super::pair::epoch_names;
use crate::texts::Texts;
use stonewise_figure::escape;
use stonewise_results::ResultSet;

const PAGE_STYLE: &str = include_str!("style.css");

/// Patterns that the pictures use.
pub(super) const PATTERNS: &str = "<svg width=\"0\" height=\"0\" class=\"patterns\"><defs>\
    <pattern id=\"hatch\" width=\"60\" height=\"60\" patternUnits=\"userSpaceOnUse\" patternTransform=\"rotate(45)\">\
    <path d=\"M0 0V60\" class=\"hatching\"/></pattern><pattern id=\"hatch-fine\" width=\"6\" height=\"6\" patternUnits=\"userSpaceOnUse\" patternTransform=\"rotate(45)\">\
    <path d=\"M0 0V6\" class=\"hatching fine\"/></pattern></defs></svg>\n";

/// The head of a document; `scripts`: what its policy lets run.
pub(super) fn head(title: &str, texts: &Texts, scripts: &str, style: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"{}\"><head><meta charset=\"utf-8\">\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; {scripts}\
         style-src 'unsafe-inline'; img-src blob: data:; base-uri 'none'; form-action 'none'\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <meta name=\"color-scheme\" content=\"light dark\"><title>{title}: {}</title>\n\
         <style>\n{PAGE_STYLE}{style}</style></head>\n",
        texts.language.tag(),
        texts.sections.title_end
    )
}

/// The rule that prints project, epochs and date at the foot of every page of this name; of all pages without
/// one.
pub(super) fn footer(results: &ResultSet, page: &str) -> String {
    let Some(run) = &results.run else {
        return String::new();
    };
    let epochs = epoch_names(run, results.pair).map_or(String::new(), |[a, b]| format!(", {a} \u{2192} {b}"));
    let text = format!("{}{epochs}, {}", run.project.name, run.finished_at.minute());
    // Every other character as its number (CSS Syntax 3, 4.3.7), so that no name can end the string.
    let quoted: String = text
        .chars()
        .map(|c| {
            if c.is_ascii_alphanumeric() {
                c.to_string()
            } else {
                format!("\\{:x} ", u32::from(c))
            }
        })
        .collect();
    format!("@media print{{@page {page}{{@bottom-left{{content:\"{quoted}\"}}}}}}\n")
}

/// Name of the structure.
pub(super) fn title(results: &ResultSet, texts: &Texts) -> String {
    let name = results.run.as_ref().map(|run| run.project.name.as_str());
    escape(name.filter(|n| !n.is_empty()).unwrap_or(texts.sections.survey))
}
