//! Readers and writers of the formats that surveys come in and results go out: point clouds, posed photos,
//! masks, tables, adjusted networks, layers for GIS, and drawings
//! for CAD.
//!
//! M3C2 of two clouds, of whichever [format](cloud::CloudFormat):
//!
//! ```
//! use std::path::Path;
//! use stonewise_core::change::{CoreNormals, M3c2Params, OutwardReference, m3c2_clouds, thin_to_voxels};
//! use stonewise_core::nalgebra::{Point3, Vector3};
//! use stonewise_core::progress::Silent;
//! use stonewise_io::cloud::{CloudError, read_cloud};
//!
//! let points_of = |path: &str| -> Result<Vec<Point3<f64>>, CloudError> {
//!     let mut points = Vec::new();
//!     read_cloud(Path::new(path), 1_000_000, |chunk| {
//!         points.extend(&chunk.positions);
//!         Ok::<(), CloudError>(())
//!     })?;
//!     Ok(points)
//! };
//! let clouds = [points_of("../../testdata/m3c2/first.csv")?, points_of("../../testdata/m3c2/second.csv")?];
//! let core_points: Vec<Point3<f64>> = thin_to_voxels(&clouds[0], 0.1).into_iter().map(|i| clouds[0][i]).collect();
//! let params = M3c2Params { normal_radius_m: 0.15, cylinder_radius_m: 0.06, ..M3c2Params::default() };
//! let outside = CoreNormals::Fitted(OutwardReference::Direction(Vector3::x()));
//! let field = m3c2_clouds(clouds, &core_points, &outside, &params, &Silent)?;
//! let significant = |d: f64, limit: Option<f64>| limit.is_some_and(|limit| d.abs() > limit);
//! let changed = field.points.iter().filter(|p| p.distance_m.is_some_and(|d| significant(d, p.detection_limit_m)));
//! assert!(changed.count() > 0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Cameras of a Metashape project, from the XML of File > Export > Export Cameras, and where a photo shows a
//! point:
//!
//! ```
//! use std::path::Path;
//! use stonewise_io::cameras::read_cameras;
//!
//! let cameras = read_cameras(Path::new("../../testdata/cameras/metashape.xml"))?;
//! let view = &cameras.views[0];
//! // A point in front of the camera on its axis: the pixel is the principal point.
//! let ahead = view.cam_from_world.inverse() * stonewise_core::nalgebra::Point3::new(0.0, 0.0, 5.0);
//! let shown = view.project(&ahead).ok_or("the photo does not show the point")?;
//! println!("{} shows the point at {:?}", view.name, shown.pixel);
//! # assert!((shown.pixel[0] - view.camera.center_px[0]).abs() < 1e-6);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod atomic;
pub mod cameras;
pub mod cloud;
pub mod crs;
pub mod dxf;
pub mod exif;
mod folder;
pub mod image_io;
pub mod layers;
pub mod masks;
pub mod mesh_ply;
pub mod network;
mod photo_name;
pub mod table;
pub mod text;
pub mod wall;
mod xml;
