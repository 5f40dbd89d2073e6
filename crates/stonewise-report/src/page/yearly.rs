//! The part of the yearly safety report on measurements, in the order that authorities ask for.

use super::document::{PATTERNS, footer, head, title};
use super::first_page::{conditions, letter, letterhead, place_to_sign};
use super::html::{table, with_units};
use super::{doubts, instruments, series};
use crate::summary::Summary;
use crate::texts::{Texts, YearlyTexts, fill};
use std::fmt::Write;
use stonewise_base::profile::YearlyChapter;
use stonewise_figure::{count, escape};
use stonewise_results::ResultSet;
use stonewise_results::records::{DatumState, EpochRecord, EpochVerdict, RunRecord, Verdict};

/// The report of a series as one HTML document without anything that runs; `newest`: the results of the newest epoch.
/// `None` without a series.
pub(crate) fn yearly(newest: &ResultSet, facts: &Summary) -> Option<String> {
    let (run, verdict) = (newest.run.as_ref()?, newest.verdict.as_ref()?);
    let answers = verdict.series.as_ref()?;
    let texts = facts.texts;
    let names = &texts.yearly;
    let version = [("version", &*run.version)];
    let chapter = |chapter: &YearlyChapter| match chapter {
        YearlyChapter::Survey => {
            let method = fill(names.method, &version);
            let what = format!("{}{}<p>{method}</p>", letter(facts), surveys(run, texts));
            (names.headings.survey, what)
        }
        YearlyChapter::Conditions => {
            let conditions = format!("{}{}", of_epochs(run, texts), series::terms(newest, texts));
            (names.headings.conditions, conditions)
        }
        YearlyChapter::Results => (names.headings.results, results(newest, verdict, facts)),
        YearlyChapter::Prediction => {
            let sentence = with_units(&escape(&answers.sentence));
            let answers = format!("<p>{sentence}</p>{}", series::answers(answers, texts));
            (names.headings.prediction, answers)
        }
        YearlyChapter::Interpretation => {
            let said = interpretation(newest, run, verdict, texts);
            (names.headings.interpretation, said)
        }
        YearlyChapter::Conclusion => (names.headings.conclusion, conclusion(names)),
        YearlyChapter::Signature => (names.headings.signature, place_to_sign(texts)),
    };
    let chapters = facts.profile.yearly.iter().map(chapter);
    let body: String = chapters
        .map(|(heading, part)| format!("<section><h2>{heading}</h2>\n{part}</section>\n"))
        .collect();
    let first = run.epochs.first().map_or("", |e| &e.name);
    let last = run.epochs.last().map_or("", |e| &e.name);
    Some(format!(
        "{}<body>{PATTERNS}<header>{}<h1>{}</h1><p class=\"cover\">{} \u{2192} {}</p></header>\n<main>\n{body}\
         <p class=\"note\">{}</p></main></body></html>\n",
        head(&title(newest, texts), texts, "", &footer(newest, "")),
        letterhead(newest, names.kind),
        title(newest, texts),
        escape(first),
        escape(last),
        names.files
    ))
}

/// What was measured in each epoch.
fn surveys(run: &RunRecord, texts: &Texts) -> String {
    let names = &texts.yearly;
    let dash = || "\u{2013}".to_owned();
    let row = |(i, epoch): (usize, &EpochRecord)| {
        let datum = match run.datum.get(&epoch.name) {
            _ if i == 0 => texts.page.reference.to_owned(),
            Some(state) => names.datums[match state {
                DatumState::Stable => 0,
                DatumState::Stated => 1,
                DatumState::Sources => 2,
                DatumState::Instruments => 3,
                DatumState::Unknown => 4,
            }]
            .to_owned(),
            None => dash(),
        };
        vec![
            escape(&epoch.name),
            epoch.date.as_deref().map_or_else(dash, escape),
            count(epoch.clouds.len()),
            count(epoch.photo_count),
            count(usize::try_from(epoch.points).unwrap_or(usize::MAX)),
            count(epoch.stones),
            datum,
        ]
    };
    let rows: Vec<Vec<String>> = run.epochs.iter().enumerate().map(row).collect();
    table(&names.survey, &rows, 2)
}

