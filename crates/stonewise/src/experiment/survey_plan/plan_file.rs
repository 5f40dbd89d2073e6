//! The file of a planned survey: a plain model of the wall, instruments, stations, and what else may measure.

use super::flights::{PlannedDrone, PlannedPhotos};
use super::values::{not_negative, positive};
use crate::error::{Error, Result};
use crate::files::read_toml;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::Path;
use stonewise_simulate::{BeamParams, StationPlace, WallParams};

/// A wall that is not surveyed yet, and what may survey it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurveyPlan {
    /// The wall, as the simulator builds it.
    pub wall: WallParams,
    /// How well stations are brought into one frame.
    #[serde(default)]
    pub registration: PlannedRegistration,
    /// Edge of the squares of which the weakest is looked for, metres.
    #[serde(default = "square_m")]
    pub square_m: f64,
    /// Instruments that stations name.
    #[serde(default)]
    pub instruments: Vec<PlannedInstrument>,
    /// Stations, those that are only candidates among them.
    #[serde(default)]
    pub stations: Vec<PlannedStation>,
    /// Lidar under a drone.
    #[serde(default)]
    pub drone: Option<PlannedDrone>,
    /// Photos that measure; without them, photos only show where the stones are.
    #[serde(default)]
    pub photos: Option<PlannedPhotos>,
    /// Stable targets.
    #[serde(default)]
    pub targets: Option<PlannedTargets>,
}

/// What the drone, the photos and the targets are called where one of them is added.
const NAMES: [&str; 3] = ["drone", "photos", "targets"];

fn square_m() -> f64 {
    1.0
}

/// How well stations are brought into one frame, one standard deviation per axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlannedRegistration {
    /// Shift of a station, metres.
    pub shift_m: f64,
    /// Rotation of a station about the part of the wall in front of it, radians.
    pub rotation_rad: f64,
}

impl Default for PlannedRegistration {
    fn default() -> Self {
        Self {
            shift_m: 0.0003,
            rotation_rad: 2e-5,
        }
    }
}

/// Stable targets, by which every survey is brought into the frame of the first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlannedTargets {
    /// Error of the frame of a survey that they leave, per axis, standard deviation, metres.
    pub error_m: f64,
    /// Whether they are one of those things that the survey may get in addition.
    #[serde(default)]
    pub candidate: bool,
}

/// A class of scanner; what is absent is that of a terrestrial scanner of 1.5 mm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlannedInstrument {
    /// What stations call it.
    pub name: String,
    /// Range noise at 10 m, square on, metres.
    pub range_noise_m: f64,
    /// Growth of the range noise beyond 10 m, metres per metre.
    pub range_noise_per_m: f64,
    /// Angle noise across the beam, radians.
    pub angle_noise_rad: f64,
    /// Diameter of the beam where it leaves the scanner, metres.
    pub spot_m: f64,
    /// Half angle by which the beam widens, radians.
    pub divergence_rad: f64,
    /// Angle between neighbouring beams, radians.
    pub step_rad: f64,
}

impl Default for PlannedInstrument {
    fn default() -> Self {
        let beam = BeamParams::terrestrial();
        Self {
            name: String::new(),
            range_noise_m: beam.range_noise_m,
            range_noise_per_m: beam.range_noise_per_m,
            angle_noise_rad: beam.pointing_noise_rad,
            spot_m: 2.0 * beam.exit_radius_m,
            divergence_rad: beam.divergence_rad,
            step_rad: StationPlace::default().step_rad,
        }
    }
}

/// A place from which the wall is or may be scanned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlannedStation {
    /// Its name.
    pub name: String,
    /// Place along the wall from its left end, for a viewer in front, metres.
    pub along_m: f64,
    /// Distance from the face, metres.
    pub distance_m: f64,
    /// Height of the scanner over ground, metres.
    #[serde(default = "height_m")]
    pub height_m: f64,
    /// How far to either side it scans, metres; 0 for all of the wall.
    #[serde(default)]
    pub reach_m: f64,
    /// Its instrument; absent: the first, or a terrestrial scanner of 1.5 mm where none is named.
    #[serde(default)]
    pub instrument: Option<String>,
    /// Whether the station is one of those that the survey may get in addition.
    #[serde(default)]
    pub candidate: bool,
}

fn height_m() -> f64 {
    StationPlace::default().height_m
}

impl SurveyPlan {
    /// Whether a file is a plan: it has a table `[wall]` and no `[project]`.
    pub fn is_in(path: &Path) -> bool {
        let text = std::fs::read_to_string(path).ok();
        let table = text.and_then(|text| text.parse::<toml::Table>().ok());
        table.is_some_and(|t| t.contains_key("wall") && !t.contains_key("project"))
    }

