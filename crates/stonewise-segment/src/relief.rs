//! Relief at other resolutions.

use stonewise_core::raster::{RELIEF_CHANNELS, Raster, ReliefMap};

/// A part of a map with other columns and rows, interpolated between pixel centres. `part`: left, top, width,
/// height in parts of the map.
pub fn resampled(relief: &ReliefMap, part: [f64; 4], [width, height]: [u32; 2]) -> ReliefMap {
    let columns = neighbours([part[0], part[2]], width, relief.width());
    let rows = neighbours([part[1], part[3]], height, relief.height());
    let row = |y: usize| &relief.data()[y * relief.width() as usize..][..relief.width() as usize];
    let mut values = Vec::with_capacity(columns.len() * rows.len());
    for (top, bottom, down) in rows {
        let (above, below) = (row(top), row(bottom));
        values.extend(columns.iter().map(|&(left, right, along)| {
            let mix = |row: &[[f32; RELIEF_CHANNELS]], c: usize| {
                row[left][c] * (1.0 - along) + row[right][c] * along
            };
            std::array::from_fn(|c| mix(above, c) * (1.0 - down) + mix(below, c) * down)
        }));
    }
    Raster::from_vec(width, height, values)
        .unwrap_or_else(|| Raster::filled(width, height, [0.0; RELIEF_CHANNELS]))
}

/// The two old pixels between whose centres each new pixel of a part lies, and how far towards the second.
fn neighbours([from, length]: [f64; 2], new: u32, old: u32) -> Vec<(usize, usize, f32)> {
    let place = |at: u32| {
        let at = (from + length * (f64::from(at) + 0.5) / f64::from(new)) * f64::from(old) - 0.5;
        let at = at.clamp(0.0, f64::from(old.max(1) - 1));
        let low = at as usize;
        (
            low,
            (low + 1).min(old.max(1) as usize - 1),
            (at - low as f64) as f32,
        )
    };
    (0..new).map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_stays_a_ramp_in_any_part_and_at_any_size() {
        let pixel = |i: u32| [(i % 40) as f32, (i / 40) as f32, 1.0, 0.0];
        let map = Raster::from_vec(40, 20, (0..800).map(pixel).collect()).unwrap();
        // The middle half of the columns, the lower half of the rows, at three times the resolution.
        let part = resampled(&map, [0.25, 0.5, 0.5, 0.5], [60, 30]);
        for (i, value) in part.data().iter().enumerate() {
            let (x, y) = ((i % 60) as f32 + 0.5, (i / 60) as f32 + 0.5);
            let expected = [10.0 + x / 3.0 - 0.5, (10.0 + y / 3.0 - 0.5).min(19.0), 1.0, 0.0];
            for c in 0..RELIEF_CHANNELS {
                assert!((value[c] - expected[c]).abs() < 1e-4, "{value:?} {expected:?}");
            }
        }
        let half = resampled(&map, [0.0, 0.0, 1.0, 1.0], [20, 10]);
        assert_eq!(half.get(3, 4), Some(&[6.5, 8.5, 1.0, 0.0]));
        assert_eq!(resampled(&map, [0.0, 0.0, 1.0, 1.0], [40, 20]), map);
    }
}
