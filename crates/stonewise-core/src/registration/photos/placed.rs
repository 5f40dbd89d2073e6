//! Photos brought onto a stone's face where it lies in the world.

use super::photo::{Chip, Photo};
use super::surface::Surface;
use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};

/// Spacing of the cells that are projected into a photo; the pixels of the others are interpolated. Over four
/// cells, the interpolation error in an oblique photo is a few thousandths of a pixel.
const NODE_CELLS: usize = 4;
/// Step out of the face whose shift in a photo is its parallax, metres.
const STEP_M: f64 = 0.001;

/// A rigid motion of a stone, in its frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FaceMotion {
    pub translation: Vector3<f64>,
    pub rotation: Vector3<f64>,
}

impl FaceMotion {
    /// No motion.
    pub fn none() -> Self {
        Self {
            translation: Vector3::zeros(),
            rotation: Vector3::zeros(),
        }
    }

    /// Displacement of a place on the face, small angles, metres.
    pub fn at(&self, place: [f64; 2]) -> Vector3<f64> {
        self.translation + self.rotation.cross(&Vector3::new(place[0], place[1], 0.0))
    }
}

/// Where a stone's face lies.
pub(crate) struct Placed<'a> {
    pub surface: &'a Surface,
    pub centroid: Point3<f64>,
    pub face_from_world: &'a Matrix3<f64>,
}

impl Placed<'_> {
    /// World point of a place in the stone's frame after a motion.
    fn world(&self, at: Vector3<f64>, motion: &FaceMotion, turn: &UnitQuaternion<f64>) -> Point3<f64> {
        self.centroid + self.face_from_world.transpose() * (turn * at + motion.translation)
    }

    /// Grey values of a photo on the moved face; `None` where the photo does not show it.
    pub fn grey(&self, photo: &Photo, chip: &Chip, motion: &FaceMotion) -> Vec<Option<f32>> {
        let pixels = self.pixels(photo, motion);
        pixels.iter().map(|pixel| chip.sample((*pixel)?)).collect()
    }

    /// Pixels of the cells of the moved face, interpolated between those of nodes.
    fn pixels(&self, photo: &Photo, motion: &FaceMotion) -> Vec<Option<[f64; 2]>> {
        let surface = self.surface;
        let nodes = self.nodes(photo, motion);
        let lines: Vec<&[Option<Node>]> = nodes.chunks(nodes_across(surface.columns)).collect();
        let share = |cell: usize| (cell % NODE_CELLS) as f64 / NODE_CELLS as f64;
        let mut pixels = Vec::with_capacity(surface.heights.len());
        for (row, heights) in surface.heights.chunks(surface.columns).enumerate() {
            let (below, above) = (lines[row / NODE_CELLS], lines[row / NODE_CELLS + 1]);
            let line: Vec<Option<Node>> = below
                .iter()
                .zip(above)
                .map(|(a, b)| Node::between(a, b, share(row)))
                .collect();
            pixels.extend(heights.iter().enumerate().map(|(column, height)| {
                let node = column / NODE_CELLS;
                let at = Node::between(&line[node], &line[node + 1], share(column))?;
                Some(at.pixel_at(*height))
            }));
        }
        pixels
    }

    /// Nodes of the moved face in a photo, one every `NODE_CELLS` cells, row by row; the last ones lie on the
    /// border of the grid or beyond.
    fn nodes(&self, photo: &Photo, motion: &FaceMotion) -> Vec<Option<Node>> {
        let surface = self.surface;
        let turn = UnitQuaternion::from_scaled_axis(motion.rotation);
        let node = |column: usize, row: usize| {
            let place = [column, row];
            let [u, v] = [0, 1].map(|a| surface.first[a] + place[a] as f64 * surface.cell_m);
            let near = row.min(surface.rows - 1) * surface.columns + column.min(surface.columns - 1);
            let height = surface.heights[near];
            let pixel = |height: f64| {
                photo
                    .camera
                    .project(&self.world(Vector3::new(u, v, height), motion, &turn))
            };
            let (pixel, above) = (pixel(height)?, pixel(height + STEP_M)?);
            Some(Node {
                height,
                pixel,
                parallax: [0, 1].map(|a| (above[a] - pixel[a]) / STEP_M),
            })
        };
        let columns = nodes_across(surface.columns);
        (0..columns * nodes_across(surface.rows))
            .map(|k| node(k % columns * NODE_CELLS, k / columns * NODE_CELLS))
            .collect()
    }
}

/// Nodes along a side of this many cells.
fn nodes_across(cells: usize) -> usize {
    cells.div_ceil(NODE_CELLS) + 1
}

/// A place of a face in a photo.
#[derive(Clone, Copy)]
struct Node {
    /// Height of the place, metres.
    height: f64,
    /// Its pixel.
    pixel: [f64; 2],
    /// Shift of that pixel per height, pixels per metre.
    parallax: [f64; 2],
}

impl Node {
    /// A place between two, at a share of their distance; `None` where the photo does not see one of them.
    #[inline]
    fn between(a: &Option<Self>, b: &Option<Self>, share: f64) -> Option<Self> {
        let (Some(a), Some(b)) = (a, b) else {
            return None;
        };
        let mix = |a: f64, b: f64| a + share * (b - a);
        Some(Self {
            height: mix(a.height, b.height),
            pixel: [mix(a.pixel[0], b.pixel[0]), mix(a.pixel[1], b.pixel[1])],
            parallax: [
                mix(a.parallax[0], b.parallax[0]),
                mix(a.parallax[1], b.parallax[1]),
            ],
        })
    }

    /// Pixel of a point at another height above this place.
    #[inline]
    fn pixel_at(&self, height: f64) -> [f64; 2] {
        let above = height - self.height;
        [
            self.pixel[0] + above * self.parallax[0],
            self.pixel[1] + above * self.parallax[1],
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{SIDE, oblique};
    use super::*;
    use crate::statistics::split_mix;

    #[test]
    fn interpolated_pixels_are_those_of_the_cells_one_by_one() {
        let (photo, centroid, face_from_world) = oblique();
        let mut surface = Surface::flat(SIDE - 1, 12);
        // Relief of 2 cm with steps of up to 2 mm from cell to cell.
        for (k, height) in surface.heights.iter_mut().enumerate() {
            let roughness = split_mix(k as u64) as f64 / u64::MAX as f64;
            *height = 0.02 * (0.1 * (k % SIDE) as f64).sin() + 0.002 * roughness;
        }
        let placed = Placed {
            surface: &surface,
            centroid,
            face_from_world: &face_from_world,
        };
        let motion = FaceMotion {
            translation: Vector3::new(0.02, -0.01, 0.03),
            rotation: Vector3::new(0.01, 0.02, -0.03),
        };
        let turn = UnitQuaternion::from_scaled_axis(motion.rotation);
        for (k, found) in placed.pixels(&photo, &motion).iter().enumerate() {
            let [u, v] = surface.place(k);
            let world = placed.world(Vector3::new(u, v, surface.heights[k]), &motion, &turn);
            let expected = photo.camera.project(&world).unwrap();
            let apart = [0, 1].map(|a| found.unwrap()[a] - expected[a]);
            assert!(apart.iter().all(|d| d.abs() < 0.005), "{k}: {apart:?}");
        }
    }
}