    /// Reads a plan.
    ///
    /// # Errors
    /// The file cannot be read, is no TOML, or holds a key that is not known or a value that cannot be; the error names the
    /// key and the fix.
    pub fn read(path: &Path) -> Result<Self> {
        let plan: Self = read_toml(path)?;
        plan.check()
            .map_err(|message| Error::Parameters(format!("{message}: {}", path.display())))?;
        Ok(plan)
    }

    fn check(&self) -> std::result::Result<(), String> {
        positive("square_m", self.square_m)?;
        not_negative("registration.shift_m", self.registration.shift_m)?;
        not_negative("registration.rotation_rad", self.registration.rotation_rad)?;
        let size_m = [self.wall.width_m, self.wall.height_m];
        self.drone.as_ref().map_or(Ok(()), |drone| drone.check(size_m))?;
        self.photos
            .as_ref()
            .map_or(Ok(()), |photos| photos.check(size_m))?;
        not_negative(
            "targets.error_m",
            self.targets.as_ref().map_or(0.0, |t| t.error_m),
        )?;
        for i in &self.instruments {
            let key = |name: &str| format!("{name} of instrument {:?}", i.name);
            positive(key("step_rad"), i.step_rad)?;
            for (name, value) in [
                ("range_noise_m", i.range_noise_m),
                ("range_noise_per_m", i.range_noise_per_m),
                ("angle_noise_rad", i.angle_noise_rad),
                ("spot_m", i.spot_m),
                ("divergence_rad", i.divergence_rad),
            ] {
                not_negative(key(name), value)?;
            }
        }
        let mut names = BTreeSet::new();
        for s in &self.stations {
            if !names.insert(&s.name) {
                return Err(format!("two stations are called {:?}: rename one", s.name));
            }
            if s.name.is_empty() || !s.name.chars().all(|c| c.is_alphanumeric() || "-_".contains(c)) {
                return Err(format!(
                    "station {:?}: results lie in a folder of this name; take letters, digits, - and _",
                    s.name
                ));
            }
            if NAMES.contains(&s.name.as_str()) {
                return Err(format!(
                    "station {:?}: results of the plan's {} have this name; rename the station",
                    s.name, s.name
                ));
            }
            let key = |name: &str| format!("{name} of station {:?}", s.name);
            positive(key("distance_m"), s.distance_m)?;
            not_negative(key("reach_m"), s.reach_m)?;
            if !(s.along_m.is_finite() && s.height_m.is_finite()) {
                return Err(format!("station {:?}: its place is no number", s.name));
            }
            if let Some(name) = &s.instrument
                && !self.instruments.iter().any(|i| i.name == *name)
            {
                return Err(format!(
                    "station {:?} names the instrument {name:?}, which no [[instruments]] describes",
                    s.name
                ));
            }
        }
        let planned = self.with(None);
        match planned.stations.is_empty() && planned.drone.is_none() {
            true => Err(
                "nothing scans the wall: at least one of the [[stations]] or the [drone] must not be a candidate"
                    .to_owned(),
            ),
            false => Ok(()),
        }
    }

    /// Names of what may be added: those of stations, and `drone`, `photos` and `targets`.
    pub fn candidates(&self) -> Vec<String> {
        let stations = self
            .stations
            .iter()
            .filter(|s| s.candidate)
            .map(|s| s.name.clone());
        let others = [
            self.drone.as_ref().is_some_and(|d| d.candidate),
            self.photos.as_ref().is_some_and(|p| p.candidate),
            self.targets.as_ref().is_some_and(|t| t.candidate),
        ];
        let others = NAMES.into_iter().zip(others).filter(|(_, candidate)| *candidate);
        let others = others.map(|(name, _)| name.to_owned());
        stations.chain(others).collect()
    }

    /// The plan reduced to what takes part: everything that is not a candidate, and the added candidate.
    pub fn with(&self, added: Option<&str>) -> Self {
        let is_in = |name: &str, candidate: bool| !candidate || added == Some(name);
        let mut plan = self.clone();
        plan.stations.retain(|s| is_in(&s.name, s.candidate));
        plan.stations.sort_by_key(|s| s.candidate);
        plan.drone = plan.drone.filter(|d| is_in(NAMES[0], d.candidate));
        plan.photos = plan.photos.filter(|p| is_in(NAMES[1], p.candidate));
        plan.targets = plan.targets.filter(|t| is_in(NAMES[2], t.candidate));
        plan
    }

