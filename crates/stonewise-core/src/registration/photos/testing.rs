//! Faces and photos drawn for tests.

use super::params::PhotoParams;
use super::patch::Patch;
use super::surface::Surface;
use super::template::Face;
use crate::statistics::split_mix;

/// Rows and columns of a drawn photo.
pub(super) const SIDE: usize = 48;

/// A flat face in the middle of a photo, 12 cells from its border.
pub(super) fn face(pose_error_px: f64) -> Face {
    let params = PhotoParams {
        min_correlation: 0.0,
        pose_error_px,
        ..PhotoParams::default()
    };
    let surface = Surface::flat(SIDE, 12);
    let pixel_m = surface.cell_m;
    Face::new(surface, pixel_m, &params)
}

/// Noise of grains of about `grain` cells, moved by `shift` columns and rows.
pub(super) fn grained(seed: u64, grain: f64, shift: [f64; 2]) -> Patch {
    let node = |i: i64, j: i64| {
        let number = split_mix(seed ^ split_mix((i as u64) << 32 ^ (j as u64 & 0xffff_ffff)));
        number as f64 / u64::MAX as f64 - 0.5
    };
    let value = |x: f64, y: f64| {
        let (x, y) = (x / grain, y / grain);
        let (i, j) = (x.floor(), y.floor());
        let (u, v) = (x - i, y - j);
        let (i, j) = (i as i64, j as i64);
        let line = |j: i64| node(i, j) * (1.0 - u) + node(i + 1, j) * u;
        line(j) * (1.0 - v) + line(j + 1) * v
    };
    // Far from the corner of the nodes, so that shifts of any sign show the same grain.
    let at = |k: usize, shift: f64| k as f64 - shift + 200.0;
    Patch {
        values: (0..SIDE * SIDE)
            .map(|k| value(at(k % SIDE, shift[0]), at(k / SIDE, shift[1])) as f32)
            .collect(),
        valid: vec![true; SIDE * SIDE],
    }
}
