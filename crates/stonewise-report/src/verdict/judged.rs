//! Stones and joints with their states, and where their intervals lie among the thresholds.

use stonewise_base::thresholds::{Levels, Thresholds};
use stonewise_results::records::{DeformationVerdict, DeformedZone, JointVerdict, StoneVerdict};

/// All stones and joints with their states.
#[derive(Clone, Debug)]
pub(super) struct Judged {
    pub stones: Vec<JudgedStone>,
    pub joints: Vec<JudgedJoint>,
    pub deformation: Option<DeformationVerdict>,
}

impl Judged {
    /// Stones beyond an alarm threshold, whether the run is sound or not.
    pub(super) fn apparent_alarms(&self) -> usize {
        let beyond = |s: &&JudgedStone| s.length.max(s.neighbours) == Level::Alarm;
        self.stones.iter().filter(beyond).count()
    }

    /// Zones of deformation.
    pub(super) fn deformed_zones(&self) -> &[DeformedZone] {
        self.deformation.as_ref().map_or(&[], |d| &d.zones)
    }

    /// Stones of a zone, or all.
    pub(super) fn stones_in(&self, zone: Option<usize>) -> impl Iterator<Item = &JudgedStone> + Clone {
        self.stones
            .iter()
            .filter(move |s| zone.is_none() || s.zone == zone)
    }

    /// Joints of a zone, or all.
    pub(super) fn joints_in(&self, zone: Option<usize>) -> impl Iterator<Item = &JudgedJoint> + Clone {
        self.joints
            .iter()
            .filter(move |j| zone.is_none() || j.zone == zone)
    }
}

/// A stone with its state, and why.
#[derive(Clone, Debug)]
pub(super) struct JudgedStone {
    pub verdict: StoneVerdict,
    pub zone: Option<usize>,
    pub length: Level,
    pub neighbours: Level,
    pub detection_limit_m: Option<f64>,
}

/// A joint with its state, and why.
#[derive(Clone, Copy, Debug)]
pub(super) struct JudgedJoint {
    pub verdict: JointVerdict,
    pub zone: Option<usize>,
    pub opening: Level,
    pub opened: bool,
}

/// Where an interval lies among the thresholds of its quantity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Level {
    /// No threshold is given.
    #[default]
    NotAsked,
    /// Below the threshold of attention as a whole.
    Below,
    /// It reaches the threshold of attention, and does not lie beyond it.
    Reaches,
    /// Beyond the threshold of attention, of something that moved.
    Attention,
    /// Beyond the alarm threshold, of something that moved.
    Alarm,
}

impl Level {
    /// Where an interval lies; `moved`: whether what was measured moved at all.
    pub(super) fn of(interval_m: [f64; 2], moved: bool, levels: &Levels) -> Self {
        let [low, high] = interval_m;
        let Some(attention) = levels.attention_m() else {
            return Self::NotAsked;
        };
        let beyond = |threshold: Option<f64>| moved && threshold.is_some_and(|t| low > t);
        if beyond(levels.alarm_m()) {
            Self::Alarm
        } else if beyond(Some(attention)) {
            Self::Attention
        } else if high < attention {
            Self::Below
        } else {
            Self::Reaches
        }
    }
}

/// Where the deformation of a zone lies among the thresholds.
pub(super) fn deformed(zone: &DeformedZone, thresholds: &Thresholds) -> Level {
    Level::of(
        zone.interval_mm.map(|mm| mm / 1e3),
        true,
        &thresholds.of_deformation(),
    )
}

/// Metres as millimetres, to a micrometre.
pub(super) fn millimetres(metres: f64) -> f64 {
    (metres * 1e6).round() / 1e3
}
