//! The page: what it says, in order.

mod audit;
mod block;
mod checks;
mod distributions;
mod document;
mod doubts;
mod evaluation;
mod excerpts;
mod explorer;
mod first_page;
mod html;
mod influence;
mod instruments;
mod look_first;
mod maps;
mod method;
mod overview;
mod pair;
mod series;
mod survey;
mod tracked;
mod worst_stone;
mod yearly;

pub(super) use yearly::yearly;

use super::summary::Summary;
use crate::texts::{Texts, fill};
use document::{PATTERNS, footer, head, title};
use pair::{epoch_names, known_translation_mm};
use std::fmt::Write;
use stonewise_base::error::Error;
use stonewise_base::report_params::Language;
use stonewise_figure::escape;
use stonewise_results::names::{PairFile, YEARLY};
use stonewise_results::records::RunRecord;
use stonewise_results::{Comparison, Joint, ResultSet, compare, joints};

#[cfg(test)]
pub(super) use explorer::{SCRIPT, STYLE};

/// Sections in the order of the page.
fn sections(texts: &Texts) -> [(&'static str, &'static str); 11] {
    let names = &texts.sections;
    [
        ("summary", texts.page.summary),
        ("series", texts.series.heading),
        ("maps", names.maps),
        ("tables", names.tables),
        ("distributions", names.distributions),
        ("datum", names.datum),
        ("instruments", texts.instruments.heading),
        ("checks", texts.checks.heading),
        ("evaluation", names.evaluation),
        ("method", names.method),
        ("audit", names.audit),
    ]
}

/// The whole report as one HTML document. The same results give the same bytes.
///
/// A policy in its head (Content Security Policy 3) lets only the embedded program run and nothing be
/// fetched: markup that a name from an input might smuggle in would stay dead.
///
/// # Errors
/// None in practice: compressing in memory does not fail.
pub(super) fn page(results: &ResultSet, facts: &Summary) -> Result<String, Error> {
    let (compared, joints) = (compare(results), joints(results));
    let content = content(results, facts, &compared, &joints, true);
    let present = sections(facts.texts)
        .into_iter()
        .filter(|(id, _)| content.contains(&format!("<section id=\"{id}\">")));
    let links: String = present
        .map(|(id, name)| format!("<a href=\"#{id}\">{name}</a>"))
        .collect();
    let data = if results.stones.is_empty() {
        String::new()
    } else {
        explorer::data(results, facts, &compared, &joints)?
    };

    let body = format!(
        "<body>{PATTERNS}{}<nav>{links}</nav>\n<main>\n{content}</main>\n{data}",
        header(results, facts)
    );

    // Of all that the page holds, so that no input can guess it.
    let nonce = &blake3::hash(body.as_bytes()).to_hex()[..32];
    let head = head(
        &title(results, facts.texts),
        facts.texts,
        &format!("script-src 'nonce-{nonce}'; "),
        &format!("{}{}", footer(results, ""), explorer::STYLE),
    );

    Ok(format!(
        "{head}{body}<script nonce=\"{nonce}\">\n{}</script>\n</body></html>\n",
        explorer::SCRIPT
    ))
}

/// The reports on all later epochs as one document for paper, without anything that runs.
pub(super) fn printed(all: &[&ResultSet], appendix: bool) -> String {
    let (mut style, mut body) = (String::new(), String::new());
    let mut texts = Texts::of(Language::default());
    for (results, number) in all.iter().zip(1..) {
        let facts = Summary::new(results);
        let (compared, joints) = (compare(results), joints(results));
        texts = facts.texts;
        let content = content(results, &facts, &compared, &joints, appendix);
        // What is folded on the screen is open on paper.
        let content = content.replace("<details>", "<details open>");
        let name = format!("epoch{number}");
        style.push_str(&footer(results, &name));
        let _ = write!(
            body,
            "<div style=\"page:{name}\">{}<main>\n{content}</main></div>\n",
            header(results, &facts)
        );
    }
    let title = all.first().map_or(String::new(), |results| title(results, texts));
    let head = head(&title, texts, "", &style);
    format!("{head}<body>{PATTERNS}{body}</body></html>\n")
}

/// The sections in order; the last one can be left out.
fn content(
    results: &ResultSet,
    facts: &Summary,
    compared: &Comparison,
    joints: &[Joint],
    appendix: bool,
) -> String {
    let mut body = String::new();
    body.push_str(&overview::summary(results, facts));
    body.push_str(&series::series(results, facts));

    if !results.stones.is_empty() {
        body.push_str(&maps::maps(results, facts, joints));
        body.push_str(&overview::tables(results, facts));
    }

    if !facts.measured.is_empty() {
        body.push_str(&distributions::distributions(
            results,
            facts,
            compared,
            known_translation_mm(results),
        ));
        body.push_str(&distributions::datum(results, facts));
    }

    body.push_str(&instruments::instruments(results, facts.texts));
    body.push_str(&checks::checks(results, facts.texts));
    if let Some(evaluation) = &results.evaluation {
        body.push_str(&evaluation::evaluation(evaluation, facts.texts));
    }
    body.push_str(&method::method(facts.texts));
    if appendix {
        body.push_str(&audit::audit(results, facts.texts));
    }
    body
}

/// All that stands above the sections.
fn header(results: &ResultSet, facts: &Summary) -> String {
    let texts = facts.texts;
    let warnings = results
        .run
        .as_ref()
        .map_or(&[][..], |run| run.warnings.as_slice());
    format!(
        "<header>{}<h1>{}</h1>{}{}{}{}{}{}</header>\n",
        first_page::letterhead(results, texts.page.kind),
        title(results, texts),
        first_page::verdict(facts),
        first_page::next(results, facts),
        doubts::doubts(warnings, texts),
        first_page::datum_warning(results.datum(), facts),
        first_page::cover(results, facts),
        cover(results, texts)
    )
}

/// Names of the first and of the compared epoch as one line of HTML.
fn epochs(run: &RunRecord, pair: usize) -> Option<String> {
    epoch_names(run, pair).map(|[first, second]| format!("{} \u{2192} {}", escape(&first), escape(&second)))
}

/// Epochs, version and time of the run, and the way to the reports on other epochs.
fn cover(results: &ResultSet, texts: &Texts) -> String {
    let run = results.run.as_ref();
    let line = |pair: usize| run.and_then(|run| epochs(run, pair));
    let mut facts: Vec<String> = Vec::new();
    if let Some(run) = run {
        facts.push(format!(
            "{} <b>{}</b>",
            texts.page.finished,
            run.finished_at.minute()
        ));
        facts.push(format!("stonewise <b>{}</b>", escape(&run.version)));
    }
    // The way to a place in the folder of the results, from where this page lies.
    let up = "../".repeat(PairFile::ReportPage.place(results.pair).matches('/').count());
    let link = |place: &str| format!("{up}{place}");
    let others = (1..=results.pairs).filter(|p| *p != results.pair);
    facts.extend(others.map(|pair| {
        let name =
            line(pair).unwrap_or_else(|| fill(texts.sections.epoch, &[("n", &(pair + 1).to_string())]));
        format!(
            "<a href=\"{}\">{name}</a>",
            link(&PairFile::ReportPage.place(pair))
        )
    }));
    if results.verdict.as_ref().is_some_and(|v| v.series.is_some()) {
        facts.push(format!("<a href=\"{}\">{}</a>", link(YEARLY), texts.yearly.kind));
    }
    let line = if facts.is_empty() {
        String::new()
    } else {
        format!("<p class=\"cover\">{}</p>", facts.join(" \u{b7} "))
    };
    format!("{line}{}", survey::survey(results, texts))
}
