//! How stones fill a wall: bonds and rubble as convex cells that meet along their edges.
//!
//! Wall coordinates: x right, y down, in pixels of the photo at its centre.

use super::cell::{Extent, Ring, along};
use super::draw::{Rng, between, chance, log_between, normal};
use super::rubble::lay_rubble;

/// How the stones of a wall are laid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bond {
    /// Courses of squared blocks.
    Courses(Courses),
    /// Bricks of one size.
    Brick {
        /// Length over height, 1.5 to 4.5.
        aspect: f32,
        /// How headers and stretchers alternate.
        pattern: BrickPattern,
    },
    /// Squared blocks of several sizes without through-going courses (snecked masonry).
    Squared {
        /// Width of the grid that the blocks share, over its height, 0.8 to 2.
        aspect: f32,
        /// Shift of its corners in parts of a grid cell, 0 to 0.2.
        jitter: f32,
    },
    /// One course that fills the height, as the stones of an arch do.
    Row {
        /// Mean length over height, 0.35 to 1.2.
        aspect: f32,
    },
    /// Irregular polygons: random rubble, cobbles, dry stone.
    Rubble {
        /// Mean length over height, 0.8 to 2.2.
        aspect: f32,
        /// Probability that a place for a large stone is filled with four smaller, twice over, 0 to 0.8.
        mixture: f32,
        /// Shift of the stones' centres in parts of their spacing, 0.1 to 0.9.
        disorder: f32,
    },
}

/// Courses of squared blocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Courses {
    /// Median length over height, 0.9 to 3.
    pub aspect: f32,
    /// Standard deviation of the logarithm of the courses' heights, 0 to 0.35.
    pub height_spread: f32,
    /// Standard deviation of the logarithm of the blocks' lengths, 0.05 to 0.5.
    pub length_spread: f32,
    /// Sideways lean of the vertical joints in parts of the height, 0 to 0.3.
    pub lean: f32,
    /// Probability that a block is replaced by two thinner ones, 0 to 0.35.
    pub split: f32,
}

/// How headers (short faces) and stretchers (long faces) of bricks alternate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BrickPattern {
    /// Stretchers, shifted by half a length from course to course.
    Running,
    /// Stretchers without shift.
    Stack,
    /// Courses of headers and of stretchers in turn.
    English,
    /// Headers and stretchers in turn within each course.
    Flemish,
}

impl Bond {
    /// A bond drawn at random: courses and rubble over a third each, squared blocks, bricks.
    pub(super) fn random(rng: &mut Rng) -> Self {
        let kind = between(rng, 0.0, 1.0);
        if kind < 0.32 {
            let regular = chance(rng, 0.4);
            Self::Courses(Courses {
                aspect: log_between(rng, 0.9, 3.0),
                height_spread: if regular { 0.0 } else { between(rng, 0.0, 0.35) },
                length_spread: between(rng, 0.05, 0.5),
                lean: if regular { 0.0 } else { between(rng, 0.0, 0.3) },
                split: if regular { 0.0 } else { between(rng, 0.0, 0.35) },
            })
        } else if kind < 0.74 {
            Self::Rubble {
                aspect: log_between(rng, 0.8, 2.2),
                mixture: between(rng, 0.0, 0.8),
                disorder: between(rng, 0.1, 0.9),
            }
        } else if kind < 0.9 {
            Self::Squared {
                aspect: log_between(rng, 0.8, 2.0),
                jitter: between(rng, 0.0, 0.2),
            }
        } else {
            let pattern = match rng_index(rng, 5) {
                0 => BrickPattern::Stack,
                1 => BrickPattern::English,
                2 => BrickPattern::Flemish,
                _ => BrickPattern::Running,
            };
            Self::Brick {
                aspect: between(rng, 1.5, 4.5),
                pattern,
            }
        }
    }

    /// Cells that fill the extent and reach a little beyond it; `size` is about the square root of a stone's
    /// area.
    pub(super) fn lay(&self, size: f32, extent: Extent, rng: &mut Rng) -> Vec<Ring> {
        match *self {
            Self::Courses(courses) => lay_courses(&courses, size, extent, rng),
            Self::Brick { aspect, pattern } => lay_bricks(aspect, pattern, size, extent, rng),
            Self::Squared { aspect, jitter } => lay_squared(aspect, jitter, size, extent, rng),
            Self::Row { aspect } => lay_row(aspect, extent, rng),
            Self::Rubble {
                aspect,
                mixture,
                disorder,
            } => lay_rubble(aspect, mixture, disorder, size, extent, rng),
        }
    }
}

fn rng_index(rng: &mut Rng, count: usize) -> usize {
    (between(rng, 0.0, count as f32) as usize).min(count - 1)
}

fn lay_courses(courses: &Courses, size: f32, extent: Extent, rng: &mut Rng) -> Vec<Ring> {
    let median_height = size / courses.aspect.sqrt();
    let mut cells = Vec::new();
    let mut top = extent[1] - between(rng, 0.0, median_height);

    while top < extent[3] {
        let height = median_height * (courses.height_spread * normal(rng)).clamp(-0.8, 0.8).exp();
        let bottom = top + height;
        let joint = |x: f32, rng: &mut Rng| {
            let lean = courses.lean * height * between(rng, -0.5, 0.5);
            [x + lean, x - lean]
        };
        let mut x = extent[0] - between(rng, 0.0, size);
        let mut left = joint(x, rng);
        while x < extent[2] {
            let stretch = (courses.length_spread * normal(rng)).clamp(-1.2, 1.2).exp();
            x += (median_height * courses.aspect * stretch).max(0.4 * height);
            let right = joint(x, rng);
            let block = [
                [left[0], top],
                [right[0], top],
                [right[1], bottom],
                [left[1], bottom],
            ];
            if chance(rng, courses.split) {
                split_block(block, rng, &mut cells);
            } else {
                cells.push(block.to_vec());
            }
            left = right;
        }
        top = bottom;
    }

    cells
}

