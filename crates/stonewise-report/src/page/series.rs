//! What the path over all epochs means.

use super::html::{figure, section, table, with_units};
use crate::draw::{MapLayout, MapPicture, PathChart, path_chart, stone_map};
use crate::summary::Summary;
use crate::texts::{SeriesTexts, Texts, counted, fill};
use crate::verdict::term_name;
use std::fmt::Write;
use stonewise_base::thresholds::Quantity;
use stonewise_core::series::Word;
use stonewise_figure::{Scale, escape};
use stonewise_results::records::{AnswerVerdict, EstimateRecord, SeriesVerdict, ZoneTrend};
use stonewise_results::{ResultSet, StoneRow, nice_scale_m};

/// The four answers, the model and the map of velocity; empty where there are only two epochs.
pub(super) fn series(results: &ResultSet, facts: &Summary) -> String {
    let texts = facts.texts;
    let Some(found) = results.verdict.as_ref().and_then(|v| v.series.as_ref()) else {
        return String::new();
    };
    let body = format!(
        "<p>{}</p>{}{}{}{}",
        with_units(&escape(&found.sentence)),
        answers(found, texts),
        terms(results, texts),
        paths(results, texts),
        map(results, facts)
    );
    section("series", texts.series.heading, &body)
}

/// The four answers.
pub(super) fn answers(answers: &SeriesVerdict, texts: &Texts) -> String {
    let names = &texts.series;
    let all = [
        &answers.as_predicted,
        &answers.as_in_the_past,
        &answers.trend,
        &answers.anomaly,
    ];
    let row = |(question, answer): (&&str, &AnswerVerdict)| {
        vec![
            (*question).to_owned(),
            format!("<b>{}</b>", word(answer.answer.answer, names)),
            with_units(&escape(&answer.text)),
        ]
    };
    let rows: Vec<Vec<String>> = names.questions.iter().zip(all).map(row).collect();
    table(&[names.question, names.answer, ""], &rows, 3)
}

fn word(answer: Word, names: &SeriesTexts) -> &'static str {
    names.words[match answer {
        Word::Yes => 0,
        Word::No => 1,
        Word::CannotTell => 2,
    }]
}

/// The terms of the model, and what the epochs cannot carry.
pub(super) fn terms(results: &ResultSet, texts: &Texts) -> String {
    let names = &texts.series;
    let Some(trends) = &results.trends else {
        return String::new();
    };
    let mut out = String::new();
    if !trends.terms.is_empty() {
        let terms: Vec<&str> = trends.terms.iter().map(|t| term_name(*t, texts)).collect();
        let _ = write!(
            out,
            "<p>{}</p>",
            fill(names.model, &[("terms", &*terms.join(", "))])
        );
    }
    let mut rest: Vec<String> = trends.not_separable.iter().map(|i| escape(&i.text)).collect();
    if !trends.undated.is_empty() {
        rest.push(escape(&fill(
            names.undated,
            &[("epochs", &*trends.undated.join(", "))],
        )));
    }
    if !rest.is_empty() {
        let _ = write!(out, "<ul><li>{}</li></ul>", rest.join("</li><li>"));
    }
    out
}

/// The path of every zone with its model, and the conditions beneath.
pub(super) fn paths(results: &ResultSet, texts: &Texts) -> String {
    let names = &texts.series;
    let Some(trends) = &results.trends else {
        return String::new();
    };
    let thresholds = results.run.as_ref().map(|run| &run.parameters.thresholds);
    let limits = thresholds
        .into_iter()
        .flat_map(|t| t.of(Quantity::Deformation, None));
    let limits_mm: Vec<f64> = limits.map(|t| t.limit).collect();

    let one = |zone: &ZoneTrend| {
        let title = fill(
            names.path,
            &[("id", &*zone.zone_id.to_string()), ("epoch", &*zone.epoch)],
        );
        let picture = path_chart(&PathChart {
            title: &title,
            zone,
            labels: names.components,
            conditions: &trends.conditions,
            limits_mm: &limits_mm,
            texts,
        });
        figure(
            &title,
            &picture,
            &with_units(&escape(&path_in_words(zone, texts))),
        )
    };

    let pictures: String = trends.zones.iter().map(one).collect();
    match pictures.is_empty() {
        true => pictures,
        false => format!(
            "<div class=\"paths\">{pictures}</div><p class=\"note\">{}</p>",
            names.path_note
        ),
    }
}

/// A sentence with its values filled in.
type Say<'a> = dyn Fn(&[(&str, &str)]) -> String + 'a;

/// What a zone does, in sentences.
fn path_in_words(zone: &ZoneTrend, texts: &Texts) -> String {
    let names = &texts.series;
    // A coefficient for ten units, so that the number has digits.
    let said = |found: &EstimateRecord, factor: f64, say: &Say| {
        let [along, up, out] = found.value.map(|v| texts.mm(v * factor));
        let largest = found.sd.iter().copied().fold(0.0, f64::max);
        let half = texts.mm(1.96 * largest * factor);
        say(&[("along", &along), ("up", &up), ("out", &out), ("half", &half)])
    };

    let velocity = EstimateRecord {
        value: zone.velocity,
        sd: zone.sd,
    };
    let mut all = vec![said(&velocity, 1.0, &|v| counted(names.zone, zone.stones, v))];
    all.extend(
        zone.level
            .iter()
            .map(|c| said(c, 10.0, &|v| fill(names.by_level, v))),
    );
    let temperature = zone.temperature.iter();
    all.extend(temperature.map(|c| said(c, 10.0, &|v| fill(names.by_temperature, v))));
    let season = zone.season.iter().map(|s| &s.amplitude);
    all.extend(season.map(|c| said(c, 1.0, &|v| fill(names.by_season, v))));

    all.extend(
        zone.departure
            .iter()
            .map(|c| said(c, 1.0, &|v| fill(names.departs, v))),
    );
    all.push(match zone.confirmed_by.is_empty() {
        true => names.unconfirmed.to_owned(),
        false => fill(names.confirmed, &[("epochs", &*zone.confirmed_by.join(", "))]),
    });
    all.join(" ")
}

/// How fast every stone moves.
pub(super) fn map(results: &ResultSet, facts: &Summary) -> String {
    if results.courses.is_empty() {
        return String::new();
    }
    let names = &facts.texts.series;
    let layout = MapLayout::new(results, facts.texts);
    let speed = |s: &StoneRow| results.courses.get(&s.stone_id).map(|c| c.velocity.norm());
    let picture = MapPicture {
        title: names.map,
        value: &speed,
        unit: names.map_unit,
        scale: Scale::Sequential(nice_scale_m(results.courses.values().map(|c| c.velocity.norm()))),
        strong: None,
        arrows: false,
        loose: false,
        areas: false,
        numbers: None,
    };
    let wide = if layout.is_wide() { " wide" } else { "" };
    let picture = figure(names.map, &stone_map(&layout, &picture), names.map_note);
    format!("<div class=\"maps{wide}\">{picture}</div>")
}
