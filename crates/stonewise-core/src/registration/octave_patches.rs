//! Patches of stones whose points err alike over octaves of length.

use nalgebra::Point3;
use std::collections::BTreeMap;

/// Errors over one octave of length: the stones of a patch share one error.
pub(crate) struct OctavePatches {
    /// Share of the variance of an octave: less than one for the last, of which a part lies within the wall.
    pub share: f64,
    /// The patch of each stone.
    pub of_stones: Vec<usize>,
    /// Number of patches.
    pub count: usize,
}

/// The octaves from twice the distance of neighbours up, each a checkerboard of its length.
///
/// `octaves`: their number, from the distance of neighbours.
pub(crate) fn octave_patches(
    places: impl Iterator<Item = Point3<f64>> + Clone,
    step_m: f64,
    octaves: f64,
) -> Vec<OctavePatches> {
    let mut found = Vec::new();
    let (mut rest, mut length_m) = (octaves - 1.0, step_m);
    while rest > 0.0 {
        length_m *= 2.0;
        let mut numbers = BTreeMap::new();
        let number = |place: Point3<f64>| {
            let next = numbers.len();
            let cell = place.coords.map(|x| (x / length_m).floor() as i64);
            *numbers.entry([cell.x, cell.y, cell.z]).or_insert(next)
        };
        found.push(OctavePatches {
            share: rest.min(1.0),
            of_stones: places.clone().map(number).collect(),
            count: numbers.len(),
        });
        rest -= 1.0;
    }
    found
}
