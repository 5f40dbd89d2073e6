//! Results against a known truth.

use super::html::{details, section, table};
use crate::figure::{count, escape, number};
use std::fmt::Write;
use stonewise_core::evaluate::{Coverage, Directions, ErrorStatistics, Evaluation, MotionScore};

/// The paper's table, the full statistics, and what they mean.
pub(super) fn evaluation(evaluation: &Evaluation) -> String {
    let mut methods: Vec<(&str, &MotionScore)> = Vec::new();
    methods.extend(evaluation.stones.as_ref().map(|s| ("Stones", s)));
    methods.extend(
        evaluation
            .external
            .as_ref()
            .map(|e| ("Stones, external truth", &e.motions)),
    );
    methods.extend(evaluation.m3c2.as_ref().map(|s| ("M3C2", s)));
    let mut out = format!("<p>Truth: {}.</p>", escape(&evaluation.truth));
    if !methods.is_empty() {
        out.push_str("<h3>RMSE of detected against applied motion</h3>");
        out.push_str(&rmse_table(&methods));
        out.push_str(
            "<p class=\"note\">Per axis: along and up pooled, the figure of the paper's Table 2. Zero predictor: the RMSE of an \
             estimator that always answers \u{201c}did not move\u{201d}, the figure to beat.</p>",
        );
    }
    for (name, score) in &methods {
        out.push_str(&statistics(name, score));
    }
    out.push_str(&identities(evaluation));
    let words: String = evaluation
        .definitions
        .iter()
        .map(|(k, v)| format!("<dt>{}</dt><dd>{}</dd>", escape(k), escape(v)))
        .collect();
    out.push_str(&details("Definitions", &format!("<dl>{words}</dl>")));
    section("evaluation", "Known motion: how right the results are", &out)
}

/// Picks one direction of a score.
type Pick = fn(&Directions) -> Option<&ErrorStatistics>;

const DIRECTIONS: [(&str, Pick); 6] = [
    ("along the wall", |d| d.along.as_ref()),
    ("up the face", |d| d.up.as_ref()),
    ("in-plane, per axis", |d| d.in_plane_per_axis.as_ref()),
    ("in-plane, 2D", |d| d.in_plane_2d.as_ref()),
    ("out of plane", |d| d.out_of_plane.as_ref()),
    ("3D", |d| d.norm_3d.as_ref()),
];

fn rmse_table(methods: &[(&str, &MotionScore)]) -> String {
    let head = [
        "method",
        "in-plane, per axis mm",
        "in-plane, 2D mm",
        "out of plane mm",
        "3D mm",
        "count",
    ];
    let cells = |score: &MotionScore, of: fn(&ErrorStatistics) -> f64| -> Vec<String> {
        DIRECTIONS[2..]
            .iter()
            .map(|(_, pick)| mm(pick(&score.errors).map_or(f64::NAN, of)))
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
        row(&format!("Zero predictor ({})", name.to_lowercase()), score, |s| {
            s.zero_predictor_rmse_m
        })
    }));
    table(&head, &rows, 1)
}

fn statistics(name: &str, score: &MotionScore) -> String {
    let share = |v: Option<f64>| v.map_or("–".into(), |v| format!("{}\u{a0}%", number(100.0 * v, 1)));
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
        "direction",
        "RMSE mm",
        "mean mm",
        "median mm",
        "NMAD mm",
        "95th percentile mm",
        "outliers",
        "count",
        "zero predictor mm",
        "95 % interval covers",
    ];
    let rows: Vec<Vec<String>> = DIRECTIONS
        .iter()
        .enumerate()
        .filter_map(|(i, (direction, pick))| {
            let s = pick(&score.errors)?;
            Some(vec![
                (*direction).into(),
                mm(s.rmse_m),
                mm(s.mean_m),
                mm(s.median_m),
                mm(s.nmad_m),
                mm(s.p95_m),
                share(Some(s.outlier_rate)),
                count(s.count),
                mm(s.zero_predictor_rmse_m),
                coverage(i),
            ])
        })
        .collect();
    let mut out = format!(
        "<h3>{}: {} of {} estimated</h3>{}",
        escape(name),
        count(score.estimated),
        count(score.expected),
        table(&head, &rows, 1)
    );
    let s = &score.significance;
    let _ = write!(
        out,
        "<p class=\"note\">Significance: {} of {} places at rest raised an alarm ({}; 5 % is right); {} of {} that moved by more than \
         their own limit did ({}).",
        count(s.false_alarms),
        count(s.still),
        share(s.false_alarm_rate),
        count(s.detectable_hits),
        count(s.detectable),
        share(s.detectable_hit_rate)
    );
    if let Some(chi) = calibration.and_then(|c| c.chi_square_median) {
        let _ = write!(
            out,
            " Median of e\u{2032}C<sup>\u{2212}1</sup>e: {} (2.37 is right).",
            number(chi, 2)
        );
    }
    if let Some(loose) = &score.loose {
        let _ = write!(
            out,
            " Loose stones: {} true, {} reported, {} right.",
            count(loose.truly_loose),
            count(loose.reported),
            count(loose.right)
        );
    }
    out.push_str("</p>");
    out
}

/// Matches, point labels and instances against truth.
fn identities(evaluation: &Evaluation) -> String {
    let share = |v: Option<f64>| v.map_or("–".into(), |v| format!("{}\u{a0}%", number(100.0 * v, 1)));
    let mut lines = Vec::new();
    if let Some(e) = &evaluation.external {
        lines.push(format!(
            "{} of {} countable stones have a displacement ({}).",
            count(e.found),
            count(e.countable),
            share(e.found_share)
        ));
    }
    if let Some(m) = &evaluation.matches {
        let right = format!(
            "{} of {} stones matched to themselves ({})",
            count(m.right),
            count(m.reference),
            share(m.right_share)
        );
        lines.push(format!(
            "{right}; {} matches are wrong ({}).",
            count(m.wrong),
            share(m.wrong_share)
        ));
    }
    if let Some(l) = &evaluation.labels {
        let points = count(usize::try_from(l.stone_points).unwrap_or(usize::MAX));
        lines.push(format!(
            "{} of {points} stone points carry the right stone.",
            share(l.right_share)
        ));
    }
    if let Some(i) = &evaluation.instances {
        let f1 = i.f1.map_or("–".into(), |v| number(v, 2));
        lines.push(format!(
            "{} of {} stone instances found, F1 {f1}.",
            count(i.found),
            count(i.truth)
        ));
    }
    let items: String = lines.iter().map(|l| format!("<li>{l}</li>")).collect();
    if items.is_empty() {
        items
    } else {
        format!("<ul>{items}</ul>")
    }
}

/// Metres as millimetres with two decimals.
fn mm(metres: f64) -> String {
    number(metres * 1e3, 2)
}
