//! Errors that the sources of an epoch share over the wall, and what they leave uncertain about the epochs'
//! datum.
//!
//! An *observer* is one source of an epoch: a scanner station, a strip of a drone. Observer s sees a place p
//! at time t displaced by an error
//!
//! ```text
//! b_s(p, t) = c_s + w_s x (p - p_s) + k_e P (p - p_s) + v_s(t) + g_e
//! ```
//!
//! c_s: registration error of the source; w_s: its rotation about the middle p_s of what it sees; k_e: stretch
//! in the face of the stone (P projects onto it), because the noise of oblique ranges makes a stone seem
//! shifted away from the station; v_s: drift, a Gaussian process in time (Matern 3/2; Rasmussen & Williams
//! 2006, eq. 4.17) at knots (Glira, Pfeifer & Mandlburger 2016 use splines in the same place); g_e: error of
//! the whole epoch, which no comparison of its own sources shows. Within one epoch nothing moves, so
//! differences between its sources on the same stone are differences of errors. Their variances are estimated
//! from these alone (restricted maximum likelihood, REML), then held; stable areas, which both epochs see unmoved,
//! add differences between the epochs. What comes out is the error of the second epoch against the first at
//! every stone, with its covariance: an epoch's mean error stays as uncertain as its prior where nothing shows
//! it. Where nothing shows the datum at all, motions hold against the common rigid motion of the stones, and
//! only what the error has besides a rigid motion counts.
//!
//! Frame: world; metres, seconds, radians.

mod assumptions;
mod compared;
mod component_estimate;
mod components;
mod congruence;
mod contrast;
mod cross_check;
mod datum;
mod epoch_error;
mod epoch_pair;
mod influence;
mod joint;
mod lone_area;
mod model;
mod network;
mod observation;
mod relative;
mod response;
mod rigid;
mod scale;
mod sensors;
mod shared;
mod sight;
mod stable;
#[cfg(test)]
mod tests;

pub use components::{ObserverComponents, SensorClass};
pub use contrast::ContrastParams;
pub use cross_check::CrossCheck;
pub use datum::Datum;
pub use epoch_error::{EpochErrors, ErrorAt, SourceError, epoch_errors};
pub use epoch_pair::{EpochErrorParams, EpochPair};
pub use influence::{Influence, Member};
pub use joint::JointErrors;
pub use lone_area::LoneArea;
pub use network::{NetworkShift, PhotoNetwork};
pub use response::Response;
pub use scale::{KnownScale, ScaleError, WallStrain};
pub use sight::{SeenStone, Source, SourcePoints};
pub use stable::{StableParams, StablePoints};
