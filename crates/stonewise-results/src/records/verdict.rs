//! `verdict.json`: the state of the wall, its zones and its stones, with the numbers behind it.

use super::DatumState;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;
use stonewise_base::thresholds::{Quantity, Threshold, Thresholds};
use stonewise_core::registration::{Against, ZoneKind};
use stonewise_core::series::Answer;

/// Version of the file's layout.
pub const VERDICT_VERSION: u32 = 1;

/// State of a wall, a zone or a stone, from the best to the worst.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum State {
    /// Nothing reaches the threshold of attention; without thresholds: no motion is shown.
    #[serde(rename = "fine")]
    Fine,
    /// The results cannot tell.
    #[default]
    #[serde(rename = "cannot tell")]
    CannotTell,
    /// A motion lies beyond the threshold of attention, or stones are lost; without thresholds: motion is
    /// shown.
    #[serde(rename = "attention")]
    Attention,
    /// A motion lies beyond the alarm threshold.
    #[serde(rename = "alarm")]
    Alarm,
}

impl State {
    /// Every state, the worst first.
    pub const WORST_FIRST: [Self; 4] = [Self::Alarm, Self::Attention, Self::CannotTell, Self::Fine];

    /// The word in files.
    pub fn word(self) -> &'static str {
        match self {
            Self::Fine => "fine",
            Self::CannotTell => "cannot tell",
            Self::Attention => "attention",
            Self::Alarm => "alarm",
        }
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

/// The verdict of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// Version of the file's layout.
    pub version: u32,
    /// The worst of the states of all later epochs: alarm, attention, cannot tell, fine.
    pub state: State,
    /// The sentence of that epoch.
    pub sentence: String,
    /// The thresholds that were applied.
    pub thresholds: Thresholds,
    /// Every later epoch against the first, in time order.
    pub epochs: Vec<EpochVerdict>,
    /// What the path over all epochs means; absent with two epochs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub series: Option<SeriesVerdict>,
}

/// The four answers of a series.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SeriesVerdict {
    /// All in one sentence.
    pub sentence: String,
    /// Whether the newest epoch is as the others predict it under its conditions.
    pub as_predicted: AnswerVerdict,
    /// Whether the newest epoch continues the mean course of the earlier ones.
    pub as_in_the_past: AnswerVerdict,
    /// Whether stones move in proportion to time.
    pub trend: AnswerVerdict,
    /// Whether stones moved abruptly.
    pub anomaly: AnswerVerdict,
}

/// An answer in words and numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AnswerVerdict {
    /// For people, in the language of the report.
    pub text: String,
    /// For programs.
    #[serde(flatten)]
    pub answer: Answer,
}

/// The verdict in a word and a sentence, as `run.json` holds it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Headline {
    /// The state of the wall.
    pub state: State,
    /// The verdict in a sentence, with the most important numbers.
    pub sentence: String,
}

/// Headlines of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Headlines {
    /// The worst of all later epochs.
    #[serde(flatten)]
    pub worst: Headline,
    /// Each later epoch by its name.
    pub epochs: BTreeMap<String, Headline>,
}

/// The verdict on one later epoch against the first.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EpochVerdict {
    /// Name of the later epoch.
    pub epoch: String,
    /// Name of the epoch that motions count from.
    pub reference: String,
    /// What the registration of the epoch is known from; absent where nothing was registered.
    pub datum: Option<DatumState>,
    /// State of the wall.
    pub state: State,
    /// The verdict in one sentence.
    pub sentence: String,
    /// Why the wall has this state, the most important first.
    pub reasons: Vec<Reason>,
    /// Numbers of the wall.
    pub wall: Area,
    /// Zones with their numbers, in the order of the project file.
    pub zones: Vec<ZoneVerdict>,
    /// Every stone of the first epoch.
    pub stones: Vec<StoneVerdict>,
    /// Whether and where the wall changed its shape; null where that was not asked, as with the estimator `gicp`.
    #[serde(default)]
    pub deformation: Option<DeformationVerdict>,
    /// Joints that opened, closed or may have opened beyond a threshold; empty where no joint has a
    /// threshold.
    pub joints: Vec<JointVerdict>,
}

impl EpochVerdict {
    /// Whether the registration error of the epoch is known; without, lengths are those against the common
    /// motion of the measured stones.
    pub fn has_datum(&self) -> bool {
        self.datum.is_some_and(|d| d != DatumState::Unknown)
    }

