//! The surveys on which the method is judged: name, how made, what happens in it.
//!
//! A name is `MEASURED-HAPPENED-SEED`, or `MEASURED-HAPPENED-EVENT-SEED`. An event is what a mechanism of the method is
//! for; see [`events`].

use super::event::Event;
use super::figures::{Figures, figures};
use super::measure::{Failure, measure};
use super::series::Series;
use super::stored::Stored;
use super::wall::{Fault, Instrument, Plan, Wall};
use crate::figures::{peak_memory_mb, processor_seconds, reset_peak_memory};
use stonewise_core::registration::AdjustmentParams;
use stonewise_simulate::{StripDrift, WallMotion};

/// A survey by its name.
pub struct Survey {
    pub name: String,
    made: Made,
    seed: u64,
    /// Whether it takes part in `quick`.
    pub is_quick: bool,
}

enum Made {
    Simulated(Box<Plan>),
    Stored(Stored),
    Series(Series),
}

impl Survey {
    /// Name without the seed: surveys that differ in nothing else.
    pub fn group(name: &str) -> &str {
        let seed = name
            .rsplit_once('-')
            .filter(|(_, last)| last.bytes().all(|b| b.is_ascii_digit()));
        seed.map_or(name, |(group, _)| group)
    }

    /// Makes and measures it. `results`: folder of results of the real surveys.
    pub fn figures(&self, params: &AdjustmentParams, results: Option<&str>) -> Result<Figures, Failure> {
        match &self.made {
            Made::Simulated(plan) => timed(&plan.make(self.seed), params),
            Made::Stored(stored) => timed(&stored.read(results)?, params),
            Made::Series(series) => series.figures(self.seed, params),
        }
    }
}

/// The figures of a wall with the processor time and the most memory that its measurement took.
fn timed(wall: &Wall, params: &AdjustmentParams) -> Result<Figures, Failure> {
    reset_peak_memory();
    let started = processor_seconds();
    let measured = measure(wall, params)?;
    let seconds = processor_seconds() - started;
    let mut figures = figures(&measured);
    figures.insert("seconds".to_owned(), seconds);
    figures.insert("memory_mb".to_owned(), peak_memory_mb());
    Ok(figures)
}

const SCANNER: Instrument = Instrument::Scanner(2);
const DRONE: Instrument = Instrument::Drone(3);

/// What measures both epochs.
const MEASURED: [(&str, [Instrument; 2]); 7] = [
    ("tls", [SCANNER; 2]),
    ("tls1", [Instrument::Scanner(1); 2]),
    ("uav", [DRONE; 2]),
    ("photos", [Instrument::Photos { is_joint: true }; 2]),
    ("photos2", [Instrument::Photos { is_joint: false }; 2]),
    ("tls_uav", [SCANNER, DRONE]),
    ("uav_tls", [DRONE, SCANNER]),
];

const MOTIONS: [&str; 7] = ["combo", "loose", "far", "crack", "creep", "settlement", "bulge"];

/// What happens to the stones.
fn happened(name: &str) -> Vec<WallMotion> {
    let loose = |at_least, shift_m, rotation_rad| WallMotion::Loose {
        share: 0.0,
        at_least,
        shift_m,
        rotation_rad,
    };
    let bulge = |depth_m, diameter_m| WallMotion::Bulge {
        centre_m: [0.2, 1.1],
        depth_m,
        diameter_m,
    };
    let settlement = |depth_m| WallMotion::Settlement {
        from_m: -0.3,
        to_m: 0.3,
        depth_m,
    };
    match name {
        "combo" => vec![settlement(0.01), bulge(0.03, 1.8), loose(5, [0.005, 0.03], 0.035)],
        "loose" => vec![loose(6, [0.005, 0.03], 0.035)],
        "far" => vec![loose(5, [0.03, 0.06], 0.05)],
        "crack" => vec![WallMotion::Crack {
            along_m: 0.1,
            slope: 0.15,
            d_m: [0.004, -0.004, 0.003],
        }],
        "creep" => vec![WallMotion::Zone {
            centre_m: [0.2, 1.1],
            d_m: [0.001, 0.004, 0.0],
            diameter_m: 1.5,
        }],
        "settlement" => vec![settlement(0.004)],
        "bulge" => vec![bulge(0.006, 1.5)],
        _ => Vec::new(),
    }
}

