//! The joint distribution of the motions of all stones.

use crate::id::StoneId;
use crate::linalg::BlockMatrix;
use nalgebra::{DMatrix, Matrix3, Point3, SMatrix, Vector3};

/// The motions of all stones of a pair of epochs with their joint distribution, as the last solution has it.
/// Errors of the registration of the epochs are not in it.
///
/// The displacement of stone i is G_i f_i + e_i + shared errors: f is the field, normal with the information
/// matrix that is kept here; e_i is the stone's own part and independent of those of all others.
#[derive(Clone, Debug)]
pub struct JointMotions {
    /// One per node of the field; `None`: not measured.
    pub(crate) stones: Vec<Option<JointStone>>,
    /// Neighbours in the field, the lower first.
    pub(crate) edges: Vec<(usize, usize)>,
    /// Information of the field: nine unknowns a stone.
    pub(crate) information: BlockMatrix<9>,
    /// One per node.
    pub(crate) pulls: Vec<Pull>,
    /// Covariance of the errors of the photos' poses; of no unknowns where photos take no part.
    pub(crate) poses: DMatrix<f64>,
    /// Octaves of length between the distance of neighbours and the wall over which points share errors.
    pub(crate) octaves: f64,
    /// Distance of neighbours, metres.
    pub(crate) step_m: f64,
}

/// How a displacement of a stone's points pulls the solution; world.
#[derive(Clone, Debug)]
pub(crate) struct Pull {
    /// Stone of the first epoch.
    pub stone: StoneId,
    /// What it adds to the equations of the field, by metres.
    pub on_field: SMatrix<f64, 9, 3>,
    /// What the stone follows of it by itself, besides the field.
    pub on_stone: Matrix3<f64>,
}

/// A measured stone; world, metres.
#[derive(Clone, Debug)]
pub(crate) struct JointStone {
    pub id: StoneId,
    pub place: Point3<f64>,
    /// Takes world components to (along, up, out) of the wall around the stone.
    pub face_from_world: Matrix3<f64>,
    pub body: u32,
    pub is_loose: bool,
    pub displacement: Vector3<f64>,
    /// The displacement by the nine unknowns of the field.
    pub by_field: SMatrix<f64, 3, 9>,
    /// Covariance that it shares with no other stone.
    pub own: Matrix3<f64>,
    /// Root of the covariance of the errors that its points share over one octave of length.
    pub octave: Matrix3<f64>,
    /// The displacement by the unknowns of the photos' poses.
    pub by_poses: Vec<(usize, Vector3<f64>)>,
    /// What the stone's own observations say of its displacement: information and vector.
    pub observed: (Matrix3<f64>, Vector3<f64>),
}
