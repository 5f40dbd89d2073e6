//! The surveys on which the method is judged: name, how made, what happens in it.
//!
//! A name is `MEASURED-HAPPENED-SEED`, or `MEASURED-HAPPENED-EVENT-SEED`. An event is what a mechanism of the method is
//! for; see [`events`].

use super::event::Event;
use super::figures::{Figures, figures};
use super::measure::{Failure, measure};
use super::plan::{Instrument, Plan};
use super::series::Series;
use super::stored::Stored;
use super::wall::Wall;
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
    Series(Box<Series>),
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
const MEASURED: [(&str, [Instrument; 2]); 8] = [
    ("tls", [SCANNER; 2]),
    ("tls1", [Instrument::Scanner(1); 2]),
    ("tls6", [Instrument::Scanner(6); 2]),
    ("uav", [DRONE; 2]),
    ("photos", [Instrument::Photos { is_joint: true }; 2]),
    ("photos2", [Instrument::Photos { is_joint: false }; 2]),
    ("tls_uav", [SCANNER, DRONE]),
    ("uav_tls", [DRONE, SCANNER]),
];

const MOTIONS: [&str; 8] = [
    "still",
    "combo",
    "loose",
    "far",
    "crack",
    "creep",
    "settlement",
    "bulge",
];

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

