//! Photos that could show a place.

use crate::geometry::View;
use nalgebra::{Point3, Vector3};

/// Number of photos in whose frame a place of the face lies, seen from the front under at most
/// `max_incidence_rad`. What stands in front of the place is not known: hidden places count as well.
pub fn photos_facing(
    views: &[View],
    place: &Point3<f64>,
    outward: &Vector3<f64>,
    max_incidence_rad: f64,
) -> usize {
    let is_facing = |view: &&View| {
        let towards = view.centre() - place;
        let shows = view.project(place).is_some_and(|p| view.is_inside(p.pixel));
        shows && towards.angle(outward) <= max_incidence_rad
    };
    views.iter().filter(is_facing).count()
}
