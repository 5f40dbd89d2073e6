//! The paper's tables beside ours.

use super::case::{Case, Method};
use super::detectors::MeasuredDetectors;
use super::outcome::Outcome;
use crate::error::Result;
use crate::figure::number;
use std::fmt::Write;
use stonewise_core::evaluate::{Directions, ErrorStatistics, MotionScore};
use stonewise_io::table::Table;
use stonewise_segment::evaluation::MaskScore;

/// What Table 2 of the paper says, RMSE in centimetres: in-plane (translation), out-of-plane (bulge).
const PAPER: [(&str, &str, [f64; 2]); 4] = [
    ("stones", "UAV", [1.0, 1.0]),
    ("stones", "TLS", [0.5, 0.5]),
    ("M3C2", "UAV", [3.2, 1.3]),
    ("M3C2", "TLS", [3.8, 0.6]),
];

/// What section 4 of the paper says of its network, trained on photos of its dam: precision, recall, F1, mean
/// IoU.
const PAPER_SEGMENTATION: [f64; 4] = [0.92, 0.72, 0.81, 0.84];

/// The tables of the experiment, as text.
#[derive(Clone, Debug, PartialEq)]
pub struct PaperTables {
    /// The paper's parameters and those of our runs: parameter, paper, the paper's estimator here, stonewise.
    pub parameters: Vec<Vec<String>>,
    /// Method, survey, how many were estimated with either motion, RMSE in-plane per axis (translation) and
    /// out of plane (bulge) in cm, the paper's two figures.
    pub rmse: Vec<Vec<String>>,
    /// Figures of every detector on the stones held out of labelled photos; empty where none was asked for.
    pub segmentation: Vec<Segmented>,
    /// All figures of every run, one row a method, survey, motion and region.
    pub details: Vec<Detail>,
}

/// Figures of one detector on the stones held out of labelled photos.
#[derive(Clone, Debug, PartialEq)]
pub struct Segmented {
    /// Detector.
    pub detector: String,
    /// Surveys with these photos.
    pub surveys: String,
    /// Photos with masks.
    pub photos: usize,
    /// The figures.
    pub score: MaskScore,
}

/// Figures of one method on one survey with one motion; lengths in metres.
#[derive(Clone, Debug, PartialEq)]
pub struct Detail {
    /// Method.
    pub method: String,
    /// Survey.
    pub survey: String,
    /// Motion.
    pub motion: String,
    /// Stones or core points that could have an estimate, and those that have one.
    pub count: [usize; 2],
    /// RMSE per axis in the plane, in the plane 2D, out of the plane, 3D.
    pub rmse_m: [f64; 4],
    /// Median and 95th percentile of the 3D error.
    pub norm_m: [f64; 2],
    /// Share of estimates beyond 1 cm.
    pub outlier_rate: f64,
    /// RMSE of always answering zero, as `rmse_m`.
    pub zero_m: [f64; 4],
}

const DETAIL_HEAD: [&str; 13] = [
    "method",
    "survey",
    "motion",
    "estimated",
    "in-plane per axis mm",
    "in-plane 2D mm",
    "out-of-plane mm",
    "3D mm",
    "median 3D mm",
    "95 % 3D mm",
    "beyond 1 cm",
    "zero: in-plane per axis mm",
    "zero: out-of-plane mm",
];
pub(super) const RMSE_HEAD: [&str; 8] = [
    "method",
    "survey",
    "estimated, translation",
    "estimated, bulge",
    "in-plane cm",
    "out-of-plane cm",
    "paper: in-plane cm",
    "paper: out-of-plane cm",
];
pub(super) const SEGMENTATION_HEAD: [&str; 9] = [
    "detector",
    "surveys",
    "photos",
    "stones held out",
    "found",
    "precision",
    "recall",
    "F1",
    "mean IoU",
];
pub(super) const PARAMETER_HEAD: [&str; 4] =
    ["parameter", "paper", "the paper's estimator here", "stonewise"];

impl PaperTables {
    pub(super) fn new(all: &Outcome) -> Self {
        Self {
            parameters: parameters(&all.cases),
            rmse: rmse(&all.cases),
            segmentation: all.detectors.iter().flat_map(segmented).collect(),
            details: all.cases.iter().flat_map(details).collect(),
        }
    }

