//! Why an image of an E57 file is no photo.

use std::fmt;

/// Why an image of an E57 file is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum LeftOut {
    /// It is projected on a cylinder.
    Cylindrical,
    /// It is a preview: the file does not say how it was projected.
    NoProjection,
    /// The file does not say where it was taken.
    NoPose,
    /// Its pose is not a valid rotation and position.
    WrongPose,
    /// Its focal length or the size of its pixels is impossible.
    WrongLens,
    /// It is a panorama of less or more than the full circle.
    NotTheCircle,
    /// It has another size than the file says, so that its focal length in pixels is unknown.
    OtherSize,
}

impl fmt::Display for LeftOut {
    /// What follows "3 images".
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Cylindrical => "in cylindrical projection, which is not supported",
            Self::NoProjection => "without a camera model, as previews are",
            Self::NoPose => "without a pose",
            Self::WrongPose => "with an impossible pose",
            Self::WrongLens => "with an impossible focal length or pixel size",
            Self::NotTheCircle => "in spherical projection without exactly one full circle",
            Self::OtherSize => "of another size than the file states",
        })
    }
}
