//! Systems in feet, which many files name by their number alone.

use super::epsg::unit_m;

/// Whether eastings and northings of the system with this code are in feet, of any kind (international, US
/// survey).
pub fn is_in_feet(code: u32) -> bool {
    unit_m(code).is_some_and(|metres| (metres - 0.3048).abs() < 1e-5)
}
