//! Photos that E57 files hold beside their scans (ASTM E2807-11, `images2D`).
//!
//! Pinhole images are photos as they are; panoramas are cut into photos.

mod images;
mod left_out;
mod names;
mod panorama;
mod unpack;

pub use left_out::LeftOut;
pub use unpack::{
    E57_CAMERAS_DIR, E57_IMAGES_DIR, E57ImageCounts, E57Photos, count_e57_images, require_e57_photos,
    unpack_e57_photos,
};
