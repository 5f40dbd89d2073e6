//! The page: what it says, in order.

mod accuracy;
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
use stonewise_base::profile::Chapter;
use stonewise_base::report_params::Language;
use stonewise_figure::escape;
use stonewise_results::names::{PairFile, YEARLY};
use stonewise_results::records::RunRecord;
use stonewise_results::{Comparison, Joint, ResultSet, compare, joints};

#[cfg(test)]
pub(super) use explorer::{SCRIPT, STYLE};

/// What the bar calls a chapter.
fn title_of(chapter: Chapter, texts: &Texts) -> &'static str {
    let names = &texts.sections;
    match chapter {
        Chapter::Summary => texts.page.summary,
        Chapter::Series => texts.series.heading,
        Chapter::Maps => names.maps,
        Chapter::Tables => names.tables,
        Chapter::Distributions => names.distributions,
        Chapter::Datum => names.datum,
        Chapter::Accuracy => texts.accuracy.heading,
        Chapter::Instruments => texts.instruments.heading,
        Chapter::Checks => texts.checks.heading,
        Chapter::Evaluation => names.evaluation,
        Chapter::Method => names.method,
        Chapter::Audit => names.audit,
    }
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
    let chapters = facts.profile.chapters.iter().chain(&facts.profile.appendix);
    let links: String = chapters
        .map(|chapter| (chapter.name(), title_of(*chapter, facts.texts)))
        .filter(|(id, _)| content.contains(&format!("<section id=\"{id}\">")))
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

/// The chapters in the order of the profile; the appendix can be left out.
fn content(
    results: &ResultSet,
    facts: &Summary,
    compared: &Comparison,
    joints: &[Joint],
    appendix: bool,
) -> String {
    let texts = facts.texts;
    let known_mm = || known_translation_mm(results);
    let has_stones = !results.stones.is_empty();
    let is_measured = !facts.measured.is_empty();
    let chapter = |chapter: &Chapter| match chapter {
        Chapter::Summary => overview::summary(results, facts),
        Chapter::Series => series::series(results, facts),
        Chapter::Maps if has_stones => maps::maps(results, facts, joints),
        Chapter::Tables if has_stones => overview::tables(results, facts),
        Chapter::Distributions if is_measured => {
            distributions::distributions(results, facts, compared, known_mm())
        }
        Chapter::Datum if is_measured => distributions::datum(results, facts),
        Chapter::Accuracy if is_measured => accuracy::accuracy(results, facts),
        Chapter::Instruments => instruments::instruments(results, texts),
        Chapter::Checks => checks::checks(results, texts),
        Chapter::Evaluation => {
            let evaluation = results.evaluation.as_ref();
            evaluation.map_or(String::new(), |e| evaluation::evaluation(e, texts))
        }
        Chapter::Method => method::method(texts),
        Chapter::Audit => audit::audit(results, texts),
        Chapter::Maps | Chapter::Tables | Chapter::Distributions | Chapter::Datum | Chapter::Accuracy => {
            String::new()
        }
    };
    let last: &[Chapter] = if appendix { &facts.profile.appendix } else { &[] };
    facts.profile.chapters.iter().chain(last).map(chapter).collect()
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
