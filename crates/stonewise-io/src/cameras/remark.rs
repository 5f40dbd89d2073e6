//! What a reader of a camera file has to say.

use std::fmt;

/// Why a photo cannot be used, or how a camera file was read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Remark {
    /// The photo was not aligned.
    NotAligned,
    /// The photo is disabled in Metashape.
    Disabled,
    /// The photo has its pose from another camera of its rig.
    RigSlave,
    /// The photo's component has no place in the world, or its pixels are not read, for this reason.
    NotPlaced(String),
    /// The photo belongs to another reconstruction than the largest.
    SmallerReconstruction,
    /// The file holds this many reconstructions, of which only the largest was read.
    SeveralReconstructions(usize),
    /// A folder holds several models, of which one was read; each with its place and its number of photos.
    LargestModel {
        /// The one that was read.
        read: (String, usize),
        /// The others.
        others: Vec<(String, usize)>,
    },
    /// This chunk is disabled and was not read.
    ChunkDisabled(String),
    /// A chunk was not read, because another was.
    ChunkNotRead {
        /// The one that was not read.
        chunk: String,
        /// The first with aligned cameras.
        used: String,
    },
    /// A camera has a rolling shutter, which is not corrected.
    RollingShutter,
    /// Yaw angles count from true north, places from the map's.
    YawFromTrueNorth,
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotAligned => f.write_str("not aligned"),
            Self::Disabled => f.write_str("disabled in Metashape"),
            Self::RigSlave => f.write_str("slave of a multi-camera rig, stored without a pose of its own"),
            Self::NotPlaced(reason) => f.write_str(reason),
            Self::SmallerReconstruction => f.write_str("in a separate, smaller reconstruction"),
            Self::SeveralReconstructions(n) => {
                write!(f, "{n} reconstructions in the file; only the largest was read")
            }
            Self::LargestModel {
                read: (read, photos),
                others,
            } => {
                let others: Vec<String> = others.iter().map(|(place, n)| format!("{place} ({n})")).collect();
                write!(
                    f,
                    "model {read} was read, with {photos} photos the largest, and not {}: models do not share a frame",
                    others.join(", ")
                )
            }
            Self::ChunkDisabled(chunk) => write!(f, "chunk {chunk} is disabled and was not read"),
            Self::ChunkNotRead { chunk, used } => {
                write!(f, "chunk {chunk} was not read, only {used}, the first with aligned cameras")
            }
            Self::YawFromTrueNorth => f.write_str(
                "the file gives places on a map but yaw from true north, so that all cameras may be turned by the angle between \
                 both norths: export XMP files, or the OpenCV-compliant camera parameters",
            ),
            Self::RollingShutter => f.write_str(
                "the camera's rolling shutter is not corrected when stones are transferred from photos to clouds: points may be \
                 assigned to places a few pixels off in the photo",
            ),
        }
    }
}
