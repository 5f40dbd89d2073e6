//! Coordinate reference systems: their names, and the map projections of those that cameras come in.

mod conformal;
mod ellipsoid;
mod epsg;
mod equal_area;
mod geoid;
mod geoid_egm;
mod geoid_file;
mod geoid_gravsoft;
mod geoid_tiff;
mod map_system;
mod projection;
mod projjson;
mod system;
mod units;
mod wkt;

pub use ellipsoid::{Ellipsoid, Geodetic};
pub use epsg::definition;
pub use geoid::Geoid;
pub use geoid_file::GeoidError;
pub use map_system::{Coordinates, MapSystem};
pub use projection::{MapOrigin, Projection};
pub use projjson::projjson;
pub use system::Crs;
pub(crate) use units::unit_of_code;
pub use units::{UnitName, Units, in_metres, is_foot};
