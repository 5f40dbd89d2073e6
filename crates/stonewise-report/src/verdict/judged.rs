//! Stones and joints with their states, and where their intervals lie among the thresholds.

use stonewise_base::thresholds::{Level, Quantity, Threshold, Thresholds};
use stonewise_results::records::{
    Decision, DeformationVerdict, DeformedZone, JointVerdict, State, StoneVerdict,
};

/// Share of false ones that is accepted among the stones said to have moved.
pub(super) const FALSE_DISCOVERY_RATE: f64 = 0.05;

/// All stones and joints with their states.
#[derive(Clone, Debug)]
pub(super) struct Judged {
    pub stones: Vec<JudgedStone>,
    pub joints: Vec<JudgedJoint>,
    pub deformation: Option<DeformationVerdict>,
    /// Of every stone, joint and zone of deformation the quantities that have thresholds.
    pub findings: Vec<Finding>,
}

impl Judged {
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

    /// Findings of a zone, or all.
    pub(super) fn findings_in(&self, zone: Option<usize>) -> impl Iterator<Item = &Finding> + Clone {
        self.findings
            .iter()
            .filter(move |f| zone.is_none() || f.zone == zone)
    }
}

/// A stone with its state.
#[derive(Clone, Debug)]
pub(super) struct JudgedStone {
    pub verdict: StoneVerdict,
    pub zone: Option<usize>,
    pub detection_limit_m: Option<f64>,
    /// Whether it lies beyond an alarm threshold, whether the run is sound or not.
    pub apparent_alarm: bool,
    /// Whether an interval reaches a threshold of attention and does not lie beyond it.
    pub reaches: bool,
}

/// A joint with its state.
#[derive(Clone, Copy, Debug)]
pub(super) struct JudgedJoint {
    pub verdict: JointVerdict,
    pub zone: Option<usize>,
    pub opened: bool,
    /// Whether its interval reaches a threshold.
    pub reaches: bool,
}

/// What is compared with the thresholds of a quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Compared {
    /// 95 % interval, in the unit of the quantity.
    pub interval: [f64; 2],
    /// Whether it moved at all, with the false discovery rate controlled.
    pub moved: bool,
}

/// Where an interval lies among the thresholds of its quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Outcome {
    /// Below the threshold of attention as a whole.
    Below,
    /// What is to be compared is not known.
    NotJudged,
    /// It reaches the threshold of attention, and does not lie beyond it.
    Reaches,
    /// Beyond a threshold, of something that moved.
    Beyond(Level),
}

impl Outcome {
    /// The state that follows.
    pub(super) fn state(self) -> State {
        match self {
            Self::Below => State::Fine,
            Self::NotJudged | Self::Reaches => State::CannotTell,
            Self::Beyond(Level::Attention) => State::Attention,
            Self::Beyond(Level::Alarm) => State::Alarm,
        }
    }
}

/// Where a quantity lies among its thresholds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Finding {
    pub quantity: Quantity,
    /// Zone of the stone or joint.
    pub zone: Option<usize>,
    pub outcome: Outcome,
    /// The threshold that gives the outcome.
    pub threshold: Threshold,
    interval: Option<[f64; 2]>,
}

impl Finding {
    /// Compares with all thresholds of a quantity in a zone; `None` where it has none. `compared`: `None` where nothing is
    /// known.
    pub(super) fn of(
        quantity: Quantity,
        zone: Option<usize>,
        compared: Option<Compared>,
        thresholds: &Thresholds,
    ) -> Option<Self> {
        let one = |threshold: Threshold| Self {
            quantity,
            zone,
            outcome: compared.map_or(Outcome::NotJudged, |c| outcome(&threshold, &c)),
            threshold,
            interval: compared.map(|c| c.interval),
        };
        // Of thresholds with the same outcome the first, which is that of attention.
        let worse = |a: Self, b: Self| if b.outcome > a.outcome { b } else { a };
        thresholds.of(quantity, zone).map(one).reduce(worse)
    }

    /// The threshold that decides a state which follows from this, and what was compared.
    pub(super) fn decision(&self) -> Option<Decision> {
        let interval = self.interval.filter(|i| i.iter().all(|v| v.is_finite()));
        (self.outcome != Outcome::Below).then(|| Decision {
            threshold: self.threshold,
            interval: interval.map(|i| i.map(to_thousandth)),
        })
    }
}

/// Where an interval lies at one threshold.
fn outcome(threshold: &Threshold, compared: &Compared) -> Outcome {
    let [low, high] = compared.interval;
    let limit = threshold.limit.abs();
    let [low, high] = match threshold.limit < 0.0 {
        true => [-high, -low],
        false => [low, high],
    };
    if compared.moved && low > limit {
        Outcome::Beyond(threshold.level)
    } else if high < limit {
        Outcome::Below
    } else {
        Outcome::Reaches
    }
}

/// Metres as millimetres, to a micrometre.
pub(super) fn millimetres(metres: f64) -> f64 {
    to_thousandth(1e3 * metres)
}

fn to_thousandth(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}
