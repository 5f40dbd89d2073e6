//! Simulation-based calibration (Talts et al. 2018; Modrák et al. 2023): walls whose motions are drawn from the prior of
//! the method, and the ranks of the truth in what the program states.

use super::walls::{DATUM_M, IMPROBABLE, SIZE_M, most_alarms, photos};
use crate::error::{Error, Result};
use crate::experiment::inner_work::InnerWork;
use crate::experiment::simulation::not_simulated;
use crate::experiment::survey_plan::{SurveyPlan, project, simulation};
use crate::experiment::tables::TextTable;
use crate::figure::{Axis, GREY, Item, PALETTE, Page, Plot};
use crate::files::{read_json, write_json, write_readable_json, write_text};
use crate::pipeline::{Context, Until, run_in};
use crate::storage::step::{Key, StepDir};
use crate::storage::store::{Keeps, StepStore};
use crate::truth::ranks_of_truth;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use stonewise_core::evaluate::{RankTest, Ranks};
use stonewise_core::progress::Progress;
use stonewise_simulate::{WallMotion, write_survey};

/// What measures the walls where the user has no plan: tables of one. Photos are few and small, to be rendered quickly.
const SURVEYS: [(&str, &str); 3] = [
    (
        "scanner",
        "stations = [{ name = 'A', along_m = 0.2, distance_m = 9.0 }, { name = 'B', along_m = 2.2, distance_m = 9.0 }]",
    ),
    ("drone", "drone = {}"),
    (
        "photos",
        "drone = {}\nphotos = { width_px = 800, height_px = 600, focal_px = 1200.0 }",
    ),
];
/// Error that all strips of a flight share, metres per axis, as the method assumes where a plan states none.
const FLIGHT_DATUM_M: f64 = 2e-3;
/// The ranks of a wall, in its step.
const RANKS: &str = "ranks.json";

/// What is calibrated.
#[derive(Clone, Debug)]
pub struct CalibrationOptions {
    /// Seed of the walls.
    pub seed: u64,
    /// Walls for each survey.
    pub walls: u64,
    /// How the walls are surveyed.
    pub surveys: Vec<CalibratedSurvey>,
}

/// A survey of a small wall.
#[derive(Clone, Debug)]
pub struct CalibratedSurvey {
    /// Its name in tables.
    pub name: String,
    /// What measures.
    plan: SurveyPlan,
}

impl CalibratedSurvey {
    /// Names of the surveys that need no plan: stations of a scanner, the lidar of a drone, and the latter with photos in
    /// which stones are tracked.
    pub const NAMES: [&str; 3] = [SURVEYS[0].0, SURVEYS[1].0, SURVEYS[2].0];

    /// The survey of this name.
    ///
    /// # Errors
    /// There is none of this name.
    pub fn usual(name: &str) -> Result<Self> {
        let [width_m, height_m] = SIZE_M;
        let found = SURVEYS.iter().find(|s| s.0 == name);
        let (_, tables) = found.ok_or_else(|| {
            let names = Self::NAMES.join(", ");
            Error::Parameters(format!("no survey {name:?}: the names are {names}"))
        })?;
        let text = format!("wall = {{ width_m = {width_m:?}, height_m = {height_m:?} }}\n{tables}");
        let plan: SurveyPlan =
            toml::from_str(&text).map_err(|e| Error::Parameters(format!("{name}: {e}")))?;
        Ok(Self {
            name: name.to_owned(),
            ..Self::planned(&plan)
        })
    }

    /// What is planned, without candidates and targets, before a small part in the middle of the planned wall.
    pub fn planned(plan: &SurveyPlan) -> Self {
        let mut plan = plan.with(None);
        let [width_m, height_m] = [
            plan.wall.width_m.min(SIZE_M[0]),
            plan.wall.height_m.min(SIZE_M[1]),
        ];
        for station in &mut plan.stations {
            station.along_m -= 0.5 * (plan.wall.width_m - width_m);
        }
        (plan.wall.width_m, plan.wall.height_m) = (width_m, height_m);
        plan.targets = None;
        if let Some(drone) = &mut plan.drone {
            drone.datum_m.get_or_insert(FLIGHT_DATUM_M);
        }
        if let Some(photos) = &mut plan.photos {
            (photos.columns, photos.rows) = (None, None);
        }
        Self {
            name: "plan".to_owned(),
            plan,
        }
    }
}