/// What else happens: its name, what measures it, the motion of the stones, and what is changed in the plan.
type Kind = (&'static str, &'static [&'static str], &'static str, fn(&mut Plan));

/// Mechanisms by what happens: `probe` far; `covered`, `foreign` ivy; `partial` car, snow, half, thirds; `two_surfaces`
/// partners, masks; `bodies` buttress, door, apart; `sensors` other_sensor; `correlation`, `stone_factor`, `slopes` lines;
/// `crack`, `across` crack; `zone` creep; `octaves_shown`, `shared` photos; `obs_*` every survey with sources, above all
/// stable, merged and the faults of sources at the end.
const KINDS: [Kind; 35] = [
    ("masks", &["tls", "uav", "photos"], "combo", |p| {
        p.events.push(Event::Masks)
    }),
    ("partners", &["tls", "uav"], "loose", |p| {
        p.events.push(Event::Partners)
    }),
    ("corners", &["tls", "uav"], "loose", |p| {
        p.events.push(Event::Corners)
    }),
    ("ivy", &["tls"], "still", |p| p.events.push(Event::Ivy(0.8))),
    ("thin_ivy", &["tls"], "still", |p| p.events.push(Event::Ivy(0.4))),
    ("snow", &["tls"], "still", |p| p.events.push(Event::Snow)),
    ("car", &["tls", "uav"], "loose", |p| p.events.push(Event::Car)),
    ("half", &["tls"], "still", |p| p.events.push(Event::Half)),
    ("thirds", &["tls", "uav", "photos"], "still", |p| {
        p.events.push(Event::Thirds)
    }),
    ("apart", &["tls", "uav", "photos"], "still", |p| {
        p.events.push(Event::Apart)
    }),
    ("single", &["tls", "uav", "photos"], "still", |p| {
        p.motions = vec![WallMotion::Loose {
            share: 0.0,
            at_least: 1,
            shift_m: [0.005, 0.03],
            rotation_rad: 0.035,
        }]
    }),
    ("repairs", &["tls"], "still", |p| p.events.push(Event::Repairs)),
    ("hut", &["uav"], "still", |p| p.events.push(Event::Hut(0.0))),
    ("moving_hut", &["tls", "uav"], "still", |p| {
        p.events.push(Event::Hut(0.02))
    }),
    ("door", &["tls", "photos"], "still", |p| {
        p.events.push(Event::Door(0.1))
    }),
    ("buttress", &["tls"], "still", |p| {
        p.events.push(Event::Buttress(0.3, 0.0))
    }),
    ("moving_buttress", &["tls", "uav"], "still", |p| {
        p.events.push(Event::Buttress(0.3, 0.005))
    }),
    ("lines", &["tls"], "combo", |p| p.events.push(Event::ScanLines)),
    ("other_sensor", &["tls"], "combo", |p| {
        p.events.push(Event::OtherSensor)
    }),
    ("noise", &["tls"], "combo", |p| p.events.push(Event::Noise(0.005))),
    ("rounded", &["tls"], "bulge", |p| {
        p.events.push(Event::Rounded(0.005))
    }),
    ("merged", &["tls", "uav"], "still", |p| {
        p.events.push(Event::Merged)
    }),
    ("stable", &["tls", "uav"], "still", |p| p.has_stable = true),
    ("stable", &["tls", "uav"], "settlement", |p| p.has_stable = true),
    ("nothing_shared", &["tls"], "still", |p| p.tls.datum_m = 0.0),
    ("shared_twice", &["tls"], "still", |p| p.tls.datum_m *= 2.0),
    ("shared_twice", &["uav"], "still", |p| p.uav.datum_m *= 2.0),
    ("scale", &["tls"], "still", |p| p.tls.scale_error = 5e-5),
    ("incidence", &["tls"], "still", |p| {
        p.tls.beam.incidence_m = 1.6e-3
    }),
    ("darkness", &["tls"], "still", |p| p.tls.beam.darkness_m = 4e-4),
    ("walk", &["uav"], "still", |p| {
        p.uav.drift = StripDrift::RandomWalk
    }),
    ("sine", &["uav"], "still", |p| p.uav.drift = StripDrift::Sine),
    ("jump", &["uav"], "still", |p| p.uav.drift = StripDrift::Jump),
    ("adjusted", &["uav"], "still", |p| p.uav.adjusted = true),
    ("large", &["tls6", "uav"], "combo", |p| {
        (p.size_m, p.tls.reach_m) = ([60.0, 3.0], 12.0)
    }),
];

/// Surveys of each simulated kind in `full`.
const SEEDS: u64 = 5;

/// All surveys, in their order. `quick` has one of each small kind, and four where nothing happens.
pub fn all() -> Vec<Survey> {
    let mut list = Vec::new();
    let mut add = |name: String, quick: u64, made: &dyn Fn() -> Made| {
        list.extend((1..=SEEDS).map(|seed| Survey {
            name: format!("{name}-{seed}"),
            seed: 100 * number_of(&name) + seed,
            made: made(),
            is_quick: seed <= quick,
        }));
    };
    for (measured, instruments) in MEASURED.into_iter().filter(|m| m.0 != "tls6") {
        for motion in MOTIONS {
            let plan = Plan::usual(instruments, happened(motion));
            let quick = if motion == "still" { 4 } else { 1 };
            add(format!("{measured}-{motion}"), quick, &|| {
                Made::Simulated(Box::new(plan.clone()))
            });
        }
    }
    for (kind, by, motion, change) in KINDS {
        for (measured, instruments) in MEASURED.into_iter().filter(|m| by.contains(&m.0)) {
            let mut plan = Plan::usual(instruments, happened(motion));
            change(&mut plan);
            let quick = u64::from(kind != "large");
            let name = format!("{measured}-{motion}-{kind}");
            add(name, quick, &|| Made::Simulated(Box::new(plan.clone())));
        }
    }
    for (happened, creep_m, step_m) in [("still", 0.0, 0.0), ("creep", 0.002, 0.0), ("step", 0.0, 0.003)] {
        let mut plan = Plan::usual([SCANNER; 2], Vec::new());
        plan.size_m = [2.0, 1.2];
        let series = Series {
            plan,
            creep_m,
            step_m,
        };
        add(format!("tls_series-{happened}"), 1, &|| {
            Made::Series(Box::new(series.clone()))
        });
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn names_are_unique_and_each_kind_happens_five_times() {
        let all = all();
        let names: BTreeSet<&str> = all.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(names.len(), all.len());
        let of = |kind: &str| all.iter().filter(|s| s.name.contains(kind)).count();
        assert!(KINDS.iter().all(|kind| of(kind.0) >= 5));
        assert_eq!(Survey::group("tls-still-12"), "tls-still");
        assert_eq!(Survey::group("dam_tls-combo"), "dam_tls-combo");
    }

    /// A small scanned wall on which one stone is loose: it is found, and a second time with the same figures.
    #[test]
    fn the_same_survey_has_the_same_figures() {
        let mut plan = Plan::usual([SCANNER; 2], happened("loose"));
        plan.size_m = [1.6, 1.2];
        let once = || figures(&measure(&plan.make(3), &AdjustmentParams::default()).unwrap());
        let first = once();
        assert_eq!(first, once());
        assert!(
            first["measured"] > 0.9 && first["loose_recall"] > 0.5,
            "{first:?}"
        );
        assert!(first["in_rmse"] < 2.0 && first["out_rmse"] < 1.0, "{first:?}");
    }
}
