//! Files, read and written.
#![allow(
    clippy::panic,
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a test that cannot go on must stop"
)]

mod camera_files;
mod cameras;
mod cloud_damage;
mod cloud_formats;
mod cloud_oddities;
mod cloud_points;
mod e57_photos;
mod hostile_files;
mod image_io;
mod label_survey;
mod laz_points;
mod map_cameras;
mod mask_files;
mod masks;
mod opf;
mod photos;
mod survey_clouds;
