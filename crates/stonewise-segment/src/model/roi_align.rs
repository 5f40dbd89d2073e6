//! RoIAlign (He et al. 2017, section 3) on a feature pyramid.

use super::boxes::{Bounds, area};
use crate::engine::{SparseMatrix, Tensor};

/// Levels that regions are taken from; the coarsest of the pyramid only makes proposals.
const LEVELS: usize = 4;
/// Features of pixels of this size are the finest.
const FINEST_STRIDE: usize = 4;
/// A region of this size is taken from the level of this place (Lin et al. 2017, eq. 1).
const CANONICAL: (f32, f32) = (224.0, 2.0);
/// Regions that are a level's size but for rounding belong to it.
const LEVEL_EPSILON: f32 = 1e-6;

/// How regions are cut out.
#[derive(Clone, Copy, Debug)]
pub struct RoiAlign {
    /// Cells along a side.
    pub cells: usize,
    /// Sampling points along a side of a cell.
    pub samples: usize,
    /// The value of a feature lies at the centre of its cell; else at its corner, and regions are at least a
    /// feature wide.
    pub half_pixel: bool,
}

/// A pyramid of features as rows of channels: level by level, image, row, column.
#[derive(Clone, Debug)]
pub struct FeatureRows {
    rows: Tensor,
    shape: PyramidShape,
}

/// Sizes of a pyramid.
#[derive(Clone, Debug, PartialEq)]
struct PyramidShape {
    batch: usize,
    /// Columns and rows of each level.
    grids: Vec<[usize; 2]>,
}

impl FeatureRows {
    /// The rows of levels [batch, channels, rows, columns], finest first.
    pub fn new(levels: &[Tensor]) -> Self {
        let levels = &levels[..LEVELS.min(levels.len())];
        let [batch, channels] = levels[0].dims();
        let rows = |level: &Tensor| {
            let [_, _, rows, columns] = level.dims();
            let level = level.clone().reshaped([batch, channels, rows * columns]);
            level.exchanged().reshaped([1, batch * rows * columns * channels])
        };
        let rows = Tensor::joined(&levels.iter().map(rows).collect::<Vec<_>>());
        let count = rows.values().len() / channels.max(1);
        let grid = |level: &Tensor| {
            let [_, _, rows, columns] = level.dims();
            [columns, rows]
        };
        Self {
            rows: rows.reshaped([count, channels]),
            shape: PyramidShape {
                batch,
                grids: levels.iter().map(grid).collect(),
            },
        }
    }

    /// Features [regions, channels, cells, cells] of regions (image, bounds), differentiable with regard to
    /// the features.
    pub fn cut(&self, regions: &[(usize, Bounds)], align: &RoiAlign) -> Tensor {
        let matrix = sampling_matrix(&self.shape, regions, align);
        let [_, channels] = self.rows.dims();
        let (count, cells) = (regions.len(), align.cells);
        let features = self
            .rows
            .gathered(matrix)
            .reshaped([count, cells * cells, channels]);
        features.exchanged().reshaped([count, channels, cells, cells])
    }
}

/// Level of the pyramid, 0 = finest, that a region is taken from (Lin et al. 2017, eq. 1).
fn level_of(bounds: Bounds) -> usize {
    let (size, level) = CANONICAL;
    let level = (level + (area(bounds).max(0.0).sqrt() / size).log2() + LEVEL_EPSILON).floor();
    level.clamp(0.0, (LEVELS - 1) as f32) as usize
}