    /// Whether the results as a whole can be relied on. If not, it is unknown which stones moved or are loose, and the
    /// counts of such stones are only what was computed.
    pub fn is_sound(&self) -> bool {
        !self
            .reasons
            .iter()
            .any(|r| matches!(r.code, ReasonCode::NotConverged | ReasonCode::InDoubt))
    }
}

/// Why something has its state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reason {
    /// For programs.
    pub code: ReasonCode,
    /// For people, in the language of the report.
    pub text: String,
}

/// Reasons, for programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum ReasonCode {
    /// The adjustment did not converge.
    NotConverged,
    /// The results as a whole are in doubt for another reason.
    InDoubt,
    /// Something lies beyond an alarm threshold of this quantity.
    Alarm(Quantity),
    /// Something lies beyond a threshold of attention of this quantity.
    Attention(Quantity),
    /// Stones that the first epoch shows well are missing in the later one.
    StonesLost,
    /// Motion is shown, and there are no thresholds.
    MotionShown,
    /// A deformation is shown, and there are no thresholds.
    DeformationShown,
    /// No stone, or no stone of the zone, was measured.
    NothingMeasured,
    /// Fewer than half of the stones were measured.
    FewMeasured,
    /// The registration error of the epochs is unknown, and a motion of the wall as a whole would matter.
    DatumUnknown,
    /// A quantity has thresholds, and what is to be compared with them is known of fewer than half of the stones.
    NotJudged(Quantity),
    /// An interval reaches the threshold of attention without lying beyond it.
    IntervalReachesThreshold,
    /// The interval of a deformation reaches the threshold of attention without lying beyond it.
    DeformationReachesThreshold,
    /// No interval reaches the threshold of attention.
    BelowThresholds,
    /// No motion is shown, and there are no thresholds.
    NoMotionShown,
}

impl ReasonCode {
    /// Every code that there is.
    pub fn all() -> Vec<Self> {
        let plain = [
            Self::NotConverged,
            Self::InDoubt,
            Self::StonesLost,
            Self::MotionShown,
            Self::DeformationShown,
            Self::NothingMeasured,
            Self::FewMeasured,
            Self::DatumUnknown,
            Self::IntervalReachesThreshold,
            Self::DeformationReachesThreshold,
            Self::BelowThresholds,
            Self::NoMotionShown,
            Self::NotJudged(Quantity::Rate),
            Self::NotJudged(Quantity::Departure),
        ];
        let beyond = Quantity::ALL
            .into_iter()
            .flat_map(|q| [Self::Alarm(q), Self::Attention(q)]);
        plain.into_iter().chain(beyond).collect()
    }
}

impl From<ReasonCode> for String {
    fn from(code: ReasonCode) -> Self {
        use ReasonCode as R;
        let plain = match code {
            R::Alarm(quantity) => return format!("{}_alarm", quantity.word()),
            R::Attention(quantity) => return format!("{}_attention", quantity.word()),
            R::NotJudged(quantity) => return format!("{}_not_judged", quantity.word()),
            R::NotConverged => "not_converged",
            R::InDoubt => "in_doubt",
            R::StonesLost => "stones_lost",
            R::MotionShown => "motion_shown",
            R::DeformationShown => "deformation_shown",
            R::NothingMeasured => "nothing_measured",
            R::FewMeasured => "few_measured",
            R::DatumUnknown => "datum_unknown",
            R::IntervalReachesThreshold => "interval_reaches_threshold",
            R::DeformationReachesThreshold => "deformation_reaches_threshold",
            R::BelowThresholds => "below_thresholds",
            R::NoMotionShown => "no_motion_shown",
        };
        plain.to_owned()
    }
}

impl TryFrom<String> for ReasonCode {
    type Error = String;

    fn try_from(word: String) -> Result<Self, String> {
        let found = Self::all().into_iter().find(|code| String::from(*code) == word);
        found.ok_or_else(|| format!("{word:?} is no reason of a verdict"))
    }
}

/// The threshold that decided a state, and what was compared with it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// The threshold.
    #[serde(flatten)]
    pub threshold: Threshold,
    /// The 95 % interval of what it limits, in the unit of the limit; null where that is not known.
    pub interval: Option<[f64; 2]>,
}

