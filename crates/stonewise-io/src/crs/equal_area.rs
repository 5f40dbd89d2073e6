//! Maps of true areas: Lambert's azimuthal projection (Europe) and Albers's cone.

use super::ellipsoid::{Ellipsoid, Geodetic, turn};
use std::f64::consts::FRAC_PI_2;

/// Lambert azimuthal equal area from its centre. Source: Snyder 1987, equations 24-2 to 24-13 and 24-17 to 24-26.
pub fn azimuthal(ellipsoid: &Ellipsoid, at: &Geodetic, latitude: f64, meridian: f64) -> [f64; 2] {
    let pole = zone(ellipsoid, FRAC_PI_2);
    let (turn_sin, turn_cos) = turn(at.longitude - meridian).sin_cos();
    let a = ellipsoid.semi_major_m;
    if FRAC_PI_2 - latitude.abs() < 1e-9 {
        let side = latitude.signum();
        let radius = a * (pole - side * zone(ellipsoid, at.latitude)).max(0.0).sqrt();
        return [radius * turn_sin, -side * radius * turn_cos];
    }
    let authalic = |latitude| {
        let sin = (zone(ellipsoid, latitude) / pole).clamp(-1.0, 1.0);
        [sin, (1.0 - sin * sin).sqrt()]
    };
    let ([sin, cos], [sin0, cos0]) = (authalic(at.latitude), authalic(latitude));
    let radius = a * (pole / 2.0).sqrt();
    let stretch = a * parallel_radius(ellipsoid, latitude) / (radius * cos0);
    let reach = radius * (2.0 / (1.0 + sin0 * sin + cos0 * cos * turn_cos)).sqrt();
    [
        reach * stretch * cos * turn_sin,
        reach / stretch * (cos0 * sin - sin0 * cos * turn_cos),
    ]
}

/// Albers's cone through two parallels, from the origin. Source: Snyder 1987, equations 14-1 to 14-6 and 14-12 to
/// 14-14.
pub fn albers(
    ellipsoid: &Ellipsoid,
    at: &Geodetic,
    [latitude, meridian]: [f64; 2],
    parallels: [f64; 2],
) -> [f64; 2] {
    let [m1, m2] = parallels.map(|p| parallel_radius(ellipsoid, p).powi(2));
    let [q1, q2] = parallels.map(|p| zone(ellipsoid, p));
    let n = if (parallels[0] - parallels[1]).abs() < 1e-10 {
        parallels[0].sin()
    } else {
        (m1 - m2) / (q2 - q1)
    };
    let radius = |latitude| {
        let square = m1 + n * (q1 - zone(ellipsoid, latitude));
        ellipsoid.semi_major_m * square.max(0.0).sqrt() / n
    };
    let (angle_sin, angle_cos) = (n * turn(at.longitude - meridian)).sin_cos();
    [
        radius(at.latitude) * angle_sin,
        radius(latitude) - radius(at.latitude) * angle_cos,
    ]
}

/// Snyder's q (3-12): the area between the equator and a latitude, over that of the square of the axis, for a
/// radian of longitude, times two.
fn zone(ellipsoid: &Ellipsoid, latitude: f64) -> f64 {
    let e2 = ellipsoid.eccentricity_squared();
    let (e, sin) = (e2.sqrt(), latitude.sin());
    if e2 == 0.0 {
        return 2.0 * sin;
    }
    (1.0 - e2) * (sin / (1.0 - e2 * sin * sin) + (e * sin).atanh() / e)
}

/// Radius of a parallel over the semi-major axis: Snyder's m (14-15).
pub fn parallel_radius(ellipsoid: &Ellipsoid, latitude: f64) -> f64 {
    latitude.cos() / (1.0 - ellipsoid.eccentricity_squared() * latitude.sin().powi(2)).sqrt()
}