    /// Table 1, Table 2, the segmentation and the details as Markdown.
    pub fn markdown(&self) -> String {
        let mut out = String::from("Table 1: parameters\n\n");
        out += &markdown(&PARAMETER_HEAD, &self.parameters);
        out += "\nTable 2: RMSE of detected and applied motions; in-plane: per axis, of the translation; out-of-plane: of the bulge\n\n";
        out += &markdown(&RMSE_HEAD, &self.rmse);
        if !self.segmentation.is_empty() {
            out += "\nSegmentation: stones held out of the training\n\n";
            out += &markdown(&SEGMENTATION_HEAD, &self.segmentation_rows());
        }
        out += "\nAll figures\n\n";
        out += &markdown(&DETAIL_HEAD, &self.detail_rows());
        out
    }

    pub(super) fn detail_head() -> &'static [&'static str] {
        &DETAIL_HEAD
    }

    pub(super) fn detail_rows(&self) -> Vec<Vec<String>> {
        let mm = |v: f64| number(1e3 * v, 2);
        let row = |d: &Detail| {
            let mut row = vec![d.method.clone(), d.survey.clone(), d.motion.clone()];
            row.push(format!("{} of {}", d.count[1], d.count[0]));
            row.extend(d.rmse_m.iter().chain(&d.norm_m).map(|v| mm(*v)));
            row.push(format!("{} %", number(100.0 * d.outlier_rate, 1)));
            row.extend([d.zero_m[0], d.zero_m[2]].map(mm));
            row
        };
        self.details.iter().map(row).collect()
    }

    /// The paper's figures, and those of the detectors.
    pub(super) fn segmentation_rows(&self) -> Vec<Vec<String>> {
        let shares = |values: [Option<f64>; 4]| values.map(|v| number(v.unwrap_or(f64::NAN), 2));
        let mut paper = vec!["the paper's network, on its own dam".to_owned()];
        paper.extend(["–"; 4].map(str::to_owned));
        paper.extend(shares(PAPER_SEGMENTATION.map(Some)));
        let row = |s: &Segmented| {
            let counts = [s.photos, s.score.references, s.score.found].map(|n| n.to_string());
            let mut row = vec![s.detector.clone(), s.surveys.clone()];
            row.extend(counts);
            row.extend(shares(figures(&s.score)));
            row
        };
        std::iter::once(paper)
            .chain(self.segmentation.iter().map(row))
            .collect()
    }

    /// Figures of the detectors as a table of numbers; NaN where a figure is not defined.
    pub(super) fn segmentation_csv(&self) -> Result<Table> {
        let all = &self.segmentation;
        let count = |of: fn(&Segmented) -> usize| all.iter().map(|s| of(s) as u32).collect::<Vec<u32>>();
        let mut table = Table::new();
        let detectors: Vec<String> = all.iter().map(|s| s.detector.clone()).collect();
        table.push("detector", "", "detector", detectors)?;
        let surveys: Vec<String> = all.iter().map(|s| s.surveys.clone()).collect();
        table.push("surveys", "", "surveys with these photos", surveys)?;
        table.push("photos", "", "photos with masks", count(|s| s.photos))?;
        let meaning = "true stones held out of training";
        table.push("references", "", meaning, count(|s| s.score.references))?;
        let meaning = "stones found in the areas held out";
        table.push("found", "", meaning, count(|s| s.score.found))?;
        let meaning = "stones found that fit a true one with an IoU of at least 0.5";
        table.push("right", "", meaning, count(|s| s.score.right))?;
        let columns = [
            ("precision", "share of the stones found that are right, 0 to 1"),
            ("recall", "share of the true stones that are found, 0 to 1"),
            ("f1", "harmonic mean of precision and recall, 0 to 1"),
            ("mean_iou", "mean IoU of the stones that are right, 0 to 1"),
        ];
        for (i, (name, meaning)) in columns.into_iter().enumerate() {
            let values = all.iter().map(|s| figures(&s.score)[i].unwrap_or(f64::NAN));
            table.push(name, "", meaning, values.collect::<Vec<f64>>())?;
        }
        Ok(table)
    }

    /// The details as a table of numbers, metres.
    pub(super) fn csv(&self) -> Result<Table> {
        let all = &self.details;
        let mut table = Table::new();
        let text = |of: &dyn Fn(&Detail) -> &String| all.iter().map(|d| of(d).clone()).collect::<Vec<_>>();
        let real = |of: &dyn Fn(&Detail) -> f64| all.iter().map(of).collect::<Vec<f64>>();
        let count = |i: usize| all.iter().map(|d| d.count[i] as u32).collect::<Vec<u32>>();
        table.push("method", "", "method of measurement", text(&|d| &d.method))?;
        table.push("survey", "", "clouds that were compared", text(&|d| &d.survey))?;
        let meaning = "motion given to the second half of the points, and region of the wall";
        table.push("motion", "", meaning, text(&|d| &d.motion))?;
        let meaning = "stones or core points that could have an estimate";
        table.push("expected", "", meaning, count(0))?;
        let meaning = "stones or core points that have an estimate";
        table.push("estimated", "", meaning, count(1))?;
        let directions = [
            ("in_plane_per_axis", "per axis in the plane of the face"),
            ("in_plane_2d", "in the plane of the face, 2D"),
            ("out_of_plane", "out of the plane of the face"),
            ("3d", "3D"),
        ];
        for (i, (direction, words)) in directions.into_iter().enumerate() {
            let (rmse, zero) = (
                format!("RMSE {words}"),
                format!("RMSE if every motion is estimated as zero, {words}"),
            );
            table.push(&format!("rmse_{direction}_m"), "m", &rmse, real(&|d| d.rmse_m[i]))?;
            table.push(&format!("zero_{direction}_m"), "m", &zero, real(&|d| d.zero_m[i]))?;
        }
        table.push(
            "median_3d_m",
            "m",
            "median of the 3D error",
            real(&|d| d.norm_m[0]),
        )?;
        let meaning = "95th percentile of the 3D error";
        table.push("p95_3d_m", "m", meaning, real(&|d| d.norm_m[1]))?;
        let meaning = "share of the estimates that are wrong by more than 1 cm, 0 to 1";
        table.push("outlier_rate", "", meaning, real(&|d| d.outlier_rate))?;
        Ok(table)
    }
}