/// Numbers of the wall or of a zone. Lengths are millimetres.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Area {
    /// Its state.
    pub state: State,
    /// Why, the most important first.
    pub reasons: Vec<ReasonCode>,
    /// The threshold that decided the state; null where something else did, and where no threshold is reached.
    #[serde(default)]
    pub decided_by: Option<Decision>,
    /// Stones of the first epoch in it.
    pub stones: usize,
    /// Stones that were measured.
    pub measured: usize,
    /// Measured stones above their own 95 % limit, of which chance alone gives 5 % on a still wall.
    pub above_limit: usize,
    /// Stones that moved: with the false discovery rate over all stones of the wall controlled at 5 %. Of a
    /// run that is in doubt, like all numbers here, only what was computed.
    pub moved: usize,
    /// Stones that move unlike their neighbours, with the false discovery rate controlled.
    pub loose: usize,
    /// Stones that the first epoch shows well and the later one does not have.
    pub lost: usize,
    /// Number of stones by state.
    pub by_state: BTreeMap<String, usize>,
    /// Smallest q value of a stone.
    pub smallest_q: Option<f64>,
    /// The largest motion of a stone that moved.
    pub largest: Option<Largest>,
    /// The largest motion against the neighbours of a loose stone.
    pub largest_against_neighbours: Option<Largest>,
    /// The joint that opened most among those that opened significantly.
    pub largest_opening: Option<JointVerdict>,
    /// Detection limits of the measured stones.
    pub detection_limit: Option<DetectionLimit>,
}

/// A length with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Largest {
    /// The stone.
    pub stone_id: u32,
    /// The length, millimetres.
    pub length_mm: f64,
    /// Its 95 % interval, millimetres.
    pub interval_mm: [f64; 2],
}

/// Order statistics of the detection limits, millimetres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DetectionLimit {
    /// Half of the stones have a smaller limit.
    pub median_mm: f64,
    /// Nine tenths of the stones have a smaller limit.
    pub percentile_90_mm: f64,
}

/// A zone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ZoneVerdict {
    /// Its name.
    pub name: String,
    /// Its numbers.
    #[serde(flatten)]
    pub area: Area,
}

/// A stone. Lengths are millimetres; what was not measured is null.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StoneVerdict {
    /// Stone of the first epoch.
    pub stone_id: u32,
    /// The zone that it lies in; null outside all zones.
    pub zone: Option<String>,
    /// Its state.
    pub state: State,
    /// The threshold that decided the state; null where something else did, and where no threshold is reached.
    #[serde(default)]
    pub decided_by: Option<Decision>,
    /// Whether it moved, with the false discovery rate over all stones of the wall controlled at 5 %.
    pub moved: bool,
    /// Whether its motion is above its own 95 % limit (`significant` in the stone table).
    pub above_limit: bool,
    /// Whether it moves unlike its neighbours.
    pub loose: bool,
    /// Whether the first epoch shows it well and the later one does not have it.
    pub lost: bool,
    /// The smallest false discovery rate at which it counts as moved.
    pub q: Option<f64>,
    /// Length of the motion: absolute, or against the common motion of the wall where the datum is unknown.
    pub length_mm: Option<f64>,
    /// 95 % interval of the true length; null where the covariance allows none.
    pub interval_mm: Option<[f64; 2]>,
    /// Length of the motion against the neighbours.
    pub neighbours_mm: Option<f64>,
    /// 95 % interval of its true length.
    pub neighbours_interval_mm: Option<[f64; 2]>,
}

/// Whether and where the wall changed its shape. Lengths are millimetres.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DeformationVerdict {
    /// Whether a deformation is shown.
    pub shown: bool,
    /// Probability of so large a deformation on a wall that moved as one rigid body; null where no part of the wall has
    /// stones enough.
    pub p: Option<f64>,
    /// The largest deformation of a zone.
    pub largest_mm: Option<f64>,
    /// Its 95 % interval.
    pub interval_mm: Option<[f64; 2]>,
    /// Bulge out of the wall that is found in 95 of 100 cases, of a zone of 1, 3 and 10 m; null where the wall is smaller.
    pub detection_limit_mm: [Option<f64>; 3],
    /// Motion of a zone of 1, 3 and 10 m in the face that is found in 95 of 100 cases, along the wall or up, whichever
    /// is found worse; null where the wall is smaller.
    #[serde(default)]
    pub detection_limit_in_face_mm: [Option<f64>; 3],
    /// The zones, the one of the largest deformation first.
    pub zones: Vec<DeformedZone>,
}

