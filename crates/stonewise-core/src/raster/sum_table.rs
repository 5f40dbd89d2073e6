//! Sums over windows of an image.

/// Sums of `N` terms over all pixels above and to the left of a corner, from which those of any window
/// follow.
///
/// Source: Crow (1984). Cost: `8 N` bytes a pixel; a window takes four look-ups, whatever its size.
pub(crate) struct SumTable<const N: usize> {
    /// Columns and rows of pixels; the table has one more of each.
    size: [usize; 2],
    sums: Vec<[f64; N]>,
}

impl<const N: usize> SumTable<N> {
    /// Sums of the terms of each pixel (column, row); a pixel without terms adds nothing.
    pub(crate) fn new(size: [usize; 2], terms: impl Fn(usize, usize) -> Option<[f64; N]>) -> Self {
        let stride = size[0] + 1;
        let mut sums = vec![[0.0; N]; stride * (size[1] + 1)];
        for y in 0..size[1] {
            let mut row = [0.0; N];
            for x in 0..size[0] {
                if let Some(terms) = terms(x, y) {
                    row.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
                }
                let above = sums[y * stride + x + 1];
                sums[(y + 1) * stride + x + 1] = std::array::from_fn(|i| above[i] + row[i]);
            }
        }
        Self { size, sums }
    }

    /// Columns and rows of pixels.
    pub(crate) fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Sums of the window of `2 half + 1` pixels around a pixel (column, row), cut at the border.
    pub(crate) fn window(&self, at: [usize; 2], half: usize) -> [f64; N] {
        let stride = self.size[0] + 1;
        let low = at.map(|c| c.saturating_sub(half));
        let high = [0, 1].map(|axis| (at[axis] + half + 1).min(self.size[axis]));
        let corner = |x: usize, y: usize| &self.sums[y * stride + x];
        let (a, b) = (corner(low[0], low[1]), corner(high[0], low[1]));
        let (c, d) = (corner(low[0], high[1]), corner(high[0], high[1]));
        std::array::from_fn(|i| d[i] - b[i] - c[i] + a[i])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_hold_the_sums_of_their_pixels() {
        // Integers, so that sums are exact; every fifth pixel has no terms.
        let size = [7, 5];
        let value = |x: usize, y: usize| {
            let v = ((3 * x + 11 * y) % 13) as f64;
            (!(x + y).is_multiple_of(5)).then_some([v, 1.0])
        };
        let table = SumTable::new(size, value);
        for (x, y, half) in (0..7).flat_map(|x| (0..5).flat_map(move |y| (0..9).map(move |h| (x, y, h)))) {
            let mut expected = [0.0; 2];
            for (i, j) in (0..7).flat_map(|i| (0..5).map(move |j| (i, j))) {
                if usize::abs_diff(i, x) <= half && usize::abs_diff(j, y) <= half {
                    let terms = value(i, j).unwrap_or_default();
                    expected = [expected[0] + terms[0], expected[1] + terms[1]];
                }
            }
            assert_eq!(table.window([x, y], half), expected, "{half} around {x}, {y}");
        }
    }
}