/// Ranks of one kind: of one stone or joint of each wall.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CalibrationRow {
    /// Name of the survey.
    pub survey: String,
    /// What is ranked.
    pub quantity: &'static str,
    /// `along`, `up` or `out`.
    pub axis: &'static str,
    /// Walls that have the quantity.
    pub walls: usize,
    /// The ranks and their test.
    #[serde(flatten)]
    pub test: RankTest,
    /// Most truths outside their 95 % intervals that are not improbable.
    pub most_outside: usize,
    /// Whether no more are outside.
    pub holds: bool,
}

/// A calibration, as `calibration.json` has it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Calibration {
    /// Version of stonewise.
    pub version: &'static str,
    /// The seed.
    pub seed: u64,
    /// The rows, in order.
    pub rows: Vec<CalibrationRow>,
}

type OfStones = fn(&Ranks) -> &[[f64; 3]];
const QUANTITIES: [(&str, OfStones); 3] = [
    ("motion", |r| &r.absolute),
    ("motion without datum", |r| &r.without_datum),
    ("motion across a joint", |r| &r.joints),
];
const AXES: [&str; 3] = ["along", "up", "out"];

/// Draws walls, measures them and ranks the truth; writes `calibration.json` and `calibration.html` into `out`. An
/// interrupted calibration goes on after the last wall.
///
/// # Errors
/// What stops a simulation or a run.
pub fn calibrate(options: &CalibrationOptions, out: &Path, progress: &dyn Progress) -> Result<Calibration> {
    let store = StepStore::new(&out.join("work"), Keeps::Every)?;
    progress.begin(
        "walls drawn from the prior",
        options.walls * options.surveys.len() as u64,
    );
    let mut rows = Vec::new();
    for survey in &options.surveys {
        let mut walls = Vec::new();
        for number in 0..options.walls {
            progress.check()?;
            let seed = options.seed.wrapping_mul(1000).wrapping_add(number);
            walls.push(ranked(&survey.plan, seed, &store, progress)?);
            progress.advance(1);
        }
        rows.extend(rows_of(&survey.name, &walls, options.seed));
    }

    let improbable = IMPROBABLE / rows.len().max(1) as f64;
    for row in &mut rows {
        row.most_outside = most_alarms(row.walls, improbable);
        row.holds = row.test.outside_95 <= row.most_outside;
    }
    let calibration = Calibration {
        version: env!("CARGO_PKG_VERSION"),
        seed: options.seed,
        rows,
    };
    write_readable_json(&out.join("calibration.json"), &calibration)?;
    write_text(&out.join("calibration.html"), &page(&calibration))?;
    Ok(calibration)
}

/// The ranks of a drawn wall. Of its survey and its results nothing else is kept.
fn ranked(plan: &SurveyPlan, seed: u64, store: &StepStore, progress: &dyn Progress) -> Result<Ranks> {
    let make = |dir: &StepDir| {
        let inner = InnerWork(progress);
        let (survey, results) = (dir.file("survey"), dir.file("results"));
        let mut params = simulation(plan, seed);
        params.scene.motions = vec![WallMotion::Assumed];
        if let Some(tls) = &mut params.scene.tls {
            tls.datum_m = DATUM_M;
        }
        if plan.photos.is_none() {
            params.photos = photos(2);
        }
        write_survey(&survey, &params, &inner).map_err(not_simulated)?;

        let project = project(plan, &survey)?;
        let steps = Arc::new(StepStore::new(&results.join("work"), Keeps::Newest)?);
        run_in(
            &Context::with_store(&project, &results, steps, &inner)?,
            Until::Registered,
        )?;
        let truth = survey.join("truth/stones.csv");
        let ranks = ranks_of_truth(&results, &truth, &project.settings.evaluate)?;
        for folder in [&survey, &results] {
            fs::remove_dir_all(folder).map_err(Error::io("removing", folder))?;
        }
        write_json(&dir.file(RANKS), &ranks)
    };
    let key = Key::new("calibration", &(plan, seed), &[]);
    let (dir, _) = store.step("calibration", key, &[], make)?;
    read_json(&dir.file(RANKS))
}

/// The tests of one survey. The stones of a wall share errors: one of each wall counts, chosen at random.
fn rows_of(survey: &str, walls: &[Ranks], seed: u64) -> Vec<CalibrationRow> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut rows = Vec::new();
    for (quantity, of) in QUANTITIES {
        let stones = walls.iter().map(of).filter(|all| !all.is_empty());
        let chosen: Vec<[f64; 3]> = stones.map(|all| all[rng.random_range(0..all.len())]).collect();
        for (k, axis) in AXES.into_iter().enumerate() {
            let ranks: Vec<f64> = chosen.iter().map(|ranks| ranks[k]).collect();
            rows.extend(RankTest::of(&ranks).map(|test| CalibrationRow {
                survey: survey.to_owned(),
                quantity,
                axis,
                walls: ranks.len(),
                test,
                most_outside: 0,
                holds: false,
            }));
        }
    }
    rows
}