/// A zone of deformation: the part of the wall that moved by more than half of a peak.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeformedZone {
    /// Number of the zone, as in the stone table.
    pub zone_id: u32,
    /// State by its interval.
    pub state: State,
    /// The threshold that decided the state; null where something else did, and where no threshold is reached.
    #[serde(default)]
    pub decided_by: Option<Decision>,
    /// What it resembles.
    pub kind: ZoneKind,
    /// What its motion counts from.
    pub against: Against,
    /// Middle along the unrolled wall, metres.
    pub along_m: f64,
    /// Middle up the unrolled wall, metres.
    pub up_m: f64,
    /// Diameter, metres; null unless it is round.
    pub diameter_m: Option<f64>,
    /// Longer extent of the part, metres.
    pub length_m: f64,
    /// Shorter extent of the part, metres.
    pub width_m: f64,
    /// Area of the faces of its stones.
    pub area_m2: f64,
    /// Mean deformation along the wall, up and out.
    pub mean_mm: [f64; 3],
    /// Largest deformation of a stone.
    pub largest_mm: f64,
    /// Its 95 % interval.
    pub interval_mm: [f64; 2],
}

/// A joint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointVerdict {
    /// The stones on its two sides.
    pub stones: [u32; 2],
    /// Its state.
    pub state: State,
    /// The threshold that decided the state; null where something else did, and where no threshold is reached.
    #[serde(default)]
    pub decided_by: Option<Decision>,
    /// Opening, millimetres; negative: it closes.
    pub opening_mm: f64,
    /// Its 95 % interval.
    pub interval_mm: [f64; 2],
    /// The smallest false discovery rate at which it counts as opened or closed.
    pub q: f64,
}

impl Verdict {
    /// The verdict on these epochs.
    pub fn new(thresholds: &Thresholds, epochs: Vec<EpochVerdict>) -> Self {
        // Of equal states, the sentence is that of the newest epoch.
        let worst = epochs.iter().max_by_key(|e| e.state);
        Self {
            version: VERDICT_VERSION,
            state: worst.map_or(State::CannotTell, |e| e.state),
            sentence: worst.map_or(String::new(), |e| e.sentence.clone()),
            thresholds: thresholds.clone(),
            epochs,
            series: None,
        }
    }

    /// The verdict with the answers of a series.
    #[must_use]
    pub fn with_series(self, series: Option<SeriesVerdict>) -> Self {
        Self { series, ..self }
    }

