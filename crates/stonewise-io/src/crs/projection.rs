//! Map projections: the transverse Mercator family (UTM, Gauss-Krueger, most national grids), Lambert's cone,
//! Mercator and polar stereographic here, others in files of their own.

use super::conformal::{GaussSphere, isometric};
use super::ellipsoid::{Ellipsoid, Geodetic, turn};
use super::equal_area::{albers, azimuthal, parallel_radius};
use std::f64::consts::FRAC_PI_2;

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
    /// Mercator.
    Mercator {
        /// Where it begins; its latitude is the equator.
        origin: MapOrigin,
        /// Parallel of true scale.
        parallel: f64,
        /// Scale on the parallel.
        scale: f64,
    },
    /// Stereographic about a pole.
    PolarStereographic {
        /// Its latitude says which pole.
        origin: MapOrigin,
        /// Parallel of true scale; the pole where its scale is given.
        parallel: f64,
        /// Scale on the parallel.
        scale: f64,
    },
    /// Stereographic by way of a sphere: RD New of the Netherlands.
    ObliqueStereographic {
        /// Where it begins.
        origin: MapOrigin,
        /// Scale at the origin.
        scale: f64,
    },
    /// The oblique cylinder of Switzerland and Hungary, by way of a sphere.
    ObliqueCylinder {
        /// Where it begins.
        origin: MapOrigin,
        /// Scale along the great circle through the origin.
        scale: f64,
    },
    /// Krovak's oblique cone, with coordinates to the east and north.
    Krovak {
        /// Where it begins.
        origin: MapOrigin,
        /// Angle between the axes of the cone and of the earth.
        from_pole: f64,
        /// Parallel of the cone.
        parallel: f64,
        /// Scale on the parallel.
        scale: f64,
    },
    /// Lambert's azimuthal equal area.
    AzimuthalEqualArea {
        /// Where it begins.
        origin: MapOrigin,
    },
    /// Albers's equal area cone.
    AlbersConic {
        /// Where it begins.
        origin: MapOrigin,
        /// Parallels of true scale.
        parallels: [f64; 2],
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
    /// equations 7 to 11 and 35; Snyder 1987, "Map projections", equations 15-1 to 15-10, for the cone, 7-6 and
    /// 7-7 for Mercator, 21-33 and 21-34 for the poles.
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
            Self::Mercator {
                origin,
                parallel,
                scale,
            } => {
                let radius = ellipsoid.semi_major_m * parallel_radius(ellipsoid, *parallel);
                let way = [
                    turn(at.longitude - origin.longitude),
                    isometric(ellipsoid, at.latitude),
                ];
                origin.add(*scale, way.map(|w| radius * w))
            }
            Self::PolarStereographic {
                origin,
                parallel,
                scale,
            } => {
                let side = origin.latitude.signum();
                let radius = polar_scale(ellipsoid, side * parallel)
                    * (-isometric(ellipsoid, side * at.latitude)).exp();
                let (sin, cos) = turn(at.longitude - origin.longitude).sin_cos();
                origin.add(*scale, [radius * sin, -side * radius * cos])
            }
            Self::ObliqueStereographic { origin, scale } => {
                let sphere = GaussSphere::new(ellipsoid, origin.latitude);
                origin.add(*scale, sphere.stereographic(at, origin.longitude))
            }
            Self::ObliqueCylinder { origin, scale } => {
                let sphere = GaussSphere::new(ellipsoid, origin.latitude);
                origin.add(*scale, sphere.cylinder(at, origin.longitude))
            }
            Self::Krovak {
                origin,
                from_pole,
                parallel,
                scale,
            } => {
                let sphere = GaussSphere::new(ellipsoid, origin.latitude);
                let way = sphere.oblique_cone(at, origin.longitude, *from_pole, *parallel);
                origin.add(-scale, way)
            }
            Self::AzimuthalEqualArea { origin } => {
                origin.add(1.0, azimuthal(ellipsoid, at, origin.latitude, origin.longitude))
            }
            Self::AlbersConic { origin, parallels } => {
                let begin = [origin.latitude, origin.longitude];
                origin.add(1.0, albers(ellipsoid, at, begin, *parallels))
            }
        }
    }
}

impl MapOrigin {
    /// The place that lies this far east and north on a map of scale 1.
    fn add(&self, scale: f64, way: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| self.false_m[axis] + scale * way[axis])
    }
}

/// Radius of a parallel of a polar stereographic map, over the exponential of its isometric colatitude, metres.
fn polar_scale(ellipsoid: &Ellipsoid, parallel: f64) -> f64 {
    if FRAC_PI_2 - parallel < 1e-9 {
        let e = ellipsoid.eccentricity_squared().sqrt();
        return 2.0 * ellipsoid.semi_major_m / ((1.0 + e).powf(1.0 + e) * (1.0 - e).powf(1.0 - e)).sqrt();
    }
    ellipsoid.semi_major_m * parallel_radius(ellipsoid, parallel) * isometric(ellipsoid, parallel).exp()
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
        let [m1, m2] = parallels.map(|p| parallel_radius(ellipsoid, p));
        let [t1, t2] = parallels.map(|p| (-isometric(ellipsoid, p)).exp());
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
        ellipsoid.semi_major_m * self.factor * (-self.n * isometric(ellipsoid, latitude)).exp()
    }
}