    /// A station as the simulator places it.
    pub fn place(&self, station: &PlannedStation) -> StationPlace {
        let named = |i: &&PlannedInstrument| station.instrument.as_ref().is_none_or(|name| i.name == *name);
        let mut place = StationPlace {
            along_m: station.along_m - 0.5 * self.wall.width_m,
            distance_m: station.distance_m,
            height_m: station.height_m,
            reach_m: station.reach_m,
            ..StationPlace::default()
        };
        if let Some(instrument) = self.instruments.iter().find(named) {
            place.step_rad = instrument.step_rad;
            place.beam = BeamParams {
                range_noise_m: instrument.range_noise_m,
                range_noise_per_m: instrument.range_noise_per_m,
                pointing_noise_rad: instrument.angle_noise_rad,
                exit_radius_m: 0.5 * instrument.spot_m,
                divergence_rad: instrument.divergence_rad,
                ..BeamParams::terrestrial()
            };
        }
        place
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAN: &str = "
        [wall]
        width_m = 10.0
        [[instruments]]
        name = \"far\"
        spot_m = 0.01
        step_rad = 0.001
        [[stations]]
        name = \"A\"
        along_m = 2.0
        distance_m = 8.0
        [[stations]]
        name = \"B\"
        along_m = 9.0
        distance_m = 6.0
        candidate = true
    ";

    #[test]
    fn stations_count_from_the_left_end_and_take_the_first_instrument() {
        let plan: SurveyPlan = toml::from_str(PLAN).unwrap();
        plan.check().unwrap();
        let place = plan.place(&plan.stations[0]);
        assert_eq!((place.along_m, place.distance_m), (-3.0, 8.0));
        assert_eq!((place.step_rad, place.beam.exit_radius_m), (0.001, 0.005));
        assert_eq!(place.beam.range_noise_m, BeamParams::terrestrial().range_noise_m);
    }

    #[test]
    fn what_cannot_be_is_refused_by_its_name() {
        let refused = |from: &str, to: &str, named: &str| {
            let plan = toml::from_str::<SurveyPlan>(&PLAN.replace(from, to));
            let message = match plan {
                Ok(plan) => plan.check().unwrap_err(),
                Err(error) => error.to_string(),
            };
            assert!(message.contains(named), "{message}");
        };
        refused("\"B\"", "\"A\"", "\"A\": rename one");
        refused("\"A\"", "\"../A\"", "letters, digits");
        refused(
            "distance_m = 8.0",
            "distance_m = -8.0",
            "distance_m of station \"A\" = -8",
        );
        refused(
            "step_rad = 0.001",
            "step_rad = 0.0",
            "step_rad of instrument \"far\"",
        );
        refused("candidate", "instrument = \"near\"\ncandidate", "\"near\"");
        refused(
            "along_m = 2.0",
            "along_m = 2.0\ncandidate = true",
            "not be a candidate",
        );
        refused("spot_m", "dot_m", "dot_m");
        refused("\"B\"", "\"drone\"", "rename the station");
        let added = |table: &str, named: &str| refused("[wall]", &format!("{table}\n[wall]"), named);
        added("[drone]\nstrips = 0", "drone.strips = 0");
        added("[drone]\nspacing_m = 0.0", "drone.spacing_m");
        added("[drone]\ndatum_m = -0.001", "drone.datum_m");
        added("[photos]\ncolumns = 0", "photos.columns = 0");
        added("[photos]\nwidth_px = 8", "photos.width_px = 8");
        added("[photos]\nfocal_px = 240000.0", "photos.focal_px = 240000");
        added("[drone]\nspacing_m = 1e-5", "drone.spacing_m = 0.00001");
        added("[photos]\npose_error_px = nan", "photos.pose_error_px = NaN");
        added("[targets]\nerror_m = -1.0", "targets.error_m = -1");
        added("[targets]", "error_m");
    }

    #[test]
    fn a_plan_needs_something_that_scans_the_wall() {
        let check = |tables: &str| {
            toml::from_str::<SurveyPlan>(&format!("[wall]\n{tables}"))
                .unwrap()
                .check()
        };
        assert!(check("[photos]").unwrap_err().contains("nothing scans the wall"));
        assert!(check("[drone]\ncandidate = true").is_err());
        check("[drone]").unwrap();
    }

    #[test]
    fn a_candidate_follows_what_is_planned() {
        let others = "[drone]\ncandidate = true\n[photos]\n[targets]\nerror_m = 0.001\ncandidate = true\n";
        let mut plan: SurveyPlan = toml::from_str(&format!("{others}{PLAN}")).unwrap();
        plan.stations.rotate_left(1);
        assert_eq!(plan.candidates(), ["B", "drone", "targets"]);
        let taking_part = |added: Option<&str>| {
            let plan = plan.with(added);
            let names: Vec<String> = plan.stations.iter().map(|s| s.name.clone()).collect();
            (
                names.join(" "),
                [
                    plan.drone.is_some(),
                    plan.photos.is_some(),
                    plan.targets.is_some(),
                ],
            )
        };
        assert_eq!(taking_part(None), ("A".to_owned(), [false, true, false]));
        assert_eq!(taking_part(Some("B")), ("A B".to_owned(), [false, true, false]));
        assert_eq!(taking_part(Some("drone")), ("A".to_owned(), [true, true, false]));
        assert_eq!(
            taking_part(Some("targets")),
            ("A".to_owned(), [false, true, true])
        );
    }
}
