//! Posed photos from other programs: Agisoft Metashape, RealityCapture, COLMAP, OpenSfM, Pix4D (also as OPF);
//! and photos that E57 files hold.
//!
//! Whatever the file says is turned into [`View`](stonewise_core::geometry::View)s: world frame of the file,
//! first pixel centre at (0.5, 0.5), poses that take world to camera. Views keep the order of the file, and a
//! view's image id is its index.

mod camera_file;
mod colmap;
mod e57;
mod error;
mod map_frame;
mod metashape;
mod opensfm;
mod opf;
mod photo_sizes;
mod photos;
mod pix4d;
mod pose;
mod read;
mod realitycapture;
mod remark;
mod unread;

pub use camera_file::CameraFile;
pub use colmap::{is_camera_folder, write_colmap};
pub use e57::{
    E57_CAMERAS_DIR, E57_IMAGES_DIR, E57ImageCounts, E57Photos, LeftOut, count_e57_images,
    require_e57_photos, unpack_e57_photos,
};
pub use error::CameraError;
pub use map_frame::MapFrame;
pub use metashape::write_metashape;
pub use photos::{Photos, find_photos};
pub use read::{is_camera_file, read_cameras, read_cameras_on_map};
pub use realitycapture::is_sidecar_folder;
pub use remark::Remark;
pub use unread::unread_cameras;

use error::{malformed, parse_xml, read_text};
