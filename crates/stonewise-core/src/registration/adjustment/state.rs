//! The state of the adjustment between iterations.

use super::candidate::{CandidateMotion, Moving};
use super::field::{LoosePrior, MotionPrior, Place};
use super::observation::photo::PhotoModel;
use super::observation::surface::{Layout, StoneSurface, SurfaceModel};
use super::params::AdjustmentParams;
use super::partial_view::expected_rate;
use super::stone_vector::StoneVector;
use super::survey::{StoneInfo, smoothed_shifts};
use crate::geometry::SmallMotion;
use crate::statistics::component_median;
use nalgebra::Vector3;

/// Largest prior probability that a stone appears not to move with the field: its observations decide.
const MOST_LEAVING: f64 = 0.5;

/// All stones, what is assumed of their motions, and the models under which they are observed.
pub(crate) struct Adjustment {
    /// In the order of the source; one per node of the prior's graph.
    pub stones: Vec<StoneState>,
    pub prior: MotionPrior,
    pub surface: SurfaceModel,
    /// What photos show of the stones, where they are used.
    pub photos: Option<PhotoModel>,
    /// How often the clouds show stones at a wrong place, see [`Self::wrong_share`].
    pub wrong_rate: f64,
    pub params: AdjustmentParams,
}

/// A stone between iterations.
pub(crate) struct StoneState {
    pub info: StoneInfo,
    /// Where the centroids of its neighbours' masks and its own put it beforehand, in its frame, metres.
    pub start: Vector3<f64>,
    /// Moving with the field.
    pub with_field: CandidateMotion,
    /// Moving on its own, where that is followed.
    pub on_own: Option<CandidateMotion>,
    /// Log likelihood of the stone's own motion less that of the field's, on the same points; 0 where its own is not
    /// followed.
    pub log_ratio: f64,
    /// Probability that the stone moves with the field.
    pub p_with_field: f64,
    /// Probability that the clouds show it at a wrong place, if they show it away from its neighbours.
    pub doubt: f64,
    /// Whether its observations tell a loose stone from one that moves with the field.
    pub decides: bool,
    /// Whether its last step exceeded a tenth of the uncertainty of its motion; not where the adjustment has settled.
    pub moves: bool,
    /// Effective degrees of freedom: how many unknowns the stone's own points determine.
    pub effective_freedom: f64,
}

impl Adjustment {
    /// Every stone moves as its neighbours' centroids did, with the field; ties are whole. `spacing_m`: of the
    /// points. `None` where memory does not suffice.
    pub fn new(stones: Vec<StoneInfo>, spacing_m: f64, params: &AdjustmentParams) -> Option<Self> {
        let places: Vec<Place> = stones.iter().map(|s| s.place.clone()).collect();
        let loose = LoosePrior {
            share: params.loose_share,
            move_m: params.loose_move_m,
            turn_rad: params.loose_turn_rad,
        };
        let mut prior = MotionPrior::new(&places, params.neighbours_per_side, loose)?;
        let start = smoothed_shifts(&stones, &prior.graph);
        prior.common = SmallMotion::shift(component_median(&start));
        let layout = Layout {
            cell_m: (params.cell_spacings * spacing_m).max(params.min_cell_m),
            patch_cells: params.patch_cells,
            outlier_sigmas: params.outlier_sigmas,
        };
        let stones = stones.into_iter().zip(&prior.graph.nodes).zip(&start);
        Some(Self {
            stones: stones
                .map(|((info, node), shift)| StoneState::new(info, node.face_from_world * shift))
                .collect(),
            prior,
            surface: SurfaceModel::start(layout),
            photos: None,
            wrong_rate: expected_rate(),
            params: params.clone(),
        })
    }

    /// Sets the origin of the field to the rigid motion that most stones have in common, where epochs may be turned
    /// against each other ([`AdjustmentParams::free_rotation`]).
    pub fn follow_common_motion(&mut self) {
        let stones = self.stones.iter().zip(&self.prior.graph.nodes);
        let usable = stones.filter(|(stone, _)| stone.info.usable);
        let moved = usable.map(|(stone, node)| {
            let motion = &stone.with_field.motion;
            (
                node.centroid,
                node.face_from_world.transpose() * motion.translation(),
            )
        });
        if self.params.free_rotation
            && let Some(common) = SmallMotion::common(moved)
        {
            self.prior.common = common;
        }
    }

    /// Probability beforehand that the clouds show a stone at a wrong place: it grows with the square of what one
    /// epoch does not show of the face.
    pub fn wrong_share(&self, i: usize) -> f64 {
        self.wrong_rate * self.stones[i].info.hidden.powi(2)
    }

    /// Prior probability that a stone appears not to move with the field: it is loose, or its clouds show it at a
    /// wrong place. At most one half.
    pub fn leaving_share(&self, i: usize) -> f64 {
        (self.prior.loose.share + self.wrong_share(i)).min(MOST_LEAVING)
    }
}

impl StoneState {
    /// Probability that the clouds show it at a wrong place.
    pub fn p_wrong(&self) -> f64 {
        (1.0 - self.p_with_field) * self.doubt
    }

    fn new(info: StoneInfo, translation: Vector3<f64>) -> Self {
        Self {
            info,
            start: translation,
            with_field: CandidateMotion::new(StoneVector::from_translation(translation)),
            on_own: None,
            log_ratio: 0.0,
            p_with_field: 1.0,
            doubt: 0.0,
            decides: true,
            moves: false,
            effective_freedom: 0.0,
        }
    }

    /// Its linearised surface.
    pub fn surface(&self) -> StoneSurface<'_> {
        StoneSurface {
            with_field: &self.with_field.surface,
            on_own: self.on_own.as_ref().map(|c| &c.surface),
            effective_freedom: self.effective_freedom,
        }
    }

    /// The motion that the stone more probably made: its own or the field's.
    pub fn more_probable(&self) -> &CandidateMotion {
        match &self.on_own {
            Some(own) if self.moving() == Moving::OnOwn => own,
            _ => &self.with_field,
        }
    }

    /// How it more probably moved.
    pub fn moving(&self) -> Moving {
        Moving::more_probable(self.p_with_field)
    }
}
