//! The paper's tables beside ours.

use super::case::{Case, Method};
use crate::error::Result;
use crate::experiment::tables::{Columns, TextTable};
use crate::figure::number;
use crate::settings::{Estimator, Settings};
use stonewise_core::evaluate::{Directions, ErrorStatistics, MotionScore};
use stonewise_io::table::Table;

/// What Table 2 of the paper says, RMSE in centimetres: in-plane (translation), out-of-plane (bulge).
const PAPER: [(&str, &str, [f64; 2]); 4] = [
    ("stones", "uav", [1.0, 1.0]),
    ("stones", "tls", [0.5, 0.5]),
    ("M3C2", "uav", [3.2, 1.3]),
    ("M3C2", "tls", [3.8, 0.6]),
];

/// The tables of the experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct PaperTables {
    /// The paper's parameters and those of our runs.
    pub(super) parameters: TextTable,
    /// Table 2: each method on each survey beside the paper's figures.
    pub(super) rmse: TextTable,
    /// All figures of every run, one row a method, survey, motion and region, metres: the columns of `table2.csv`.
    pub details: Table,
}

impl PaperTables {
    pub(super) fn new(cases: &[Case]) -> Result<Self> {
        Ok(Self {
            parameters: parameters(cases),
            rmse: rmse(cases),
            details: details(cases)?,
        })
    }

    /// Table 1, Table 2 and the details as Markdown.
    pub fn markdown(&self) -> String {
        format!(
            "Table 1: parameters\n\n{}\nTable 2: RMSE of detected and applied motions; in-plane: per axis, of the translation; \
             out-of-plane: of the bulge\n\n{}\nAll figures\n\n{}",
            self.parameters.markdown(),
            self.rmse.markdown(),
            TextTable::of(&self.details).markdown()
        )
    }
}

fn parameters(cases: &[Case]) -> TextTable {
    let estimator = |s: &Settings, gicp: &str, adjustment: &str| match s.registration.estimator {
        Estimator::Gicp => gicp.to_owned(),
        Estimator::Adjustment => adjustment.to_owned(),
    };
    let row = |name: &str, paper: &str, of: &dyn Fn(&Settings) -> String| {
        let [theirs, ours] = [Method::Paper, Method::Ours].map(|method| {
            let case = cases.iter().find(|c| c.method == method);
            case.map_or("–".to_owned(), |c| of(&c.settings))
        });
        [name.to_owned(), paper.to_owned(), theirs, ours]
    };
    let buffer = |s: &Settings| format!("{:.0}", 100.0 * s.registration.gicp.buffer_m);
    TextTable::new(
        ["parameter", "paper", "the paper's estimator here", "stonewise"],
        vec![
            row("Ratio threshold, centroids", "0.4", &|s| {
                s.r#match.max_ratio.to_string()
            }),
            row("Ratio threshold, surface", "0.95", &|s| {
                s.r#match.min_area_ratio.to_string()
            }),
            row("Estimator", "plane-to-plane ICP", &|s| {
                estimator(s, "plane-to-plane ICP", "adjustment")
            }),
            row("Buffer [cm]", "60", &|s| {
                estimator(s, &buffer(s), "none: neighbours share")
            }),
        ],
    )
}

