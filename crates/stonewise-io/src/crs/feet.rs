//! Systems in feet, which many files name by their number alone.

use super::epsg::unit_m;

/// Systems in feet that the table does not have, because WKT 1 cannot express Michigan's cone.
const OTHER: [u32; 4] = [6200, 6201, 6202, 6966];

/// Whether eastings and northings of the system with this code are in feet, of any kind (international, US
/// survey).
pub fn is_in_feet(code: u32) -> bool {
    OTHER.contains(&code) || unit_m(code).is_some_and(|metres| (metres - 0.3048).abs() < 1e-5)
}