impl Calibration {
    /// Heads of [`Self::cells`].
    pub const HEAD: [&str; 9] = [
        "survey",
        "ranks of",
        "axis",
        "walls",
        "mean",
        "in 50 %",
        "outside 95 %",
        "chi-square",
        "p",
    ];

    /// The table as text: share of the ranks in the central half, number outside the 95 % interval and the most that is
    /// allowed, chi-square of the ranks and its p.
    pub fn cells(&self) -> Vec<[String; 9]> {
        let cells = |row: &CalibrationRow| {
            let failed = if row.holds { "" } else { ", FAILS" };
            [
                row.survey.clone(),
                row.quantity.to_owned(),
                row.axis.to_owned(),
                row.walls.to_string(),
                format!("{:.2}", row.test.mean),
                format!("{:.2}", row.test.inside_50),
                format!("{} (most {}{failed})", row.test.outside_95, row.most_outside),
                format!("{:.1}", row.test.chi_square),
                format!("{:.3}", row.test.p),
            ]
        };
        self.rows.iter().map(cells).collect()
    }
}

fn page(calibration: &Calibration) -> String {
    let mut page = Page::new("Calibration of stonewise");
    page.note(&format!(
        "stonewise {}, seed {}. Motions were drawn from the prior of the method. Where all is right, the truth has every rank \
         among the values that the program holds possible equally often, and the lines follow the dashed one. A line that is \
         steep in the middle means intervals that are too wide; one that is steep at the ends, too narrow.",
        calibration.version, calibration.seed
    ));
    page.html(&TextTable::new(Calibration::HEAD, calibration.cells()).html(None));
    let line = |points: Vec<[f64; 2]>, colour: &str, name: &str| Item::Line {
        points,
        colour: colour.to_owned(),
        dashed: name.is_empty(),
        marks: false,
        name: name.to_owned(),
    };
    for rows in (calibration.rows).chunk_by(|a, b| (&a.survey, a.quantity) == (&b.survey, b.quantity)) {
        let title = format!("{}: {}", rows[0].survey, rows[0].quantity);
        let axis = |label| Axis::linear(label, [0.0, 1.0]);
        let mut plot = Plot::new(&title, axis("rank"), axis("share below"), [360.0, 300.0]);
        plot.add(line(vec![[0.0; 2], [1.0; 2]], GREY, ""));
        for (row, colour) in rows.iter().zip(PALETTE) {
            let mut below = 0;
            let mut points = vec![[0.0; 2]];
            for (k, count) in row.test.counts.iter().enumerate() {
                below += count;
                points.push([
                    (k + 1) as f64 / RankTest::BINS as f64,
                    below as f64 / row.walls as f64,
                ]);
            }
            plot.add(line(points, colour, row.axis));
        }
        page.figure(&title, &plot.svg());
    }
    page.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_stone_of_each_wall_counts() {
        // The stones of a wall share all of their error; half of the walls have no datum.
        let wall = |k: u32| {
            let ranks = vec![[(f64::from(k) + 0.5) / 40.0; 3]; 30];
            Ranks {
                absolute: if k.is_multiple_of(2) {
                    ranks.clone()
                } else {
                    Vec::new()
                },
                without_datum: ranks,
                joints: Vec::new(),
            }
        };
        let rows = rows_of("scanner", &(0..40).map(wall).collect::<Vec<_>>(), 1);
        let walls: Vec<usize> = rows.iter().map(|row| row.walls).collect();
        assert_eq!(walls, [20, 20, 20, 40, 40, 40]);
        assert!(rows.iter().all(|row| row.test.chi_square == 0.0), "{rows:?}");
    }

    #[test]
    fn stations_keep_their_place_before_the_middle_of_a_planned_wall() {
        let text = "[wall]\nwidth_m = 40.0\n[[stations]]\nname = 'A'\nalong_m = 13.0\ndistance_m = 9.0\n[targets]\nerror_m = 0.1";
        let plan: SurveyPlan = toml::from_str(text).unwrap();
        let small = CalibratedSurvey::planned(&plan).plan;
        let along_m = |plan: &SurveyPlan| plan.place(&plan.stations[0]).along_m;
        assert!((along_m(&small) - along_m(&plan)).abs() < 1e-12);
        assert!(small.wall.width_m == SIZE_M[0] && small.targets.is_none());
        for name in CalibratedSurvey::NAMES {
            assert_eq!(CalibratedSurvey::usual(name).unwrap().name, name);
        }
        assert!(CalibratedSurvey::usual("sonar").is_err());
    }
}
