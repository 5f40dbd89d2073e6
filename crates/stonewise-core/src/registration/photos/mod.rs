//! Stones tracked from photo to photo.
//!
//! Each photo's part that shows a stone is brought onto the stone's face, its contrast normalised, and
//! matched with one template per stone. What comes out are shifts in the face, one for each photo; the
//! adjustment makes motions of them.

mod blur;
mod least_squares;
mod matching;
mod params;
mod patch;
mod photo;
mod pictures;
mod placed;
mod search;
mod surface;
mod template;
#[cfg(test)]
mod testing;
mod track;
mod turn;
mod verify;

pub use params::PhotoParams;
#[cfg(test)]
pub(crate) use photo::ByRows;
pub use photo::{Chip, Photo, PhotoCamera};
pub use pictures::FacePictures;
pub(crate) use placed::FaceMotion;
pub use track::PhotoStatus;
pub(crate) use track::{Sight, Track, Tracker};
pub(crate) use turn::turn_by_rotation;

/// Photos of both epochs, and the parts of them that show each pair of stones, batch by batch.
pub trait PhotoSource<E>: Sync {
    /// Photos of both epochs.
    fn photos(&self) -> &[Photo];
    /// How stones are tracked.
    fn params(&self) -> &PhotoParams;
    /// Edge of the pictures that are kept of each tracked stone, pixels; none are kept where it is zero.
    fn picture_px(&self) -> usize {
        0
    }
    /// The chips of each pair of a batch, in the order of the pairs.
    ///
    /// # Errors
    /// They cannot be read.
    fn load(&self, batch: usize) -> Result<Vec<Vec<Chip>>, E>;
}
