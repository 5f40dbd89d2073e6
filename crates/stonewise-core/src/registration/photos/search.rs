//! Search for the shift of whole cells at which a photo agrees best with a template.

use super::matching::{FaceCells, LEAST_SHARE, Template};
use super::patch::Patch;
use super::surface::Surface;
use nalgebra::Vector2;
use std::ops::Range;

/// Cells that are summed side by side.
const LANES: usize = 16;

/// A template to be sought in a photo.
pub(super) struct Search<'a> {
    surface: &'a Surface,
    template: Shown,
    /// Cells of the face.
    count: usize,
    /// Rows and columns that hold them.
    rows: Range<usize>,
    columns: Range<usize>,
}

/// Values of what is shown, zero elsewhere; their squares; one where shown.
struct Shown {
    values: Vec<f32>,
    squares: Vec<f32>,
    shown: Vec<f32>,
}

impl Shown {
    fn new(patch: &Patch, is_shown: impl Fn(usize) -> bool) -> Self {
        let shown: Vec<f32> = (0..patch.values.len())
            .map(|k| f32::from(u8::from(patch.valid[k] && is_shown(k))))
            .collect();
        let values: Vec<f32> = patch.values.iter().zip(&shown).map(|(v, s)| v * s).collect();
        Self {
            squares: values.iter().map(|v| v * v).collect(),
            values,
            shown,
        }
    }
}

impl<'a> Search<'a> {
    pub fn new(template: &Template, surface: &'a Surface, cells: &FaceCells) -> Self {
        Self {
            surface,
            template: Shown::new(&template.patch, |k| surface.inside[k]),
            count: cells.count(),
            rows: cells.rows.clone(),
            columns: cells.columns.clone(),
        }
    }

    /// Correlation of a photo with the template at a shift (columns, rows); `None` where it does not show the
    /// face.
    fn correlation(&self, photo: &Shown, shift: [isize; 2]) -> Option<f64> {
        let width = self.surface.columns;
        let columns = shifted(&self.columns, shift[0], width);
        let rows = shifted(&self.rows, shift[1], self.surface.rows);
        if columns.is_empty() {
            return None;
        }
        let mut sums = [[0.0; LANES]; 4];
        for row in rows {
            let from = row * width + columns.start;
            let to = row.wrapping_add_signed(shift[1]) * width + columns.start.wrapping_add_signed(shift[0]);
            let [t, p] = [(&self.template, from), (photo, to)].map(|(shown, start)| {
                let cells = start..start + columns.len();
                [
                    &shown.values[cells.clone()],
                    &shown.squares[cells.clone()],
                    &shown.shown[cells],
                ]
            });
            add_products(&mut sums[0], t[0], p[0]);
            add_products(&mut sums[1], t[1], p[2]);
            add_products(&mut sums[2], t[2], p[1]);
            add_products(&mut sums[3], t[2], p[2]);
        }
        let [tp, tt, pp, shown] = sums.map(|lanes| f64::from(lanes.iter().sum::<f32>()));
        let shows = shown >= LEAST_SHARE * self.count as f64;
        (shows && tt > 0.0 && pp > 0.0).then(|| tp / (tt * pp).sqrt())
    }

    /// The shift, within `reach` cells, at which a photo agrees best with the template, and their correlation
    /// there.
    pub fn best_shift(&self, photo: &Patch, reach: isize) -> Option<(Vector2<f64>, f64)> {
        let photo = Shown::new(photo, |_| true);
        let mut best: Option<(f64, [isize; 2])> = None;
        for y in -reach..=reach {
            for x in -reach..=reach {
                if x * x + y * y > reach * reach {
                    continue;
                }
                if let Some(score) = self.correlation(&photo, [x, y])
                    && best.is_none_or(|(b, _)| score > b)
                {
                    best = Some((score, [x, y]));
                }
            }
        }
        best.map(|(score, [x, y])| (Vector2::new(x as f64, y as f64), score))
    }
}

/// The indices of a range that lie on the grid after a shift.
fn shifted(range: &Range<usize>, shift: isize, size: usize) -> Range<usize> {
    let least = 0usize.saturating_add_signed(-shift);
    let most = size.saturating_add_signed(-shift);
    let start = range.start.max(least);
    start..range.end.min(most).max(start)
}

/// Adds products of two lines of equal length in lanes.
fn add_products(sums: &mut [f32; LANES], a: &[f32], b: &[f32]) {
    let (a, a_rest) = a.as_chunks::<LANES>();
    let (b, b_rest) = b.as_chunks::<LANES>();
    for (a, b) in a.iter().zip(b) {
        for k in 0..LANES {
            sums[k] += a[k] * b[k];
        }
    }
    for (k, (a, b)) in a_rest.iter().zip(b_rest).enumerate() {
        sums[k] += a * b;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::split_mix;

    const SIDE: usize = 40;

    fn drawn(seed: u64) -> Patch {
        let number = |k: usize, purpose: u64| {
            split_mix(seed ^ split_mix(k as u64 * 2 + purpose)) as f64 / u64::MAX as f64
        };
        let values = (0..SIDE * SIDE).map(|k| number(k, 0) as f32 - 0.5).collect();
        let valid = (0..SIDE * SIDE).map(|k| number(k, 1) > 0.1).collect();
        Patch::new(values, valid, SIDE)
    }

    /// Cell by cell, in double precision.
    fn correlation(surface: &Surface, template: &Patch, photo: &Patch, shift: [isize; 2]) -> Option<f64> {
        let (mut tt, mut tp, mut pp, mut count, mut cells) = (0.0, 0.0, 0.0, 0, 0);
        for k in (0..SIDE * SIDE).filter(|&k| surface.inside[k]) {
            cells += 1;
            let x = (k % SIDE) as isize + shift[0];
            let y = (k / SIDE) as isize + shift[1];
            let range = 0..SIDE as isize;
            if !range.contains(&x) || !range.contains(&y) {
                continue;
            }
            let to = y as usize * SIDE + x as usize;
            if template.valid[k] && photo.valid[to] {
                let (t, p) = (f64::from(template.values[k]), f64::from(photo.values[to]));
                tt += t * t;
                tp += t * p;
                pp += p * p;
                count += 1;
            }
        }
        (f64::from(count) >= LEAST_SHARE * f64::from(cells)).then(|| tp / f64::sqrt(tt * pp))
    }

    #[test]
    fn correlations_are_those_of_the_cells_one_by_one() {
        let surface = Surface::flat(SIDE, 9);
        let (first, photo) = (drawn(3), drawn(4));
        let template = Template::new(drawn(3), &surface);
        let search = Search::new(&template, &surface, &FaceCells::new(&surface));
        let shown = Shown::new(&photo, |_| true);
        for shift in [
            [0, 0],
            [3, -2],
            [-11, 5],
            [14, 14],
            [-25, 0],
            [60, -60],
            [60, 5],
            [-60, 5],
        ] {
            let found = search.correlation(&shown, shift);
            let expected = correlation(&surface, &first, &photo, shift);
            match (found, expected) {
                (Some(f), Some(e)) => assert!((f - e).abs() < 1e-5, "{shift:?}: {f} {e}"),
                _ => assert_eq!(found, expected, "{shift:?}"),
            }
        }
        assert_eq!(search.correlation(&shown, [-25, 0]), None);
    }
}
