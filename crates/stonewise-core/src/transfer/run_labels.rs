//! Label images kept as runs, so that the masks of all photos fit in memory.

use crate::raster::LabelImage;

/// A label image as runs of equal labels per row.
///
/// A 12 MP photo of masonry takes 2 to 3 MB instead of 48: memory follows the length of the borders. A
/// look-up in a block of one label ends there. Another starts at the run in which its part of the row begins,
/// and goes on to the run that holds it: one or two steps.
pub(super) struct RunLabels {
    width: u32,
    /// Start of each row in `runs`; one more entry than rows.
    rows: Vec<u32>,
    /// First column and label of each run.
    runs: Vec<(u32, u32)>,
    /// Run of its row, or one before it, in which each part of [`PART_PX`] begins, row by row.
    parts: Vec<u16>,
    /// The label of all pixels of each block of [`BLOCK_PX`] by as many, row by row; or [`MIXED`].
    blocks: Vec<u32>,
}

/// Pixels of a part of a row: stones are about as wide, so that few runs begin in a part.
const PART_PX: usize = 64;
/// Edge of a block, pixels: of stones of 100 pixels and their joints, two blocks in three have one label.
const BLOCK_PX: usize = 16;
/// Stands for a block with more than one label; no label image uses this number.
const MIXED: u32 = u32::MAX;

impl RunLabels {
    pub(super) fn new(image: &LabelImage) -> Self {
        let width = image.width();
        let mut labels = Self {
            width,
            rows: vec![0],
            runs: Vec::new(),
            parts: Vec::new(),
            blocks: Vec::new(),
        };
        let rows = image.data().chunks_exact(width.max(1) as usize);
        for (y, row) in rows.enumerate() {
            labels.add_row(row);
            labels.add_to_blocks(y, row);
        }
        labels
    }

    fn add_to_blocks(&mut self, y: usize, row: &[u32]) {
        if y.is_multiple_of(BLOCK_PX) {
            self.blocks.extend(row.iter().step_by(BLOCK_PX));
        }
        let first = self.blocks.len() - row.len().div_ceil(BLOCK_PX);
        for (block, pixels) in self.blocks[first..].iter_mut().zip(row.chunks(BLOCK_PX)) {
            if !all_are(pixels, *block) {
                *block = MIXED;
            }
        }
    }

    fn add_row(&mut self, row: &[u32]) {
        let start = self.runs.len();
        for (part, pixels) in row.chunks(PART_PX).enumerate() {
            let mut previous = (self.runs.len() > start).then(|| self.runs[self.runs.len() - 1].1);
            let open = (self.runs.len() - start).saturating_sub(1);
            self.parts.push(open.min(usize::from(u16::MAX)) as u16);
            if previous.is_some_and(|label| all_are(pixels, label)) {
                continue;
            }
            for (x, &label) in (part * PART_PX..).zip(pixels) {
                if previous != Some(label) {
                    self.runs.push((x as u32, label));
                    previous = Some(label);
                }
            }
        }
        self.rows.push(self.runs.len() as u32);
    }

    /// Label under a pixel coordinate; `None` outside.
    #[inline]
    pub(super) fn at(&self, pixel: [f64; 2]) -> Option<u32> {
        let [x, y] = pixel;
        if !(x >= 0.0 && y >= 0.0 && x < f64::from(self.width)) {
            return None;
        }
        let (x, y) = (x as u32 as usize, y as u32 as usize);
        let columns = (self.width as usize).div_ceil(BLOCK_PX);
        // Beyond the last row there may be pixels of the last blocks.
        let label = *self.blocks.get(y / BLOCK_PX * columns + x / BLOCK_PX)?;
        if label != MIXED && y + 1 < self.rows.len() {
            return Some(label);
        }
        let row = &self.runs[*self.rows.get(y)? as usize..*self.rows.get(y + 1)? as usize];
        let parts = (self.width as usize).div_ceil(PART_PX);
        let mut at = usize::from(*self.parts.get(y * parts + x / PART_PX)?);
        while row.get(at + 1).is_some_and(|next| next.0 as usize <= x) {
            at += 1;
        }
        Some(row.get(at)?.1)
    }
}

/// Whether all pixels have this label; without a branch for each of them.
#[inline]
fn all_are(pixels: &[u32], label: u32) -> bool {
    pixels
        .iter()
        .fold(0, |differing, &pixel| differing | (pixel ^ label))
        == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_reads_back() {
        let data: Vec<u32> = (0..7 * 5).map(|i| (i * i / 9) % 4).collect();
        let image = LabelImage::from_vec(7, 5, data).unwrap();
        let runs = RunLabels::new(&image);
        for y in 0..5 {
            for x in 0..7 {
                let pixel = [f64::from(x) + 0.9, f64::from(y) + 0.1];
                assert_eq!(runs.at(pixel), image.at(pixel).copied());
            }
        }
        let wide: Vec<u32> = (0..3 * 1000u32)
            .map(|i| (i.wrapping_mul(2_654_435_761) >> 27) & (i >> 5))
            .collect();
        let image = LabelImage::from_vec(1000, 3, wide).unwrap();
        let wide = RunLabels::new(&image);
        for (i, &label) in image.data().iter().enumerate() {
            assert_eq!(
                wide.at([(i % 1000) as f64 + 0.5, (i / 1000) as f64]),
                Some(label),
                "{i}"
            );
        }
        // Patches that are wider and narrower than a block, cut off by the borders.
        let patches = (0..70 * 53u32).map(|i| ((i % 70 + 3) / 21) * 10 + (i / 70 + 5) / 19);
        let image = LabelImage::from_vec(70, 53, patches.collect()).unwrap();
        let patched = RunLabels::new(&image);
        for (i, &label) in image.data().iter().enumerate() {
            let pixel = [(i % 70) as f64 + 0.3, (i / 70) as f64 + 0.6];
            assert_eq!(patched.at(pixel), Some(label), "{i}");
        }
        assert!(patched.blocks.contains(&MIXED) && patched.blocks.iter().any(|b| *b != MIXED));
        for pixel in [[3.0, 53.0], [3.0, 60.0], [70.0, 3.0]] {
            assert_eq!(patched.at(pixel), None);
        }
        for pixel in [[-0.1, 2.0], [7.0, 2.0], [3.0, 5.0], [3.0, -0.5], [f64::NAN, 1.0]] {
            assert_eq!(runs.at(pixel), None);
        }
    }
}
