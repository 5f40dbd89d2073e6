//! Labelled photos to learn from and to measure on.

mod error;
mod labelled_photos;
mod photo_crops;
mod photo_set;
mod split;

pub use error::DatasetError;
pub use labelled_photos::{LabelledPhotos, Reference};
pub use photo_crops::PhotoCrops;
pub use photo_set::PhotoSet;

#[cfg(test)]
mod tests;