    /// State and sentence of the run and of every later epoch.
    pub fn headlines(&self) -> Headlines {
        let headline = |e: &EpochVerdict| Headline {
            state: e.state,
            sentence: e.sentence.clone(),
        };
        Headlines {
            worst: Headline {
                state: self.state,
                sentence: self.sentence.clone(),
            },
            epochs: self
                .epochs
                .iter()
                .map(|e| (e.epoch.clone(), headline(e)))
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;
    use std::collections::BTreeSet;
    use stonewise_base::thresholds::Level;

    fn keys(object: &Value) -> BTreeSet<String> {
        object.as_object().unwrap().keys().cloned().collect()
    }

    fn words(list: &Value) -> BTreeSet<String> {
        list.as_array()
            .unwrap()
            .iter()
            .filter_map(|v| Some(v.as_str()?.to_owned()))
            .collect()
    }

    /// A verdict in which nothing is missing.
    fn sample() -> Verdict {
        let joint = JointVerdict {
            stones: [1, 2],
            state: State::Fine,
            decided_by: None,
            opening_mm: 1.0,
            interval_mm: [0.5, 1.5],
            q: 0.01,
        };
        let largest = Largest {
            stone_id: 1,
            length_mm: 2.0,
            interval_mm: [1.0, 3.0],
        };
        let area = Area {
            reasons: vec![ReasonCode::Alarm(Quantity::Length)],
            decided_by: Some(Decision {
                threshold: Threshold {
                    quantity: Quantity::Length,
                    level: Level::Alarm,
                    limit: 10.0,
                },
                interval: Some([27.9, 28.9]),
            }),
            largest: Some(largest),
            largest_opening: Some(joint),
            detection_limit: Some(DetectionLimit {
                median_mm: 0.2,
                percentile_90_mm: 0.3,
            }),
            ..Area::default()
        };
        let epoch = EpochVerdict {
            reasons: vec![Reason {
                code: ReasonCode::Alarm(Quantity::Length),
                text: "moved".to_owned(),
            }],
            wall: area.clone(),
            zones: vec![ZoneVerdict {
                name: "crest".to_owned(),
                area,
            }],
            stones: vec![StoneVerdict::default()],
            joints: vec![joint],
            deformation: Some(DeformationVerdict {
                zones: vec![DeformedZone {
                    zone_id: 1,
                    state: State::Alarm,
                    decided_by: None,
                    kind: ZoneKind::Bulge,
                    along_m: 1.0,
                    up_m: 2.0,
                    against: Against::RestOfWall,
                    diameter_m: Some(1.4),
                    length_m: 1.5,
                    width_m: 1.3,
                    area_m2: 1.5,
                    mean_mm: [0.0, 0.0, 2.0],
                    largest_mm: 3.0,
                    interval_mm: [2.0, 4.0],
                }],
                ..DeformationVerdict::default()
            }),
            ..EpochVerdict::default()
        };
        Verdict::new(&Thresholds::default(), vec![epoch]).with_series(Some(SeriesVerdict::default()))
    }

    #[test]
    fn the_schema_in_the_docs_names_every_key_and_word() {
        let schema: Value =
            serde_json::from_str(include_str!("../../../../docs/src/verdict.schema.json")).unwrap();
        let of = |name: &str| schema["$defs"][name].clone();
        let verdict = serde_json::to_value(sample()).unwrap();
        let epoch = &verdict["epochs"][0];
        let checks = [
            (of("epoch"), epoch),
            (of("series"), &verdict["series"]),
            (of("answer"), &verdict["series"]["trend"]),
            (of("area"), &epoch["wall"]),
            (of("stone"), &epoch["stones"][0]),
            (of("joint"), &epoch["joints"][0]),
            (of("largest"), &epoch["wall"]["largest"]),
            (of("decision"), &epoch["wall"]["decided_by"]),
            (of("deformation"), &epoch["deformation"]),
            (of("deformed_zone"), &epoch["deformation"]["zones"][0]),
        ];
        // Only a series has its answers.
        let mut required = words(&schema["required"]);
        required.insert("series".to_owned());
        assert_eq!(required, keys(&verdict));
        assert_eq!(keys(&schema["properties"]), keys(&verdict));
        for (schema, value) in checks {
            assert_eq!(keys(&schema["properties"]), keys(value));
            assert_eq!(words(&schema["required"]), keys(value));
        }
        let states = State::WORST_FIRST.map(|s| serde_json::to_value(s).unwrap());
        assert_eq!(words(&of("state")["enum"]), words(&Value::from(states.to_vec())));
        let codes = ReasonCode::all().into_iter().map(String::from);
        assert_eq!(words(&of("code")["enum"]), codes.collect());
        let quantities = Quantity::ALL.map(|q| serde_json::to_value(q).unwrap());
        assert_eq!(
            words(&of("decision")["properties"]["quantity"]["enum"]),
            words(&Value::from(quantities.to_vec()))
        );
    }

    #[test]
    fn the_worst_epoch_speaks_and_of_equals_the_newest() {
        let epoch = |name: &str, state| EpochVerdict {
            epoch: name.to_owned(),
            sentence: name.to_owned(),
            state,
            ..EpochVerdict::default()
        };
        let of = |states: &[State]| {
            let epochs = states
                .iter()
                .zip(["B", "C", "D"])
                .map(|(s, name)| epoch(name, *s));
            Verdict::new(&Thresholds::default(), epochs.collect())
        };
        let verdict = of(&[State::Alarm, State::Alarm, State::Fine]);
        assert_eq!((verdict.state, verdict.sentence.as_str()), (State::Alarm, "C"));
        assert_eq!(verdict.headlines().epochs["D"].state, State::Fine);
        assert_eq!(of(&[State::Fine, State::CannotTell]).state, State::CannotTell);
        assert_eq!(of(&[State::CannotTell, State::Attention]).state, State::Attention);
        assert_eq!(of(&[]).state, State::CannotTell);
    }

    #[test]
    fn it_comes_back_as_it_was_written() {
        let text = serde_json::to_string(&sample()).unwrap();
        assert_eq!(serde_json::from_str::<Verdict>(&text).unwrap(), sample());
    }
}
