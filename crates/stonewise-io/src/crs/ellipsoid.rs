//! Positions on and above an ellipsoid.

use nalgebra::Point3;

/// An ellipsoid of revolution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipsoid {
    /// Semi-major axis, metres.
    pub semi_major_m: f64,
    /// Semi-major axis over the difference of the axes; 0 for a sphere.
    pub inverse_flattening: f64,
}

/// A geodetic position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geodetic {
    /// Radians, north positive.
    pub latitude: f64,
    /// Radians from Greenwich, east positive.
    pub longitude: f64,
    /// Metres above the ellipsoid.
    pub height_m: f64,
}

impl Ellipsoid {
    /// WGS 84.
    pub const WGS84: Self = Self {
        semi_major_m: 6_378_137.0,
        inverse_flattening: 298.257_223_563,
    };

    /// Difference of the axes over the semi-major axis.
    pub fn flattening(&self) -> f64 {
        if self.inverse_flattening == 0.0 {
            0.0
        } else {
            1.0 / self.inverse_flattening
        }
    }

    /// Square of the first eccentricity.
    pub fn eccentricity_squared(&self) -> f64 {
        let f = self.flattening();
        f * (2.0 - f)
    }

    /// Latitude, longitude and height of an earth-centred position; below a micrometre of error within 10,000
    /// km of the ground.
    ///
    /// Each step leaves about a 150th of the error of the latitude (Torge, Geodesy, section 4.1.3).
    pub fn geodetic(&self, position: &Point3<f64>) -> Geodetic {
        let e2 = self.eccentricity_squared();
        let from_axis = position.x.hypot(position.y);
        let mut latitude = position.z.atan2(from_axis * (1.0 - e2));
        for _ in 0..10 {
            let lifted = position.z + e2 * self.normal_radius(latitude) * latitude.sin();
            latitude = lifted.atan2(from_axis);
        }
        let (sin, cos) = latitude.sin_cos();
        Geodetic {
            latitude,
            longitude: position.y.atan2(position.x),
            height_m: from_axis * cos + position.z * sin - self.semi_major_m * (1.0 - e2 * sin * sin).sqrt(),
        }
    }

    /// Radius of curvature in the prime vertical, metres.
    fn normal_radius(&self, latitude: f64) -> f64 {
        self.semi_major_m / (1.0 - self.eccentricity_squared() * latitude.sin().powi(2)).sqrt()
    }
}

/// The angle within half a turn of zero.
pub(super) fn turn(angle: f64) -> f64 {
    angle - std::f64::consts::TAU * (angle / std::f64::consts::TAU).round()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The closed form of the way back.
    fn geocentric(ellipsoid: &Ellipsoid, at: &Geodetic) -> Point3<f64> {
        let n = ellipsoid.normal_radius(at.latitude);
        let (sin, cos) = at.latitude.sin_cos();
        let out = (n + at.height_m) * cos;
        let up = (n * (1.0 - ellipsoid.eccentricity_squared()) + at.height_m) * sin;
        Point3::new(out * at.longitude.cos(), out * at.longitude.sin(), up)
    }

    const BESSEL: Ellipsoid = Ellipsoid {
        semi_major_m: 6_377_397.155,
        inverse_flattening: 299.152_812_8,
    };

    #[test]
    fn positions_come_back_from_earth_centred_ones() {
        for latitude in [-90.0, -51.0, 0.0, 1e-6, 47.3, 89.999_f64] {
            for (longitude, height_m) in [(-179.0, -400.0), (7.5_f64, 312.0), (120.0, 9000.0)] {
                let at = Geodetic {
                    latitude: latitude.to_radians(),
                    longitude: longitude.to_radians(),
                    height_m,
                };
                let back = BESSEL.geodetic(&geocentric(&BESSEL, &at));
                assert!((back.latitude - at.latitude).abs() < 1e-13, "{at:?} {back:?}");
                assert!((back.height_m - at.height_m).abs() < 1e-7, "{at:?} {back:?}");
                let turn = (back.longitude - at.longitude) * at.latitude.cos();
                assert!(turn.abs() < 1e-13, "{at:?} {back:?}");
            }
        }
    }
}