/// The conditions of each epoch.
fn of_epochs(run: &RunRecord, texts: &Texts) -> String {
    let rows: Vec<Vec<String>> = { run.epochs.iter() }
        .filter_map(|e| Some(vec![escape(&e.name), conditions(e, texts)?]))
        .collect();
    match rows.is_empty() {
        true => String::new(),
        false => table(&[texts.yearly.survey[0], texts.yearly.condition], &rows, 2),
    }
}

fn results(newest: &ResultSet, verdict: &Verdict, facts: &Summary) -> String {
    let texts = facts.texts;
    let names = &texts.yearly;
    let rows: Vec<Vec<String>> = verdict.epochs.iter().map(|e| epoch_row(e, texts)).collect();
    let paths = series::paths(newest, texts);
    let sentence = verdict.epochs.last().map_or("", |e| &e.sentence);
    format!(
        "{}<p class=\"note\">{}</p><p>{}</p>{}{}{}",
        table(&names.results, &rows, 2),
        names.results_note,
        with_units(&escape(sentence)),
        if paths.is_empty() {
            format!("<p>{}</p>", names.no_zones)
        } else {
            paths
        },
        series::map(newest, facts),
        beside(newest, texts)
    )
}

/// Other instruments in the newest epoch.
fn beside(newest: &ResultSet, texts: &Texts) -> String {
    let found = instruments::compared(newest, texts);
    match found.is_empty() {
        true => found,
        false => format!("<h3>{}</h3>{found}", texts.instruments.heading),
    }
}

fn epoch_row(epoch: &EpochVerdict, texts: &Texts) -> Vec<String> {
    let names = &texts.yearly;
    let dash = || "\u{2013}".to_owned();
    let mm = |v: f64| texts.mm(v / 1e3);

    let interval = |value: f64, [low, high]: [f64; 2]| {
        let [value, low, high] = [value, low, high].map(mm);
        fill(
            names.interval,
            &[("value", &*value), ("low", &*low), ("high", &*high)],
        )
    };

    let wall = &epoch.wall;
    // Of results in doubt the numbers prove nothing.
    let sound = |text: String| if epoch.is_sound() { text } else { dash() };
    let measured = [("n", &*count(wall.measured)), ("m", &*count(wall.stones))];
    let deformed = epoch.deformation.as_ref().filter(|d| d.shown);
    let deformed = deformed.and_then(|d| Some(interval(d.largest_mm?, d.interval_mm?)));

    vec![
        escape(&epoch.epoch),
        texts.state(epoch.state).to_owned(),
        fill(names.of, &measured),
        sound(count(wall.moved)),
        sound(count(wall.loose)),
        sound(count(wall.lost)),
        sound(
            wall.largest
                .map_or_else(dash, |l| interval(l.length_mm, l.interval_mm)),
        ),
        sound(deformed.unwrap_or_else(dash)),
        sound(
            wall.detection_limit
                .as_ref()
                .map_or_else(dash, |l| mm(l.median_mm)),
        ),
    ]
}

/// What the engineer writes about, and what the measurements say for it.
fn interpretation(newest: &ResultSet, run: &RunRecord, verdict: &Verdict, texts: &Texts) -> String {
    let names = &texts.yearly;
    let mut facts: Vec<String> = Vec::new();
    facts.extend(verdict.epochs.last().map(|e| escape(&e.sentence)));
    facts.extend(verdict.series.as_ref().map(|s| escape(&s.sentence)));
    let apart = newest.trends.iter().flat_map(|t| &t.not_separable);
    facts.extend(apart.map(|i| format!("{} {}.", names.not_separable, escape(&i.text))));
    let mut out = format!(
        "<p><b>{}</b></p><ul><li>{}</li></ul>",
        names.prepared,
        with_units(&facts.join("</li><li>"))
    );
    out.push_str(&doubts::doubts(&run.warnings, texts));
    let _ = write!(
        out,
        "<p class=\"note\">{}</p><div class=\"write\"></div>",
        names.to_write
    );
    out
}

fn conclusion(names: &YearlyTexts) -> String {
    let boxes = names.conclusions.map(|text| format!("<li>\u{2610} {text}</li>"));
    format!(
        "<ul class=\"boxes\">{}</ul><div class=\"write\"></div><p class=\"note\">{}</p>",
        boxes.concat(),
        names.to_write
    )
}
