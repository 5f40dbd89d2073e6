//! Layers of features for geographic information systems: GeoPackage and GeoJSON. Only writing.

mod geojson;
mod geometry;
mod geopackage;
mod layer;
mod schema;

pub use geojson::write_geojson;
pub use geopackage::{LayerError, write_geopackage};
pub use layer::{Crs, Geometry, Layer, LayerStyle};