fn segmented(measured: &MeasuredDetectors) -> Vec<Segmented> {
    let row = |(detector, score): &(String, MaskScore)| Segmented {
        detector: detector.clone(),
        surveys: measured.surveys.join(", "),
        photos: measured.photos,
        score: score.clone(),
    };
    measured.scores.iter().map(row).collect()
}

fn figures(score: &MaskScore) -> [Option<f64>; 4] {
    [score.precision, score.recall, score.f1, score.mean_iou]
}

fn parameters(cases: &[Case]) -> Vec<Vec<String>> {
    let value = |method: Method, path: &[&str]| {
        let case = cases.iter().find(|c| c.method == method)?;
        let parameters = serde_json::to_value(&case.results.run.as_ref()?.parameters).ok()?;
        let found = path.iter().try_fold(&parameters, |v, name| v.get(name))?;
        Some(found.as_str().map_or_else(|| found.to_string(), str::to_owned))
    };
    let row = |name: &str, paper: &str, path: &[&str], factor: f64| {
        let of = |method| {
            let text = value(method, path).unwrap_or_else(|| "–".to_owned());
            let number = text.parse::<f64>().map(|v| v * factor);
            number.map_or(text, |v| format!("{}", (v * 1e6).round() / 1e6))
        };
        vec![
            name.to_owned(),
            paper.to_owned(),
            of(Method::Paper),
            of(Method::Ours),
        ]
    };
    let mut rows = vec![
        row("Ratio threshold, centroids", "0.4", &["match", "max_ratio"], 1.0),
        row(
            "Ratio threshold, surface",
            "0.95",
            &["match", "min_area_ratio"],
            1.0,
        ),
        row(
            "Estimator",
            "plane-to-plane ICP",
            &["registration", "estimator"],
            1.0,
        ),
        row("Buffer [cm]", "60", &["registration", "gicp", "buffer_m"], 100.0),
    ];
    if value(Method::Ours, &["registration", "estimator"]).as_deref() == Some("adjustment")
        && let Some(ours) = rows[3].last_mut()
    {
        "none: neighbours share".clone_into(ours);
    }
    rows
}

