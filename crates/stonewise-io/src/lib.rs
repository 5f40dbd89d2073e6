//! Readers and writers of the formats that surveys come in and results go out.

pub mod atomic;
pub mod cameras;
pub mod cloud;
pub mod crs;
pub mod exif;
mod folder;
pub mod image_io;
pub mod layers;
pub mod masks;
pub mod mesh_ply;
mod photo_name;
pub mod table;
pub mod wall;