/// The matrix that takes feature rows to cells: region by region, row, column. A cell is the mean of its
/// sampling points, a point the bilinear mean of the four features around it.
fn sampling_matrix(shape: &PyramidShape, regions: &[(usize, Bounds)], align: &RoiAlign) -> SparseMatrix {
    let mut starts = vec![0usize];
    for [columns, rows] in &shape.grids {
        starts.push(starts[starts.len() - 1] + shape.batch * columns * rows);
    }
    let mut matrix = SparseMatrix::new(starts[starts.len() - 1]);
    for &(image, bounds) in regions {
        let level = level_of(bounds).min(shape.grids.len() - 1);
        let [columns, rows] = shape.grids[level];
        let start = starts[level] + image * columns * rows;
        let scale = 1.0 / (FINEST_STRIDE << level) as f32;
        let xs = samples_along(bounds[0] * scale, bounds[2] * scale, columns, align);
        let ys = samples_along(bounds[1] * scale, bounds[3] * scale, rows, align);
        for ys in ys.chunks(align.samples) {
            for xs in xs.chunks(align.samples) {
                let taps = ys.iter().flatten().flat_map(|&(y, y_weight)| {
                    xs.iter()
                        .flatten()
                        .map(move |&(x, x_weight)| ((start + y * columns + x) as u32, x_weight * y_weight))
                });
                matrix.push_row(taps);
            }
        }
    }
    matrix
}

/// The two features next to each sampling point along an axis and their weights, which are nothing for a
/// point more than a feature outside; a cell's weights sum to one.
fn samples_along(from: f32, to: f32, count: usize, align: &RoiAlign) -> Vec<[(usize, f32); 2]> {
    let offset = if align.half_pixel { 0.5 } else { 0.0 };
    let length = if align.half_pixel {
        to - from
    } else {
        (to - from).max(1.0)
    };
    let points = align.cells * align.samples;
    let share = 1.0 / align.samples as f32;
    let last = count - 1;
    let point = |place: usize| {
        let at = from - offset + (place as f32 + 0.5) * length / points as f32;
        if at < -1.0 || at > count as f32 {
            return [(0, 0.0); 2];
        }
        let at = at.clamp(0.0, last as f32);
        let low = (at as usize).min(last);
        let high = (low + 1).min(last);
        let part = at - low as f32;
        [(low, (1.0 - part) * share), (high, part * share)]
    };
    (0..points).map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALIGN: RoiAlign = RoiAlign {
        cells: 3,
        samples: 2,
        half_pixel: true,
    };

    /// Levels of 2 images of 512 x 256 pixels, 2 channels.
    fn levels(value: impl Fn(usize, [usize; 4]) -> f32) -> Vec<Tensor> {
        let level = |level: usize| {
            let [rows, columns] = [256 >> (2 + level), 512 >> (2 + level)];
            let mut values = Vec::new();
            for image in 0..2 {
                for channel in 0..2 {
                    for row in 0..rows {
                        values.extend((0..columns).map(|column| value(level, [image, channel, row, column])));
                    }
                }
            }
            Tensor::new([2, 2, rows, columns], values)
        };
        (0..4).map(level).collect()
    }

    #[test]
    fn a_linear_image_is_cut_exactly() {
        // A feature's value is that of its centre, in pixels of the image.
        let levels = levels(|level, [image, channel, row, column]| {
            let stride = (4 << level) as f32;
            let [x, y] = [(column as f32 + 0.5) * stride, (row as f32 + 0.5) * stride];
            100.0 * image as f32 + if channel == 0 { x + 2.0 * y } else { -y }
        });
        let bounds = [10.0, 6.0, 52.0, 27.0];
        let cut = FeatureRows::new(&levels).cut(&[(1, bounds), (0, bounds)], &ALIGN);
        assert_eq!(cut.shape(), [2, 2, 3, 3]);
        for (place, value) in cut.values().iter().enumerate() {
            let [column, row, channel, region] = [place % 3, place / 3 % 3, place / 9 % 2, place / 18];
            let [x, y] = [
                10.0 + 14.0 * (column as f32 + 0.5),
                6.0 + 7.0 * (row as f32 + 0.5),
            ];
            let expected = 100.0 * (1 - region) as f32 + if channel == 0 { x + 2.0 * y } else { -y };
            assert!((value - expected).abs() < 1e-3, "{place}: {value} {expected}");
        }
    }

    #[test]
    fn regions_go_to_the_level_of_their_size() {
        let square = |side: f32| level_of([5.0, 5.0, 5.0 + side, 5.0 + side]);
        assert_eq!(
            [20.0, 111.0, 112.0, 223.0, 224.0, 448.0, 2000.0].map(square),
            [0, 0, 1, 1, 2, 3, 3]
        );
    }
}