fn rmse(cases: &[Case]) -> Vec<Vec<String>> {
    let mut surveys: Vec<&str> = Vec::new();
    for case in cases {
        if !surveys.contains(&case.survey.as_str()) {
            surveys.push(&case.survey);
        }
    }
    let cm = |score: Option<&ErrorStatistics>, of: fn(&ErrorStatistics) -> f64| -> String {
        score.map_or("–".to_owned(), |s| number(100.0 * of(s), 3))
    };
    type Pick = fn(&Case) -> &MotionScore;
    type Figure = fn(&ErrorStatistics) -> f64;
    type Way<'a> = (String, Method, Pick, Figure, Option<&'a str>);
    let ways: [Way; 4] = [
        (
            format!("stones, {}", Method::Ours.name()),
            Method::Ours,
            |c| &c.stones,
            |s| s.rmse_m,
            Some("stones"),
        ),
        (
            format!("stones, {}", Method::Paper.name()),
            Method::Paper,
            |c| &c.stones,
            |s| s.rmse_m,
            Some("stones"),
        ),
        (
            "M3C2".to_owned(),
            Method::Ours,
            |c| &c.m3c2,
            |s| s.rmse_m,
            Some("M3C2"),
        ),
        (
            "zero predictor".to_owned(),
            Method::Ours,
            |c| &c.stones,
            |s| s.zero_predictor_rmse_m,
            None,
        ),
    ];
    let mut rows = Vec::new();
    for (name, method, pick, figure, paper) in ways {
        for survey in &surveys {
            let score = |motion: &str| {
                let of = |c: &&Case| c.method == method && c.survey == *survey && c.motion.name == motion;
                cases.iter().find(of).map(pick)
            };
            let in_plane = score("translation").and_then(|s| s.errors.in_plane_per_axis.as_ref());
            let out = score("bulge").and_then(|s| s.errors.out_of_plane.as_ref());
            let count = |motion| {
                score(motion).map_or("–".to_owned(), |s| format!("{} of {}", s.estimated, s.expected))
            };
            let theirs = PAPER.iter().find(|(kind, scanner, _)| {
                Some(*kind) == paper && survey.to_lowercase().contains(&scanner.to_lowercase())
            });
            let told = |i: usize| theirs.map_or("–".to_owned(), |(_, _, cm)| number(cm[i], 1));
            rows.push(vec![
                name.clone(),
                (*survey).to_owned(),
                count("translation"),
                count("bulge"),
                cm(in_plane, figure),
                cm(out, figure),
                told(0),
                told(1),
            ]);
        }
    }
    rows
}

fn details(case: &Case) -> Vec<Detail> {
    let detail = |method: &str, motion: String, score: &MotionScore| {
        let of = |figure: fn(&ErrorStatistics) -> f64| {
            let errors: &Directions = &score.errors;
            [
                &errors.in_plane_per_axis,
                &errors.in_plane_2d,
                &errors.out_of_plane,
                &errors.norm_3d,
            ]
            .map(|s| s.as_ref().map_or(f64::NAN, figure))
        };
        Detail {
            method: method.to_owned(),
            survey: case.survey.clone(),
            motion,
            count: [score.expected, score.estimated],
            rmse_m: of(|s| s.rmse_m),
            norm_m: [of(|s| s.median_m)[3], of(|s| s.p95_m)[3]],
            outlier_rate: score.outlier_rate.unwrap_or(f64::NAN),
            zero_m: of(|s| s.zero_predictor_rmse_m),
        }
    };
    let stones = format!("stones, {}", case.method.name());
    let mut rows = vec![detail(&stones, case.motion.name.to_owned(), &case.stones)];
    let with_m3c2 = case.method == Method::Ours;
    if with_m3c2 {
        rows.push(detail("M3C2", case.motion.name.to_owned(), &case.m3c2));
    }
    if let Some([stones_inside, m3c2_inside]) = &case.inside {
        let name = format!("{}, inside it", case.motion.name);
        rows.push(detail(&stones, name.clone(), stones_inside));
        if with_m3c2 {
            rows.push(detail("M3C2", name, m3c2_inside));
        }
    }
    rows
}

fn markdown(head: &[&str], rows: &[Vec<String>]) -> String {
    let mut out = format!("| {} |\n|{}\n", head.join(" | "), " --- |".repeat(head.len()));
    for row in rows {
        let _ = writeln!(out, "| {} |", row.join(" | "));
    }
    out
}
