//! Layers of features for other programs: GeoPackage and GeoJSON for geographic information systems, VTK for
//! ParaView. Only writing.

mod geojson;
mod geometry;
mod geopackage;
mod layer;
mod schema;
mod vtk;

pub use geojson::write_geojson;
pub use geopackage::{LayerError, write_geopackage};
pub use layer::{Geometry, Layer, LayerStyle};
pub use vtk::{PolyData, write_vtp};
