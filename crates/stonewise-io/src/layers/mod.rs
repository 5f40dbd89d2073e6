//! Layers of features for other programs: GeoPackage and GeoParquet for geographic information systems, VTK for
//! ParaView. Polygons of a GeoPackage are read back, too.

mod geometry;
mod geopackage;
mod geoparquet;
mod layer;
mod polygon_blob;
mod read_polygons;
mod schema;
mod vtk;

pub use geopackage::{LayerError, write_geopackage};
pub use geoparquet::write_geoparquet;
pub use layer::{Geometry, Layer, LayerStyle};
pub use read_polygons::{PolygonFeature, read_polygons};
pub use vtk::{PolyData, write_vtp};
