//! Reference boxes (Ren et al. 2015, section 3.1), one set per level of the pyramid (Lin et al. 2017, section
//! 4.1).

use super::boxes::Bounds;
use super::config::AnchorConfig;

/// The boxes around one place, at the origin: all shapes of the first size ratio come together. Corners are
/// whole pixels.
fn cell_anchors(sizes: &[f32], aspect_ratios: &[f32]) -> Vec<Bounds> {
    let mut anchors = Vec::with_capacity(sizes.len() * aspect_ratios.len());
    for &ratio in aspect_ratios {
        let height_ratio = ratio.sqrt();
        let width_ratio = 1.0 / height_ratio;
        for &size in sizes {
            let right = (0.5 * width_ratio * size).round_ties_even();
            let bottom = (0.5 * height_ratio * size).round_ties_even();
            anchors.push([-right, -bottom, right, bottom]);
        }
    }
    anchors
}

/// All reference boxes of an image of `image` pixels (columns, rows) whose levels have `grids` cells
/// (columns, rows): level by level, then row, column, shape.
pub fn anchors(config: &AnchorConfig, image: [usize; 2], grids: &[[usize; 2]]) -> Vec<Vec<Bounds>> {
    let levels = config.sizes.iter().zip(grids);
    let level = |(sizes, grid): (&Vec<f32>, &[usize; 2])| {
        let shapes = cell_anchors(sizes, &config.aspect_ratios);
        let stride = [image[0] / grid[0], image[1] / grid[1]];
        let mut anchors = Vec::with_capacity(grid[0] * grid[1] * shapes.len());
        for row in 0..grid[1] {
            for column in 0..grid[0] {
                let [x, y] = [(column * stride[0]) as f32, (row * stride[1]) as f32];
                anchors.extend(shapes.iter().map(|a| [a[0] + x, a[1] + y, a[2] + x, a[3] + y]));
            }
        }
        anchors
    };
    levels.map(level).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_are_those_that_torchvision_prints() {
        // AnchorGenerator(((32,),), ((0.5, 1.0, 2.0),)).cell_anchors
        let expected = [
            [-23.0, -11.0, 23.0, 11.0],
            [-16.0, -16.0, 16.0, 16.0],
            [-11.0, -23.0, 11.0, 23.0],
        ];
        assert_eq!(cell_anchors(&[32.0], &[0.5, 1.0, 2.0]), expected);
    }

    #[test]
    fn boxes_go_row_by_row() {
        let config = AnchorConfig {
            sizes: [const { Vec::new() }; 5].map(|_: Vec<f32>| vec![8.0]),
            aspect_ratios: vec![1.0],
        };
        let levels = anchors(&config, [64, 32], &[[16, 8], [8, 4], [4, 2], [2, 1], [1, 1]]);
        assert_eq!(
            levels.iter().map(Vec::len).collect::<Vec<_>>(),
            [128, 32, 8, 2, 1]
        );
        assert_eq!(levels[0][17], [0.0, 0.0, 8.0, 8.0]);
        assert_eq!(levels[1][3], [20.0, -4.0, 28.0, 4.0]);
    }
}
