//! The stones' own points, as observations of a surface that both epochs share.

mod cells;
mod correlation;
mod discount;
pub(crate) mod equations;
mod layout;
mod linearisation;
mod local_motion;
mod local_pair;
mod model;
mod noise_estimate;
mod patch_fit;
mod patch_grid;
mod patches;
mod point_weights;
mod robust;
mod slope_scatter;
mod surface_noise;
#[cfg(test)]
mod testing;

pub(crate) use correlation::Correlation;
pub(crate) use discount::{with_error_likelihood, with_shift_error};
pub(crate) use equations::{Equations, FitOptions, deviance, equations};
pub(crate) use layout::Layout;
pub(crate) use linearisation::Linearisation;
pub(crate) use local_pair::LocalPair;
pub(crate) use model::{Effort, Inflation, StoneSurface, SurfaceModel};
pub(crate) use noise_estimate::estimate_noise;
pub(crate) use point_weights::PointWeights;
pub(crate) use surface_noise::SurfaceNoise;
#[cfg(test)]
pub(crate) use testing::without_points;
