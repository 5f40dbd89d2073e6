//! Results against a known truth.

use super::html::{details, section, table};
use crate::texts::{ScoreTexts, Texts, fill};
use std::fmt::Write;
use stonewise_core::evaluate::{Coverage, Directions, ErrorStatistics, Evaluation, MotionScore, TruthScore};
use stonewise_figure::{count, escape};

/// The paper's table, the full statistics, and what they mean.
pub(super) fn evaluation(evaluation: &Evaluation, texts: &Texts) -> String {
    let names = &texts.scores;
    let mut methods: Vec<(&str, &MotionScore)> = Vec::new();
    methods.extend(evaluation.stones.as_ref().map(|s| (names.stones, s)));
    methods.extend(
        evaluation
            .external
            .as_ref()
            .map(|e| (names.stones_external, &e.motions)),
    );
    methods.extend(evaluation.m3c2.as_ref().map(|s| ("M3C2", s)));
    let mut out = format!(
        "<p>{}</p>",
        fill(names.truth, &[("truth", &*escape(&evaluation.truth))])
    );

    if !methods.is_empty() {
        let _ = write!(out, "<h3>{}</h3>", names.rmse_title);
        out.push_str(&rmse_table(&methods, texts));
        let _ = write!(out, "<p class=\"note\">{}</p>", names.rmse_note);
    }

    for (name, score) in &methods {
        out.push_str(&statistics(name, score, texts));
    }
    out.push_str(&found(evaluation, texts));
    let words: String = evaluation
        .definitions
        .iter()
        .map(|(k, v)| format!("<dt>{}</dt><dd>{}</dd>", escape(k), escape(v)))
        .collect();
    out.push_str(&details(names.definitions, &format!("<dl>{words}</dl>")));
    section("evaluation", texts.sections.evaluation_title, &out)
}

/// Picks one direction of a score.
type Pick = fn(&Directions) -> Option<&ErrorStatistics>;

fn directions(names: &ScoreTexts) -> [(&'static str, Pick); 6] {
    [
        (names.along, |d| d.along.as_ref()),
        (names.up, |d| d.up.as_ref()),
        (names.per_axis, |d| d.in_plane_per_axis.as_ref()),
        (names.in_plane, |d| d.in_plane_2d.as_ref()),
        (names.out, |d| d.out_of_plane.as_ref()),
        (names.space, |d| d.norm_3d.as_ref()),
    ]
}

fn rmse_table(methods: &[(&str, &MotionScore)], texts: &Texts) -> String {
    let names = &texts.scores;
    let in_mm = [names.per_axis, names.in_plane, names.out, names.space].map(|n| format!("{n} mm"));
    let mut head = vec![names.method];
    head.extend(in_mm.iter().map(String::as_str));
    head.push(names.count);

    let cells = |score: &MotionScore, of: fn(&ErrorStatistics) -> f64| -> Vec<String> {
        directions(names)[2..]
            .iter()
            .map(|(_, pick)| mm(pick(&score.errors).map_or(f64::NAN, of), texts))
            .collect()
    };

    let row = |name: &str, score: &MotionScore, of: fn(&ErrorStatistics) -> f64| {
        let mut row = vec![escape(name)];
        row.extend(cells(score, of));
        row.push(count(score.estimated));
        row
    };

    let mut rows: Vec<Vec<String>> = methods
        .iter()
        .map(|(name, score)| row(name, score, |s| s.rmse_m))
        .collect();
    rows.extend(methods.first().map(|(name, score)| {
        let name = match texts.language.read("language.capital_nouns") {
            true => (*name).to_owned(),
            false => name.to_lowercase(),
        };
        let title = fill(names.zero, &[("method", &*name)]);
        row(&title, score, |s| s.zero_predictor_rmse_m)
    }));

    table(&head, &rows, 1)
}

fn statistics(name: &str, score: &MotionScore, texts: &Texts) -> String {
    let names = &texts.scores;
    let share = |v: Option<f64>| share(v, texts);
    // Without a datum intervals are claimed for motions against the common one only.
    let calibration = score
        .calibration
        .as_ref()
        .or(score.calibration_without_datum.as_ref());
    let covered = |of: fn(&Coverage) -> Option<f64>| share(calibration.and_then(|c| of(&c.coverage_95)));

    let coverage = |i: usize| match i {
        0 => covered(|c| c.along),
        1 => covered(|c| c.up),
        4 => covered(|c| c.out),
        _ => String::new(),
    };

    let head = [
        names.direction,
        names.rmse,
        names.mean,
        names.median,
        names.nmad,
        names.p95,
        names.outliers,
        names.count,
        names.zero_mm,
        names.covers,
    ];
    let rows: Vec<Vec<String>> = directions(names)
        .into_iter()
        .enumerate()
        .filter_map(|(i, (direction, pick))| {
            let s = pick(&score.errors)?;
            Some(vec![
                direction.into(),
                mm(s.rmse_m, texts),
                mm(s.mean_m, texts),
                mm(s.median_m, texts),
                mm(s.nmad_m, texts),
                mm(s.p95_m, texts),
                share(Some(s.outlier_rate)),
                count(s.count),
                mm(s.zero_predictor_rmse_m, texts),
                coverage(i),
            ])
        })
        .collect();

    let values = [
        ("method", &*escape(name)),
        ("n", &*count(score.estimated)),
        ("m", &*count(score.expected)),
    ];
    let title = fill(names.estimated, &values);
    let mut out = format!("<h3>{title}</h3>{}", table(&head, &rows, 1));
    let s = &score.significance;
    let values = [
        ("false", &*count(s.false_alarms)),
        ("still", &*count(s.still)),
        ("rate", &*share(s.false_alarm_rate)),
        ("hits", &*count(s.detectable_hits)),
        ("detectable", &*count(s.detectable)),
        ("hit_rate", &*share(s.detectable_hit_rate)),
    ];

    let _ = write!(out, "<p class=\"note\">{}", fill(names.significance, &values));
    if let Some(chi) = calibration.and_then(|c| c.chi_square_median) {
        out.push_str(&fill(names.chi, &[("chi", &*texts.number(chi, 2))]));
    }

    if let Some(loose) = &score.loose {
        let values = [
            ("true", &*count(loose.truly_loose)),
            ("reported", &*count(loose.reported)),
            ("right", &*count(loose.right)),
        ];
        out.push_str(&fill(names.loose, &values));
    }

    out.push_str("</p>");
    out
}

/// How many stones have a displacement, against an external truth.
fn found(evaluation: &Evaluation, texts: &Texts) -> String {
    let line = |e: &TruthScore| {
        let values = [
            ("n", &*count(e.found)),
            ("m", &*count(e.countable)),
            ("share", &*share(e.found_share, texts)),
        ];
        format!("<ul><li>{}</li></ul>", fill(texts.scores.found, &values))
    };
    evaluation.external.as_ref().map(line).unwrap_or_default()
}

/// A share as a percentage with one decimal.
fn share(value: Option<f64>, texts: &Texts) -> String {
    value.map_or("\u{2013}".into(), |v| {
        format!("{}\u{a0}%", texts.number(100.0 * v, 1))
    })
}

/// Metres as millimetres with two decimals.
fn mm(metres: f64, texts: &Texts) -> String {
    texts.number(metres * 1e3, 2)
}