fn lay_row(aspect: f32, [left, top, right, bottom]: Extent, rng: &mut Rng) -> Vec<Ring> {
    let mut cells = Vec::new();
    let mut x = left;
    while x < right {
        let next = x + (bottom - top) * aspect * (0.15 * normal(rng)).exp();
        cells.push(vec![[x, top], [next, top], [next, bottom], [x, bottom]]);
        x = next;
    }
    cells
}

/// Two blocks one above the other, each at times cut in two side by side.
fn split_block(block: [[f32; 2]; 4], rng: &mut Rng, cells: &mut Vec<Ring>) {
    let at = between(rng, 0.3, 0.7);
    let slope = between(rng, -0.08, 0.08);
    let (left, right) = (
        along(block[0], block[3], at + slope),
        along(block[1], block[2], at - slope),
    );
    for half in [
        [block[0], block[1], right, left],
        [left, right, block[2], block[3]],
    ] {
        if chance(rng, 0.45) {
            let cut = between(rng, 0.3, 0.7);
            let (top, bottom) = (
                along(half[0], half[1], cut),
                along(half[3], half[2], cut + between(rng, -0.06, 0.06)),
            );
            cells.push(vec![half[0], top, bottom, half[3]]);
            cells.push(vec![top, half[1], half[2], bottom]);
        } else {
            cells.push(half.to_vec());
        }
    }
}

fn lay_bricks(aspect: f32, pattern: BrickPattern, size: f32, extent: Extent, rng: &mut Rng) -> Vec<Ring> {
    let height = size / aspect.sqrt();
    let length = height * aspect;
    let (x0, y0) = (
        extent[0] - between(rng, 0.0, length),
        extent[1] - between(rng, 0.0, height),
    );
    let courses = ((extent[3] - y0) / height).ceil().max(1.0) as usize;
    let mut cells = Vec::new();

    for course in 0..courses {
        let odd = course % 2 == 1;
        let top = y0 + course as f32 * height;
        let mut x = x0
            - match pattern {
                BrickPattern::Running if odd => 0.5 * length,
                BrickPattern::English if odd => 0.25 * length,
                BrickPattern::Flemish if odd => 0.75 * length,
                _ => 0.0,
            };
        let mut header = pattern == BrickPattern::English && odd;
        while x < extent[2] {
            let width = if header { 0.5 * length } else { length };
            let wobble = 0.012 * height;
            let right = x + width * (1.0 + 0.01 * normal(rng));
            let (low, high) = (top + wobble * normal(rng), top + height + wobble * normal(rng));
            cells.push(vec![[x, low], [right, low], [right, high], [x, high]]);
            x += width;
            if pattern == BrickPattern::Flemish {
                header = !header;
            }
        }
    }

    cells
}

/// Fills a grid, in reading order, with blocks of random numbers of rows and columns.
fn lay_squared(aspect: f32, jitter: f32, size: f32, extent: Extent, rng: &mut Rng) -> Vec<Ring> {
    let row = 0.62 * size / aspect.sqrt();
    let column = row * aspect;
    let columns = ((extent[2] - extent[0]) / column).ceil().max(1.0) as usize + 4;
    let rows = ((extent[3] - extent[1]) / row).ceil().max(1.0) as usize + 3;
    let corners: Vec<[f32; 2]> = (0..(columns + 1) * (rows + 1))
        .map(|i| {
            let (c, r) = ((i % (columns + 1)) as f32, (i / (columns + 1)) as f32);
            [
                extent[0] + column * (c - 2.0 + jitter * between(rng, -1.0, 1.0)),
                extent[1] + row * (r - 1.5 + jitter * between(rng, -1.0, 1.0)),
            ]
        })
        .collect();
    let corner = |c: usize, r: usize| corners[r * (columns + 1) + c];

    let mut taken = vec![false; columns * rows];
    let mut cells = Vec::new();
    for r in 0..rows {
        for c in 0..columns {
            if taken[r * columns + c] {
                continue;
            }
            let most = 1 + rng_index(rng, 3);
            let wide = (1..=most)
                .take_while(|k| c + k <= columns && !taken[r * columns + c + k - 1])
                .count();
            let high = (1 + rng_index(rng, 3)).min(rows - r).min(wide + 1);
            for y in r..r + high {
                taken[y * columns + c..y * columns + c + wide].fill(true);
            }
            cells.push(vec![
                corner(c, r),
                corner(c + wide, r),
                corner(c + wide, r + high),
                corner(c, r + high),
            ]);
        }
    }

    cells
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::synth::cell::contains;
    use rand::SeedableRng;

    #[test]
    fn cells_cover_the_extent_once() {
        let extent = [-150.0, -90.0, 130.0, 110.0];
        for seed in 0..40 {
            let mut rng = Rng::seed_from_u64(seed);
            let bond = Bond::random(&mut rng);
            let cells = bond.lay(24.0, extent, &mut rng);
            let (mut covered, mut doubly) = (0, 0);
            for _ in 0..400 {
                let p = [between(&mut rng, -150.0, 130.0), between(&mut rng, -90.0, 110.0)];
                let count = cells.iter().filter(|ring| contains(ring, p)).count();
                covered += usize::from(count > 0);
                doubly += usize::from(count > 1);
            }
            assert!(covered >= 380, "{bond:?}: {covered}");
            assert!(doubly <= 24, "{bond:?}: {doubly}");
        }
    }
}
