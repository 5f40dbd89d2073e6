//! Training images from labelled photos: parts of them, seen from elsewhere in other light.

mod colour;
mod crop_view;
mod params;
mod photo;

pub use colour::recolour;
pub use crop_view::CropView;
pub use params::AugmentParams;
pub use photo::Photo;

#[cfg(test)]
mod tests;
