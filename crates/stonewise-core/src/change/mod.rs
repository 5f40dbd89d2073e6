//! Change between two clouds: M3C2 as the reference method, cloud to cloud, cloud to mesh.
//!
//! Positive M3C2 distances mean that the second epoch lies on the normal's side of the first, and normals
//! point out of the wall, so positive is downstream.

mod c2c;
mod c2m;
mod cloudcompare;
mod clouds;
mod core_points;
mod error;
mod field;
mod m3c2;
mod mesh;
mod normals;
mod params;
mod registration_error;
mod spread;
mod survey;
mod triangle;

pub use c2c::c2c;
pub use c2m::{MeshIndex, c2m};
pub use cloudcompare::{CloudCompareError, params_from_cloudcompare, params_to_cloudcompare};
pub use clouds::{CoreNormals, m3c2_clouds};
pub use core_points::{CorePoint, thin_to_voxels};
pub use error::CompareError;
pub use field::{ChangeField, ChangePoint};
pub use m3c2::m3c2;
pub use mesh::{MeshError, TriangleMesh};
pub use normals::{OutwardReference, estimate_normals};
pub use params::M3c2Params;
pub use survey::{PointDistances, c2c_survey, c2m_survey, m3c2_survey};
