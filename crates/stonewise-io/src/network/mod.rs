//! Adjusted networks of a surveyor: points of one epoch with the covariance of all their coordinates.

mod adjusted;
mod gama;
mod jag3d;
mod plain;

use adjusted::error;
pub use adjusted::{AdjustedCoordinate, Network, NetworkError, NetworkPoint};
use std::path::Path;

/// Reads an adjusted network, by the ending of its name: `.xml`, what gama-local 2 writes with `--xml`; `.info`, JAG3D's
/// export, with the covariance in `.cxx` beside it; `.csv`, a plain table, with the covariance in `.cov` beside it.
///
/// The table has the columns name, x, y, z, metres, and may have dx, dy, dz: the adjusted values, empty where there are
/// none, in place of x, y, z. The covariance is its lower triangle, m^2: a line for each adjusted value, x before y
/// before z, points in the order of the table.
///
/// Cost: the cube of the number of coordinates.
///
/// # Errors
/// With file and line: no such format, something missing or no number, a point twice, a covariance that is not whole,
/// not symmetric or has a negative eigenvalue, no point that x, y and z place.
pub fn read_network(path: &Path) -> Result<Network, NetworkError> {
    let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
    let (raw, covariance_at) = match ending.to_str() {
        Some("xml") => gama::read(path)?,
        Some("info") => jag3d::read(path)?,
        Some("csv") => plain::read(path)?,
        _ => {
            let message =
                "no adjusted network: name the XML of gama-local, the .info of JAG3D or a .csv".to_owned();
            return Err(error(path, 1, message));
        }
    };
    raw.checked(path, &covariance_at)
}

#[cfg(test)]
mod tests;
