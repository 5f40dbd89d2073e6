//! RoIAlign (He et al. 2017, section 3) on a feature pyramid.

use super::boxes::{Bounds, area};
use super::kernels::{ModelBackend, float, primitive};
use super::sparse::SparseMatrix;
use burn::tensor::Tensor;
use std::sync::Arc;

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
pub struct FeatureRows<B: ModelBackend> {
    rows: Tensor<B, 2>,
    shape: PyramidShape,
}

/// Sizes of a pyramid.
#[derive(Clone, Debug, PartialEq)]
struct PyramidShape {
    batch: usize,
    /// Columns and rows of each level.
    grids: Vec<[usize; 2]>,
}

impl<B: ModelBackend> FeatureRows<B> {
    /// Of levels [batch, channels, rows, columns], finest first.
    pub fn new(levels: &[Tensor<B, 4>]) -> Self {
        let levels = &levels[..LEVELS.min(levels.len())];
        let [batch, channels, _, _] = levels[0].dims();
        let rows = |level: &Tensor<B, 4>| {
            let [_, _, rows, columns] = level.dims();
            let last = level.clone().permute([0, 2, 3, 1]);
            last.reshape([batch * rows * columns, channels])
        };
        Self {
            rows: Tensor::cat(levels.iter().map(rows).collect(), 0),
            shape: PyramidShape {
                batch,
                grids: levels
                    .iter()
                    .map(|level| [level.dims()[3], level.dims()[2]])
                    .collect(),
            },
        }
    }

    /// Features [regions, channels, cells, cells] of regions (image, bounds), differentiable with regard to
    /// the features.
    pub fn cut(&self, regions: &[(usize, Bounds)], align: &RoiAlign) -> Tensor<B, 4> {
        let matrix = Arc::new(sampling_matrix(&self.shape, regions, align));
        let channels = self.rows.dims()[1];
        let product = B::sparse_product(&matrix, primitive(self.rows.clone()));
        let cells = align.cells * align.cells;
        let product = float::<B, 2>(product).reshape([regions.len(), cells, channels]);
        float::<B, 3>(B::exchanged(primitive(product))).reshape([
            regions.len(),
            channels,
            align.cells,
            align.cells,
        ])
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
    use burn::backend::{Autodiff, Flex};
    use burn::tensor::TensorData;

    const ALIGN: RoiAlign = RoiAlign {
        cells: 3,
        samples: 2,
        half_pixel: true,
    };

    /// Levels of 2 images of 512 x 256 pixels, 2 channels.
    fn levels<B: ModelBackend>(value: impl Fn(usize, [usize; 4]) -> f32) -> Vec<Tensor<B, 4>> {
        let device = B::Device::default();
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
            Tensor::from_data(TensorData::new(values, [2, 2, rows, columns]), &device)
        };
        (0..4).map(level).collect()
    }

    #[test]
    fn a_linear_image_is_cut_exactly() {
        // A feature's value is that of its centre, in pixels of the image.
        let levels = levels::<Flex>(|level, [image, channel, row, column]| {
            let stride = (4 << level) as f32;
            let [x, y] = [(column as f32 + 0.5) * stride, (row as f32 + 0.5) * stride];
            100.0 * image as f32 + if channel == 0 { x + 2.0 * y } else { -y }
        });
        let bounds = [10.0, 6.0, 52.0, 27.0];
        let cut = FeatureRows::new(&levels).cut(&[(1, bounds), (0, bounds)], &ALIGN);
        assert_eq!(cut.dims(), [2, 2, 3, 3]);
        let values: Vec<f32> = cut.into_data().to_vec().unwrap();
        for (place, value) in values.iter().enumerate() {
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

    #[test]
    fn gradients_are_differences() {
        type Train = Autodiff<Flex>;
        let wave = |level: usize, [image, channel, row, column]: [usize; 4]| {
            (0.2 * (1 + level + 3 * image + 5 * channel + 2 * row + 3 * column) as f32).sin()
        };
        let regions = [(0, [3.0, 2.0, 40.0, 31.0]), (1, [-4.0, 10.0, 300.0, 250.0])];
        // A smooth function of the cut features, and its change where one feature changes.
        let loss = |levels: &[Tensor<Train, 4>]| {
            let cut = FeatureRows::new(levels).cut(&regions, &ALIGN);
            cut.powi_scalar(2).sum()
        };
        let tracked: Vec<_> = levels::<Train>(wave)
            .into_iter()
            .map(Tensor::require_grad)
            .collect();
        let gradients = loss(&tracked).backward();
        let mut seen = 0.0f32;
        for (place, at) in [
            (0, [0, 0, 3, 5]),
            (0, [0, 1, 0, 1]),
            (2, [1, 1, 3, 5]),
            (3, [1, 0, 0, 1]),
        ] {
            let step = 0.05;
            let shifted = |sign: f32| {
                let nudged = |level, here| {
                    wave(level, here)
                        + if (level, here) == (place, at) {
                            sign * step
                        } else {
                            0.0
                        }
                };
                loss(&levels(nudged)).into_scalar()
            };
            let difference = (shifted(1.0) - shifted(-1.0)) / (2.0 * step);
            let [image, channel, row, column] = at;
            let gradient = tracked[place].grad(&gradients).unwrap();
            let gradient = gradient.slice([
                image..image + 1,
                channel..channel + 1,
                row..row + 1,
                column..column + 1,
            ]);
            let gradient: f32 = gradient.into_scalar();
            assert!(
                (gradient - difference).abs() < 2e-3 * difference.abs().max(1.0),
                "{gradient} {difference}"
            );
            seen += gradient.abs();
        }
        assert!(seen > 0.1);
    }
}
