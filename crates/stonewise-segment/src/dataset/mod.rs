//! Labelled photos to learn from and to measure on.

mod labelled_photos;
mod photo_crops;
mod split;

pub use labelled_photos::{DatasetError, LabelledPhotos, Reference};
pub use photo_crops::PhotoCrops;

#[cfg(test)]
mod tests;