/// An event's name, what measures it, the motion of the stones, and what happens.
type Happening = (&'static str, &'static [&'static str], &'static str, Vec<Event>);

/// What else happens: its name, what measures it, the motion of the stones, and the events.
///
/// Mechanisms by events: `probe` far; `covered`, `foreign` ivy; `partial` car, snow, half; `halves` corners; `room`,
/// `two_surfaces` partners, masks; `roughness` hut; `restart`, `bodies` buttress, door; `sensors` other_sensor;
/// `correlation`, `stone_factor`, `slopes` lines; `crack`, `across` crack; `zone` creep; `octaves_shown`, `shared`
/// photos; `obs_*` every survey with sources, stable and merged.
fn events() -> Vec<Happening> {
    vec![
        ("masks", &["tls", "uav", "photos"], "combo", vec![Event::Masks]),
        ("partners", &["tls", "uav"], "loose", vec![Event::Partners]),
        ("corners", &["tls", "uav"], "loose", vec![Event::Corners]),
        ("ivy", &["tls"], "still", vec![Event::Ivy(0.8)]),
        ("thin_ivy", &["tls"], "still", vec![Event::Ivy(0.4)]),
        ("snow", &["tls"], "still", vec![Event::Snow]),
        ("car", &["tls", "uav"], "loose", vec![Event::Car]),
        ("half", &["tls"], "still", vec![Event::Half]),
        ("repairs", &["tls"], "still", vec![Event::Repairs]),
        ("hut", &["uav"], "still", vec![Event::Hut(0.0)]),
        ("moving_hut", &["tls", "uav"], "still", vec![Event::Hut(0.02)]),
        ("door", &["tls", "photos"], "still", vec![Event::Door(0.1)]),
        ("buttress", &["tls"], "still", vec![Event::Buttress(0.3, 0.0)]),
        (
            "moving_buttress",
            &["tls", "uav"],
            "still",
            vec![Event::Buttress(0.3, 0.005)],
        ),
        ("lines", &["tls"], "combo", vec![Event::ScanLines]),
        ("other_sensor", &["tls"], "combo", vec![Event::OtherSensor]),
        ("noise", &["tls"], "combo", vec![Event::Noise(0.005)]),
        ("rounded", &["tls"], "bulge", vec![Event::Rounded(0.005)]),
        ("merged", &["tls", "uav"], "still", vec![Event::Merged]),
    ]
}

/// What the sources get wrong on still walls: its name, what measures it, and the fault.
const FAULTS: [(&str, &str, Fault); 9] = [
    ("nothing_shared", "tls", Fault::Shared(0.0)),
    ("shared_twice", "tls", Fault::Shared(2.0)),
    ("shared_twice", "uav", Fault::Shared(2.0)),
    ("scale", "tls", Fault::Scale(5e-5)),
    ("surface", "tls", Fault::Surface(1.6e-3)),
    ("walk", "uav", Fault::Drift(StripDrift::RandomWalk)),
    ("sine", "uav", Fault::Drift(StripDrift::Sine)),
    ("jump", "uav", Fault::Drift(StripDrift::Jump)),
    ("adjusted", "uav", Fault::Adjusted),
];

/// Surveys of each simulated kind in `full`.
const SEEDS: u64 = 5;

/// All surveys, in their order. `quick` has one of each kind, and four where nothing moves.
pub fn all() -> Vec<Survey> {
    let mut list = Vec::new();
    let mut add = |name: String, plan: Plan, quick: u64| {
        list.extend((1..=SEEDS).map(|seed| Survey {
            name: format!("{name}-{seed}"),
            seed: 100 * number_of(&name) + seed,
            made: Made::Simulated(Box::new(plan.clone())),
            is_quick: seed <= quick,
        }));
    };
    let plan = |instruments, motion| Plan {
        instruments,
        size_m: [3.0, 2.0],
        motions: happened(motion),
        events: Vec::new(),
        fault: Fault::Usual,
        has_stable: false,
    };
    let by = |names: &'static [&'static str]| MEASURED.into_iter().filter(|m| names.contains(&m.0));
    for (measured, instruments) in MEASURED {
        add(format!("{measured}-still"), plan(instruments, "still"), 4);
        for motion in MOTIONS {
            add(format!("{measured}-{motion}"), plan(instruments, motion), 1);
        }
    }
    for (measured, instruments) in by(&["tls", "uav"]) {
        for motion in ["still", "settlement"] {
            let mut plan = plan(instruments, motion);
            plan.has_stable = true;
            add(format!("{measured}-{motion}-stable"), plan, 1);
        }
    }
    for (event, measured, motion, events) in events() {
        for (measured, instruments) in by(measured) {
            let mut plan = plan(instruments, motion);
            plan.events.clone_from(&events);
            add(format!("{measured}-{motion}-{event}"), plan, 1);
        }
    }
    for (name, measured, fault) in FAULTS {
        for (_, instruments) in MEASURED.into_iter().filter(|m| m.0 == measured) {
            let mut plan = plan(instruments, "still");
            plan.fault = fault;
            add(format!("{measured}-still-{name}"), plan, 1);
        }
    }
    for (measured, instruments) in [("tls", [Instrument::Scanner(6); 2]), ("uav", [DRONE; 2])] {
        let mut plan = plan(instruments, "combo");
        plan.size_m = [60.0, 3.0];
        add(format!("{measured}-combo-large"), plan, 0);
    }
    for (happened, creep_m, step_m) in [("still", 0.0, 0.0), ("creep", 0.002, 0.0), ("step", 0.0, 0.003)] {
        let mut plan = plan([SCANNER; 2], "still");
        plan.size_m = [2.0, 1.2];
        let series = Series {
            plan,
            creep_m,
            step_m,
        };
        list.extend((1..=SEEDS).map(|seed| Survey {
            name: format!("tls_series-{happened}-{seed}"),
            seed: 100 * number_of(happened) + seed,
            made: Made::Series(series.clone()),
            is_quick: seed <= 1,
        }));
    }
    let stored = Stored::all().into_iter().map(|(name, stored, is_quick)| Survey {
        name,
        made: Made::Stored(stored),
        seed: 0,
        is_quick,
    });
    list.extend(stored);
    list
}

/// A number of a name's own, so that a new survey changes no other.
fn number_of(name: &str) -> u64 {
    name.bytes().fold(7, |n, b| (31 * n + u64::from(b)) % 1_000_003)
}
