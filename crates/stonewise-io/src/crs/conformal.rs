//! Gauss's conformal sphere and the maps that begin on it: the oblique stereographic projection (Netherlands),
//! the oblique cylinder of Switzerland and Hungary, Krovak's oblique cone.

use super::ellipsoid::{Ellipsoid, Geodetic, turn};
use std::f64::consts::FRAC_PI_4;

/// The sphere that touches an ellipsoid at a latitude, with the ellipsoid's points on it at true angles.
///
/// Source: IOGP Guidance Note 7-2, sections 3.3.1 (oblique stereographic) and 3.2.2 (Krovak).
pub struct GaussSphere<'a> {
    ellipsoid: &'a Ellipsoid,
    /// Longitudes on the sphere over those on the ellipsoid.
    n: f64,
    shift: f64,
    radius_m: f64,
    /// Latitude of the point of contact on the sphere.
    contact: f64,
}

impl<'a> GaussSphere<'a> {
    pub fn new(ellipsoid: &'a Ellipsoid, latitude: f64) -> Self {
        let e2 = ellipsoid.eccentricity_squared();
        let n = (1.0 + e2 * latitude.cos().powi(4) / (1.0 - e2)).sqrt();
        let contact = (latitude.sin() / n).asin();
        Self {
            ellipsoid,
            n,
            shift: contact.sin().atanh() - n * isometric(ellipsoid, latitude),
            radius_m: ellipsoid.semi_major_m * (1.0 - e2).sqrt() / (1.0 - e2 * latitude.sin().powi(2)),
            contact,
        }
    }

    /// Latitude and longitude from `meridian` on the sphere.
    fn place(&self, at: &Geodetic, meridian: f64) -> [f64; 2] {
        let latitude = (self.n * isometric(self.ellipsoid, at.latitude) + self.shift)
            .tanh()
            .asin();
        [latitude, self.n * turn(at.longitude - meridian)]
    }

    /// Oblique stereographic (EPSG 9809): from the point of contact, scale 1.
    pub fn stereographic(&self, at: &Geodetic, meridian: f64) -> [f64; 2] {
        let ([sin, cos], [sin0, cos0], [turn_sin, turn_cos]) = self.sides(at, meridian);
        let reach = 2.0 * self.radius_m / (1.0 + sin * sin0 + cos * cos0 * turn_cos);
        [
            reach * cos * turn_sin,
            reach * (sin * cos0 - cos * sin0 * turn_cos),
        ]
    }

    /// Oblique cylinder along the great circle that crosses the meridian of the point of contact at right
    /// angles. Source: Swisstopo, "Formulas and constants for the calculation of the Swiss conformal
    /// cylindrical projection", section 3.
    pub fn cylinder(&self, at: &Geodetic, meridian: f64) -> [f64; 2] {
        let ([sin, cos], [sin0, cos0], [turn_sin, turn_cos]) = self.sides(at, meridian);
        let east = (cos * turn_sin).atan2(sin * sin0 + cos * cos0 * turn_cos);
        let north = (cos0 * sin - sin0 * cos * turn_cos).atanh();
        [self.radius_m * east, self.radius_m * north]
    }

    /// Krovak's cone (EPSG 9819): westing and southing from its apex, scale 1 on the parallel `parallel` about
    /// a pole that lies `from_pole` radians from that of the earth.
    pub fn oblique_cone(&self, at: &Geodetic, meridian: f64, from_pole: f64, parallel: f64) -> [f64; 2] {
        let [latitude, longitude] = self.place(at, meridian);
        let (sin, cos) = latitude.sin_cos();
        let (turn_sin, turn_cos) = longitude.sin_cos();
        let (pole_sin, pole_cos) = from_pole.sin_cos();
        let oblique = (pole_cos * sin + pole_sin * cos * turn_cos).asin();
        // West of the meridian is positive.
        let about = (-cos * turn_sin / oblique.cos()).asin();
        let n = parallel.sin();
        let tan = |latitude: f64| (FRAC_PI_4 + latitude / 2.0).tan();
        let radius = self.radius_m / parallel.tan() * (tan(parallel) / tan(oblique)).powf(n);
        let (angle_sin, angle_cos) = (n * about).sin_cos();
        [radius * angle_sin, radius * angle_cos]
    }

    /// Sine and cosine of the latitudes of a point and of the point of contact, and of the difference of
    /// their longitudes, on the sphere.
    fn sides(&self, at: &Geodetic, meridian: f64) -> ([f64; 2], [f64; 2], [f64; 2]) {
        let [latitude, longitude] = self.place(at, meridian);
        let sides = |angle: f64| [angle.sin(), angle.cos()];
        (sides(latitude), sides(self.contact), sides(longitude))
    }
}

/// Isometric latitude.
pub fn isometric(ellipsoid: &Ellipsoid, latitude: f64) -> f64 {
    let e = ellipsoid.eccentricity_squared().sqrt();
    let sin = latitude.sin();
    sin.atanh() - e * (e * sin).atanh()
}
