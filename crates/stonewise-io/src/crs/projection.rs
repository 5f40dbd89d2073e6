//! Conformal map projections: the transverse Mercator family (UTM, Gauss-Krueger, most national grids) and
//! Lambert's cone.

use super::ellipsoid::{Ellipsoid, Geodetic};
use std::f64::consts::FRAC_PI_4;

/// A projection with its parameters; angles in radians, lengths in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Transverse Mercator, also called Gauss-Krueger.
    TransverseMercator {
        /// Where it begins.
        origin: MapOrigin,
        /// Scale on the central meridian.
        scale: f64,
    },
    /// Lambert's conformal cone.
    LambertConic {
        /// Where it begins.
        origin: MapOrigin,
        /// Parallels of true scale; the same twice where there is one.
        parallels: [f64; 2],
        /// Scale on the parallels.
        scale: f64,
    },
}

/// The place from which a projection counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapOrigin {
    /// Radians.
    pub latitude: f64,
    /// Central meridian, radians from Greenwich.
    pub longitude: f64,
    /// Easting and northing of the origin, metres.
    pub false_m: [f64; 2],
}

impl Projection {
    /// Easting and northing, metres.
    ///
    /// Source: Krueger 1912, as Karney 2011, "Transverse Mercator with an accuracy of a few nanometers",
    /// equations 7 to 11 and 35; Snyder 1987, "Map projections", equations 15-1 to 15-10, for the cone.
    pub fn forward(&self, ellipsoid: &Ellipsoid, at: &Geodetic) -> [f64; 2] {
        match self {
            Self::TransverseMercator { origin, scale } => {
                let zero = krueger(ellipsoid, origin.latitude, 0.0);
                let [east, north] = krueger(ellipsoid, at.latitude, turn(at.longitude - origin.longitude));
                [
                    origin.false_m[0] + scale * east,
                    origin.false_m[1] + scale * (north - zero[1]),
                ]
            }
            Self::LambertConic {
                origin,
                parallels,
                scale,
            } => {
                let cone = Cone::new(ellipsoid, *parallels);
                let radius = |latitude| scale * cone.radius(ellipsoid, latitude);
                let angle = cone.n * turn(at.longitude - origin.longitude);
                let (r, r0) = (radius(at.latitude), radius(origin.latitude));
                [
                    origin.false_m[0] + r * angle.sin(),
                    origin.false_m[1] + r0 - r * angle.cos(),
                ]
            }
        }
    }
}

/// The angle within half a turn of zero.
fn turn(angle: f64) -> f64 {
    angle - std::f64::consts::TAU * (angle / std::f64::consts::TAU).round()
}

/// Easting and northing from the equator and the central meridian, scale 1.
fn krueger(ellipsoid: &Ellipsoid, latitude: f64, longitude: f64) -> [f64; 2] {
    let e = ellipsoid.eccentricity_squared().sqrt();
    let tau = latitude.tan();
    let sigma = (e * (e * tau / tau.hypot(1.0)).atanh()).sinh();
    let conformal = tau * sigma.hypot(1.0) - sigma * tau.hypot(1.0);
    let xi = conformal.atan2(longitude.cos());
    let eta = (longitude.sin() / conformal.hypot(longitude.cos())).asinh();
    let (radius, series) = rectifying(ellipsoid);
    let (mut north, mut east) = (xi, eta);
    for (j, coefficient) in (1..).zip(series) {
        let j = 2.0 * f64::from(j);
        north += coefficient * (j * xi).sin() * (j * eta).cosh();
        east += coefficient * (j * xi).cos() * (j * eta).sinh();
    }
    [radius * east, radius * north]
}

/// Rectifying radius, metres, and Krueger's coefficients to the sixth power of the third flattening.
fn rectifying(ellipsoid: &Ellipsoid) -> (f64, [f64; 6]) {
    let f = ellipsoid.flattening();
    let n = f / (2.0 - f);
    let power = |exponents: &[f64]| exponents.iter().rev().fold(0.0, |sum, c| (sum + c) * n);
    let radius =
        ellipsoid.semi_major_m / (1.0 + n) * (1.0 + power(&[0.0, 0.25, 0.0, 1.0 / 64.0, 0.0, 1.0 / 256.0]));
    let series = [
        power(&[
            0.5,
            -2.0 / 3.0,
            5.0 / 16.0,
            41.0 / 180.0,
            -127.0 / 288.0,
            7891.0 / 37_800.0,
        ]),
        power(&[
            0.0,
            13.0 / 48.0,
            -3.0 / 5.0,
            557.0 / 1440.0,
            281.0 / 630.0,
            -1_983_433.0 / 1_935_360.0,
        ]),
        power(&[
            0.0,
            0.0,
            61.0 / 240.0,
            -103.0 / 140.0,
            15_061.0 / 26_880.0,
            167_603.0 / 181_440.0,
        ]),
        power(&[
            0.0,
            0.0,
            0.0,
            49_561.0 / 161_280.0,
            -179.0 / 168.0,
            6_601_661.0 / 7_257_600.0,
        ]),
        power(&[
            0.0,
            0.0,
            0.0,
            0.0,
            34_729.0 / 80_640.0,
            -3_418_889.0 / 1_995_840.0,
        ]),
        power(&[0.0, 0.0, 0.0, 0.0, 0.0, 212_378_941.0 / 319_334_400.0]),
    ];
    (radius, series)
}

/// A cone through two parallels.
struct Cone {
    n: f64,
    factor: f64,
}

impl Cone {
    fn new(ellipsoid: &Ellipsoid, parallels: [f64; 2]) -> Self {
        let e2 = ellipsoid.eccentricity_squared();
        let [m1, m2] = parallels.map(|p| p.cos() / (1.0 - e2 * p.sin().powi(2)).sqrt());
        let [t1, t2] = parallels.map(|p| isometric(ellipsoid, p));
        let n = if (parallels[0] - parallels[1]).abs() < 1e-10 {
            parallels[0].sin()
        } else {
            (m1 / m2).ln() / (t1 / t2).ln()
        };
        Self {
            n,
            factor: m1 / (n * t1.powf(n)),
        }
    }

    fn radius(&self, ellipsoid: &Ellipsoid, latitude: f64) -> f64 {
        ellipsoid.semi_major_m * self.factor * isometric(ellipsoid, latitude).powf(self.n)
    }
}

/// Snyder's t, equation 15-9.
fn isometric(ellipsoid: &Ellipsoid, latitude: f64) -> f64 {
    let e = ellipsoid.eccentricity_squared().sqrt();
    let flattened = e * latitude.sin();
    (FRAC_PI_4 - latitude / 2.0).tan() / ((1.0 - flattened) / (1.0 + flattened)).powf(e / 2.0)
}