fn rmse(cases: &[Case]) -> TextTable {
    let mut surveys: Vec<&str> = cases.iter().map(|c| c.survey.as_str()).collect();
    surveys.dedup();
    // Name, runs, whether M3C2 is meant, which figure, and what the paper calls it.
    type Way = (String, Method, usize, fn(&ErrorStatistics) -> f64, &'static str);
    let stones = |m: Method| -> Way { (format!("stones, {}", m.name()), m, 0, |e| e.rmse_m, "stones") };
    let ways: [Way; 4] = [
        stones(Method::Ours),
        stones(Method::Paper),
        ("M3C2".to_owned(), Method::Ours, 1, |e| e.rmse_m, "M3C2"),
        (
            "zero predictor".to_owned(),
            Method::Ours,
            0,
            |e| e.zero_predictor_rmse_m,
            "",
        ),
    ];
    let row = |(name, method, which, figure, paper): &Way, survey: &str| {
        let of_motion = |motion: &str| {
            let is_it = |c: &&Case| c.method == *method && c.survey == survey && c.motion.name == motion;
            cases.iter().find(is_it).map(|c| &c.all[*which])
        };
        let [shift, bulge] = ["translation", "bulge"].map(of_motion);
        let errors = [
            shift.and_then(|s| s.errors.in_plane_per_axis.as_ref()),
            bulge.and_then(|s| s.errors.out_of_plane.as_ref()),
        ];
        let counts = |s: &MotionScore| format!("{} of {}", s.estimated, s.expected);
        let [n_shift, n_bulge] = [shift, bulge].map(|s| s.map_or("–".to_owned(), counts));
        let [cm_shift, cm_bulge] = errors.map(|e| number(100.0 * e.map_or(f64::NAN, figure), 3));
        let theirs = { PAPER.iter() }
            .find(|(kind, scanner, _)| kind == paper && survey.to_lowercase().contains(scanner));
        let [told_shift, told_bulge] = [0, 1].map(|i| theirs.map_or("–".to_owned(), |t| number(t.2[i], 1)));
        let survey = survey.to_owned();
        [
            name.clone(),
            survey,
            n_shift,
            n_bulge,
            cm_shift,
            cm_bulge,
            told_shift,
            told_bulge,
        ]
    };
    let head = [
        "method",
        "survey",
        "estimated, translation",
        "estimated, bulge",
        "in-plane cm",
        "out-of-plane cm",
        "paper: in-plane cm",
        "paper: out-of-plane cm",
    ];
    let rows = ways
        .iter()
        .flat_map(|way| surveys.iter().map(move |survey| row(way, survey)));
    TextTable::new(head, rows.collect())
}

/// A method, a run, its motion and region, and the score.
type Row<'a> = (String, &'a Case, String, &'a MotionScore);

fn rows(case: &Case) -> Vec<Row<'_>> {
    let methods = [format!("stones, {}", case.method.name()), "M3C2".to_owned()];
    // M3C2 is the same in both runs of a motion.
    let shown = if case.method == Method::Ours { 2 } else { 1 };
    let mut rows = Vec::new();
    for (place, scores) in [("", Some(&case.all)), (", inside it", case.inside.as_ref())] {
        for (method, score) in methods.iter().zip(scores.into_iter().flatten()).take(shown) {
            rows.push((
                method.clone(),
                case,
                format!("{}{place}", case.motion.name),
                score,
            ));
        }
    }
    rows
}

fn details(cases: &[Case]) -> Result<Table> {
    let rows: Vec<Row> = cases.iter().flat_map(rows).collect();
    let mut columns = Columns::of(&rows);
    columns.add("method", "", "method of measurement", |r| r.0.clone())?;
    columns.add("survey", "", "clouds that were compared", |r| r.1.survey.clone())?;
    let meaning = "motion given to the second half of the points, and region of the wall";
    columns.add("motion", "", meaning, |r| r.2.clone())?;
    let meaning = "stones or core points that could have an estimate";
    columns.add("expected", "", meaning, |r| r.3.expected as u32)?;
    let meaning = "stones or core points that have an estimate";
    columns.add("estimated", "", meaning, |r| r.3.estimated as u32)?;
    type Pick = fn(&Directions) -> Option<&ErrorStatistics>;
    let directions: [(&str, &str, Pick); 4] = [
        ("in_plane_per_axis", "per axis in the plane of the face", |d| {
            d.in_plane_per_axis.as_ref()
        }),
        ("in_plane_2d", "in the plane of the face, 2D", |d| {
            d.in_plane_2d.as_ref()
        }),
        ("out_of_plane", "out of the plane of the face", |d| {
            d.out_of_plane.as_ref()
        }),
        ("3d", "3D", |d| d.norm_3d.as_ref()),
    ];
    for (direction, words, pick) in directions {
        let of = |r: &Row, figure: fn(&ErrorStatistics) -> f64| pick(&r.3.errors).map(figure);
        let (rmse, zero) = (
            format!("RMSE {words}"),
            format!("RMSE if every motion is estimated as zero, {words}"),
        );
        columns.add(&format!("rmse_{direction}_m"), "m", &rmse, |r| {
            of(r, |e| e.rmse_m)
        })?;
        columns.add(&format!("zero_{direction}_m"), "m", &zero, |r| {
            of(r, |e| e.zero_predictor_rmse_m)
        })?;
    }
    let norm = |r: &Row, figure: fn(&ErrorStatistics) -> f64| r.3.errors.norm_3d.as_ref().map(figure);
    columns.add("median_3d_m", "m", "median of the 3D error", |r| {
        norm(r, |e| e.median_m)
    })?;
    columns.add("p95_3d_m", "m", "95th percentile of the 3D error", |r| {
        norm(r, |e| e.p95_m)
    })?;
    let meaning = "share of the estimates that are wrong by more than 1 cm, 0 to 1";
    columns.add("outlier_rate", "", meaning, |r| r.3.outlier_rate)?;
    Ok(columns.table)
}
