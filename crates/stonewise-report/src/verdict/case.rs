//! What the verdict is drawn from.

use super::interval::Estimate;
use super::judged::Compared;
use nalgebra::Point2;
use stonewise_base::thresholds::{Quantity, Thresholds};
use stonewise_results::records::{DatumState, DeformationVerdict};

/// What is known of one pair of epochs.
#[derive(Clone, Debug, Default)]
pub(crate) struct Case {
    /// Names of the first and of the later epoch.
    pub epochs: [String; 2],
    /// What the registration is known from.
    pub datum: Option<DatumState>,
    /// The estimate stopped before it settled.
    pub not_converged: bool,
    /// There is a doubt about the run as a whole.
    pub in_doubt: bool,
    /// What is known of time.
    pub time: TimeCase,
    /// The stones of the first epoch.
    pub stones: Vec<StoneCase>,
    /// The joints whose stones were both measured.
    pub joints: Vec<JointCase>,
    /// Whether and where the wall changed its shape, where that was asked; states of its zones are left open.
    pub deformation: Option<DeformationVerdict>,
}

/// What is known of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum TimeCase {
    /// There are two epochs, so many years apart; `None` where a date is missing.
    Pair(Option<f64>),
    /// The pair of the newest epoch of a series, with which velocities and departures are judged.
    Newest,
    /// The pair of another epoch.
    Earlier,
}

impl Default for TimeCase {
    fn default() -> Self {
        Self::Pair(None)
    }
}

/// What is known of a stone.
#[derive(Clone, Debug, Default)]
pub(crate) struct StoneCase {
    pub stone_id: u32,
    /// Place (along, up) in the facade frame, metres.
    pub place: Point2<f64>,
    /// The first epoch shows it well, and the later one shows its place without it.
    pub lost: bool,
    /// It is a stone of the wall, not a field of a door.
    pub is_masonry: bool,
    /// What was measured.
    pub measured: Option<StoneMeasured>,
    /// Its velocity in a series, millimetres a year.
    pub rate: Option<Compared>,
    /// The departure of the newest epoch from what a series predicts, standard deviations.
    pub departure: Option<Compared>,
}

/// The measured motion of a stone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StoneMeasured {
    /// The motion that is tested, see the stone table, as (along, up, out).
    pub motion: Estimate,
    /// The motion against the neighbours.
    pub neighbours: Estimate,
    pub above_limit: bool,
    pub loose: bool,
    /// It belongs to the largest part of the wall, which was tested for a change of shape.
    pub shape_tested: bool,
    pub detection_limit_m: f64,
}

/// What is known of a joint.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointCase {
    pub stones: [u32; 2],
    /// Its middle (along, up) in the facade frame, metres.
    pub place: Point2<f64>,
    pub opening_m: f64,
    pub sigma_m: f64,
}

impl Case {
    /// Whether the results can be relied on as a whole.
    pub(super) fn is_sound(&self) -> bool {
        !self.not_converged && !self.in_doubt
    }

    /// Whether a significant motion of this stone may be reported as moved. Where the registration error is unknown,
    /// this needs a change of the wall's shape or a loose stone, provided that the shape was tested around the stone.
    pub(super) fn may_have_moved(&self, stone: &StoneMeasured) -> bool {
        let shape_kept = self.deformation.as_ref().is_some_and(|found| !found.shown);
        let stays = shape_kept && stone.shape_tested && !stone.loose;
        self.has_datum() || !stays
    }

    /// Whether a motion of the wall as a whole would reach thresholds of this zone, or of the wall outside all zones.
    pub(super) fn needs_datum(&self, thresholds: &Thresholds, zone: Option<usize>) -> bool {
        use Quantity as Q;
        let of_pair = matches!(self.time, TimeCase::Pair(_)).then_some(Q::Rate);
        let mut absolute = [Q::Length, Q::Out, Q::Up, Q::Along].into_iter().chain(of_pair);
        thresholds.is_empty() || absolute.any(|q| thresholds.of(q, zone).next().is_some())
    }

    /// Whether intervals hold the registration error, so that they say something about the wall as a whole.
    pub(super) fn has_datum(&self) -> bool {
        self.datum.is_some_and(|d| d != DatumState::Unknown)
    }
}
