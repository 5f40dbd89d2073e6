//! Relief of a photo: what a cloud says about the surface behind each pixel, whatever the light.

use super::raster_type::Raster;
use super::sum_table::SumTable;
use crate::geometry::Camera;
use rayon::prelude::*;

/// Values of a pixel of a [`ReliefMap`].
pub const RELIEF_CHANNELS: usize = 4;

/// Relief of a photo, at its own or a lower resolution: pixel (x, y) of a map of `width` columns covers the
/// same share of the photo.
///
/// Each pixel holds
///
/// 0. height above the face within 6 cm, `h / (|h| + 1 cm)`: edges and joints, -1 to 1, positive towards the
///    camera,
/// 1. height above the face within 30 cm, `h / (|h| + 4 cm)`: stones before and behind their neighbours, -1
///    to 1,
/// 2. slope: sine of the angle between the two faces, 0 to 1,
/// 3. confidence: 1 where points fall into the pixel itself, else one over one plus the distance, in pixels,
///    within which points were found; 0 where there are none, and then all others are 0, too.
pub type ReliefMap = Raster<[f32; RELIEF_CHANNELS]>;

/// Map pixels per pixel of the photo: a half, as clouds are coarser than photos.
const MAP_SCALE: f64 = 0.5;
/// Most pixels of a map. 4 million: the sums of a map take 300 MB.
const MAX_PIXELS: f64 = 4e6;
/// Half the side of the windows in which the face is sought, metres on the face. 0.06: wider than a joint,
/// narrower than a stone; 0.3: a stone and its neighbours.
const FACE_M: [f64; 2] = [0.06, 0.3];
/// Least half sides of these windows, map pixels: a plane needs that many.
const LEAST_FACE_PX: [usize; 2] = [2, 6];
/// Heights that are brought to a half, metres: those of an open joint and of a stone that stands out.
const HALF_HEIGHT_M: [f64; 2] = [0.01, 0.04];
/// Half sides of the windows that are searched for points one after the other, map pixels; farther points say
/// nothing about a pixel.
const SEARCH_PX: [usize; 6] = [0, 1, 2, 4, 8, 16];
/// Points of which a height is the mean, at least: takes 40 % off the noise.
const LEAST_POINTS: f64 = 3.0;
/// Pixels with points that a face is fitted to, at least: twice the parameters of a plane.
const LEAST_OF_FACE: f64 = 6.0;
/// Least variance of these pixels in any direction over that of an even window: below, they lie along a line.
const LEAST_SPREAD: f64 = 0.05;

/// The points of a cloud that a photo sees, gathered in pixels of a map.
#[derive(Clone, Debug)]
pub struct RangeImage {
    /// Points and the sum of their inverse depths, 1/m.
    cells: Raster<(f32, f64)>,
    /// Map pixels per photo pixel.
    scale: f64,
    /// Focal lengths of a pinhole camera that stands for the photo's, map pixels.
    focal_px: [f64; 2],
    center_px: [f64; 2],
}

impl RangeImage {
    /// An empty one for the photos of a camera, at half their resolution or such that it has 4 million
    /// pixels.
    pub fn new(camera: &Camera) -> Self {
        let photo = [camera.width, camera.height].map(f64::from);
        let scale = MAP_SCALE.min((MAX_PIXELS / (photo[0] * photo[1]).max(1.0)).sqrt());
        let [width, height] = photo.map(|side| (side * scale).ceil().max(1.0));
        Self {
            cells: Raster::filled(width as u32, height as u32, (0.0, 0.0)),
            scale,
            focal_px: camera.focal_px.map(|f| f * scale),
            center_px: camera.center_px.map(|c| c * scale),
        }
    }

    /// Adds a visible point by its pixel in the photo and its depth along the view axis, metres.
    pub fn add(&mut self, pixel: [f64; 2], depth_m: f64) {
        let [x, y] = pixel.map(|p| p * self.scale);
        if x >= 0.0
            && y >= 0.0
            && depth_m > 0.0
            && let Some((count, sum)) = self.cells.get_mut(x as u32, y as u32)
        {
            *count += 1.0;
            *sum += 1.0 / depth_m;
        }
    }

    /// The relief.
    ///
    /// The inverse depth of a plane is linear in the pixel coordinates of a pinhole camera (Hartley &
    /// Zisserman 2004, section 13.1: the plane n X = d is seen at depth d / (n r) along the ray r), so the
    /// face around a pixel is the plane of least squares through the inverse depths of a window, and a height
    /// is measured along its normal. Windows have the same size on the face, whatever the distance; their
    /// sums come from tables (Crow 1984). Of a lens's distortion only the change within a window is ignored.
    ///
    /// Cost: two fits of a plane for every pixel; 72 bytes a pixel.
    pub fn relief(&self) -> ReliefMap {
        let (width, height) = (self.cells.width() as usize, self.cells.height() as usize);
        let sums = FaceSums::of(&self.cells);
        let mut relief = Raster::filled(width as u32, height as u32, [0.0; RELIEF_CHANNELS]);
        relief
            .data_mut()
            .par_chunks_mut(width)
            .enumerate()
            .for_each(|(y, row)| {
                for (x, value) in row.iter_mut().enumerate() {
                    *value = self.at(&sums, [x, y]).unwrap_or_default();
                }
            });
        relief
    }

    /// The values of a pixel; `None` where nothing is known.
    fn at(&self, sums: &FaceSums, at: [usize; 2]) -> Option<[f32; RELIEF_CHANNELS]> {
        let (reach, near) = self.nearest(sums, at)?;
        let depth = near.pixels / near.q;
        let fit = |scale: usize| {
            let half = FACE_M[scale] * (self.focal_px[0] * self.focal_px[1]).sqrt() / depth;
            let half = (half.round().max(0.0) as usize)
                .max(LEAST_FACE_PX[scale])
                .max(reach);
            sums.window(at, half).face()
        };
        let wide = fit(1)?;
        let narrow = fit(0);
        let height = |face: &Face, scale: usize| {
            let metres = self.height(face, &near, at);
            (metres / (metres.abs() + HALF_HEIGHT_M[scale])) as f32
        };
        let slope = narrow.as_ref().map_or(0.0, |narrow| {
            let [a, b] = [narrow, &wide].map(|face| self.normal(face, at));
            a.cross(&b).norm() / (a.norm() * b.norm())
        });
        Some([
            narrow.as_ref().map_or(0.0, |face| height(face, 0)),
            height(&wide, 1),
            slope as f32,
            1.0 / (1.0 + reach as f32),
        ])
    }

    /// The points nearest to a pixel, and within how many pixels they lie.
    fn nearest(&self, sums: &FaceSums, at: [usize; 2]) -> Option<(usize, Sums)> {
        let width = self.cells.width() as usize;
        let is_enough = |half: usize, found: &Sums| match half {
            0 => f64::from(self.cells.data()[at[1] * width + at[0]].0) >= LEAST_POINTS,
            _ => found.pixels >= LEAST_POINTS,
        };
        let windows = SEARCH_PX.into_iter().map(|half| (half, sums.window(at, half)));
        windows.into_iter().find(|(half, found)| is_enough(*half, found))
    }

    /// Plane vector of a face: normal over distance from the camera, 1/m; its product with a ray of depth 1
    /// is the inverse depth.
    fn normal(&self, face: &Face, at: [usize; 2]) -> nalgebra::Vector3<f64> {
        let [x, y] = [0, 1].map(|axis| at[axis] as f64 + 0.5 - self.center_px[axis]);
        let [u, v] = face.gradient;
        nalgebra::Vector3::new(
            u * self.focal_px[0],
            v * self.focal_px[1],
            face.inverse_depth - u * x - v * y,
        )
    }

    /// Height of points above a face, metres along its normal.
    fn height(&self, face: &Face, points: &Sums, at: [usize; 2]) -> f64 {
        // What the points lie before the face on the average, in inverse depth; then carried to the pixel.
        let expected = face.inverse_depth + face.gradient[0] * points.x() + face.gradient[1] * points.y();
        let inverse_depth = face.inverse_depth + points.q / points.pixels - expected;
        let distance = 1.0 / self.normal(face, at).norm();
        distance * (1.0 - face.inverse_depth / inverse_depth)
    }
}

/// A face around a pixel: inverse depth at the pixel, 1/m, and its change a pixel along both axes.
struct Face {
    inverse_depth: f64,
    gradient: [f64; 2],
}

/// Sums over the pixels of a window that hold points; places are relative to the window's pixel.
struct Sums {
    pixels: f64,
    q: f64,
    /// Sums of x, y; of xx, xy, yy; of xq, yq.
    first: [f64; 2],
    second: [f64; 3],
    mixed: [f64; 2],
    /// Half the side of the window, pixels.
    half: f64,
}

impl Sums {
    fn x(&self) -> f64 {
        self.first[0] / self.pixels
    }

    fn y(&self) -> f64 {
        self.first[1] / self.pixels
    }

    /// The plane of least squares; `None` where too few pixels hold points, or along a line only.
    fn face(&self) -> Option<Face> {
        if self.pixels < LEAST_OF_FACE {
            return None;
        }
        let (n, x, y, q) = (self.pixels, self.x(), self.y(), self.q / self.pixels);
        let [xx, xy, yy] = [
            self.second[0] / n - x * x,
            self.second[1] / n - x * y,
            self.second[2] / n - y * y,
        ];
        let [xq, yq] = [self.mixed[0] / n - x * q, self.mixed[1] / n - y * q];
        let determinant = xx * yy - xy * xy;
        // The least variance of the pixels in any direction is at least determinant over trace.
        let even = self.half * (self.half + 1.0) / 3.0;
        if determinant < LEAST_SPREAD * even * (xx + yy) {
            return None;
        }
        let u = (xq * yy - yq * xy) / determinant;
        let v = (yq * xx - xq * xy) / determinant;
        Some(Face {
            inverse_depth: q - u * x - v * y,
            gradient: [u, v],
        })
    }
}

/// Sums over windows of 1, q, x, y, xx, xy, yy, xq, yq; places are relative to the middle, inverse depths to
/// their mean, which keeps digits.
struct FaceSums {
    table: SumTable<9>,
    mean: f64,
}

impl FaceSums {
    fn of(cells: &Raster<(f32, f64)>) -> Self {
        let size = [cells.width() as usize, cells.height() as usize];
        let seen = cells.data().iter().filter(|cell| cell.0 > 0.0);
        let (count, total) = seen.fold((0.0, 0.0), |(n, sum), cell| {
            (n + 1.0, sum + cell.1 / f64::from(cell.0))
        });
        let mean = if count > 0.0 { total / count } else { 0.0 };
        let middle = size.map(|side| 0.5 * side as f64);
        let table = SumTable::new(size, |x, y| {
            let (points, sum) = cells.data()[y * size[0] + x];
            let q = sum / f64::from(points) - mean;
            let (x, y) = (x as f64 - middle[0], y as f64 - middle[1]);
            (points > 0.0).then_some([1.0, q, x, y, x * x, x * y, y * y, x * q, y * q])
        });
        Self { table, mean }
    }

    /// Sums of the window of `2 half + 1` pixels around a pixel, cut at the border.
    fn window(&self, at: [usize; 2], half: usize) -> Sums {
        let [n, q, x, y, xx, xy, yy, xq, yq] = self.table.window(at, half);
        let size = self.table.size();
        let [px, py] = [0, 1].map(|axis| at[axis] as f64 - 0.5 * size[axis] as f64);
        let (rx, ry) = (x - n * px, y - n * py);
        Sums {
            pixels: n,
            q: q + n * self.mean,
            first: [rx, ry],
            second: [
                xx - 2.0 * px * x + n * px * px,
                xy - px * y - py * x + n * px * py,
                yy - 2.0 * py * y + n * py * py,
            ],
            mixed: [xq - px * q + self.mean * rx, yq - py * q + self.mean * ry],
            half: half as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    /// Camera of 240 x 200 pixels that sees a plane at 10 m with 4 mm a pixel, 8 mm a map pixel.
    fn camera() -> Camera {
        Camera::pinhole(240, 200, 2500.0)
    }

    /// A range image whose pixels hold three points each, at the depth that a function of the map pixel
    /// gives.
    fn seen(depth: impl Fn(usize, usize) -> Option<f64>) -> RangeImage {
        let mut image = RangeImage::new(&camera());
        for (x, y) in (0..100).flat_map(|y| (0..120).map(move |x| (x, y))) {
            for _ in 0..3 {
                if let Some(depth) = depth(x, y) {
                    image.add([2.0 * x as f64 + 1.0, 2.0 * y as f64 + 1.0], depth);
                }
            }
        }
        image
    }

    /// Depth of the plane through (0, 0, 10 m) with a normal, at a map pixel, by the intersection of ray and
    /// plane.
    fn plane(normal: Vector3<f64>, lifted_m: f64, x: usize, y: usize) -> f64 {
        let pixel = [2.0 * x as f64 + 1.0, 2.0 * y as f64 + 1.0];
        let ray = camera().unproject(pixel).unwrap();
        let normal = normal.normalize();
        (normal.dot(&Vector3::new(0.0, 0.0, 10.0)) - lifted_m) / normal.dot(&ray)
    }

    fn metres(squashed: f32, half: f64) -> f64 {
        f64::from(squashed) * half / (1.0 - f64::from(squashed.abs()))
    }

    #[test]
    fn a_plane_has_neither_height_nor_slope_wherever_it_faces() {
        for normal in [
            Vector3::z(),
            Vector3::new(0.8, 0.0, 1.0),
            Vector3::new(-0.5, 1.2, 1.0),
        ] {
            let relief = seen(|x, y| Some(plane(normal, 0.0, x, y))).relief();
            assert_eq!((relief.width(), relief.height()), (120, 100));
            for [narrow, wide, slope, confidence] in relief.data() {
                assert!(narrow.abs() < 1e-4 && wide.abs() < 1e-4, "{narrow} {wide}");
                assert!(*slope < 1e-4 && *confidence == 1.0, "{slope} {confidence}");
            }
        }
    }

    /// A pixel of a stone whose face lies 2 cm before the joint around it: what the faces fitted to wall and
    /// stone together must leave is computed by hand from the shares of the window.
    #[test]
    fn a_step_is_as_high_as_it_is() {
        for normal in [Vector3::z(), Vector3::new(0.7, -0.3, 1.0)] {
            let step = |x: usize, y: usize| Some(plane(normal, if x < 60 { 0.02 } else { 0.0 }, x, y));
            let relief = seen(step).relief();
            let row = &relief.data()[50 * 120..51 * 120];
            let heights: Vec<f64> = row.iter().map(|v| metres(v[1], 0.04)).collect();
            // The fitted face is the same on both sides of the edge: between neighbours across it the whole
            // step shows.
            let at_edge = heights[59] - heights[60];
            // The face itself turns by 1.5 h / side a pixel under a step (least squares through a sign
            // function).
            assert!((at_edge - 0.02).abs() < 0.0015, "{normal}: {at_edge}");
            assert!(heights[59] > 0.0085 && heights[60] < -0.0085);
            assert!(row[59][0] > 0.4 && row[60][0] < -0.4, "{:?}", &row[58..62]);
            assert!(heights[10].abs() < 1e-3 && row[10][2] < 0.01);
        }
    }

    /// A small face that leans by 20 degrees in a wide wall.
    #[test]
    fn slope_is_that_of_the_stone_against_the_wall() {
        let lean = 20f64.to_radians();
        let tilted = Vector3::new(lean.sin(), 0.0, lean.cos());
        let is_stone = |x: usize, y: usize| (50..70).contains(&x) && (40..60).contains(&y);
        let depth = |x, y| {
            Some(if is_stone(x, y) {
                plane(tilted, 0.0, x, y)
            } else {
                plane(Vector3::z(), 0.0, x, y)
            })
        };
        let relief = seen(depth).relief();
        let slope = f64::from(relief.get(60, 50).unwrap()[2]);
        // The wide window of 77 pixels holds 400 of the stone: they turn it by less than a degree.
        assert!((slope - lean.sin()).abs() < 0.02, "{slope}");
    }

    #[test]
    fn gaps_hold_nothing_and_sparse_points_little() {
        let is_gap = |x: usize, y: usize| (30..90).contains(&x) && (20..80).contains(&y);
        let relief = seen(|x, y| (!is_gap(x, y)).then_some(10.0)).relief();
        assert_eq!(*relief.get(60, 50).unwrap(), [0.0; RELIEF_CHANNELS]);
        assert_eq!(relief.get(10, 50).unwrap()[3], 1.0);
        assert_eq!(
            relief.get(32, 50).unwrap()[3],
            1.0 / 5.0,
            "three pixels into the gap"
        );
        assert_eq!(
            *RangeImage::new(&camera()).relief().get(3, 3).unwrap(),
            [0.0; RELIEF_CHANNELS]
        );
        // One point every 6 map pixels: 5 pixels on, three of them are within 8.
        let sparse = seen(|x, y| (x % 6 == 0 && y % 6 == 0).then_some(10.0)).relief();
        let value = sparse.get(60, 48).unwrap();
        assert_eq!(value[3], 1.0 / 1.0, "a pixel with points of its own");
        assert_eq!(sparse.get(63, 51).unwrap()[3], 1.0 / 5.0);
        assert!(
            sparse
                .data()
                .iter()
                .all(|v| v[0].abs() < 1e-5 && v[1].abs() < 1e-5)
        );
    }

    #[test]
    fn large_photos_have_maps_of_four_million_pixels() {
        let map = RangeImage::new(&Camera::pinhole(8000, 6000, 5000.0));
        let pixels = f64::from(map.cells.width()) * f64::from(map.cells.height());
        assert!((pixels / 4e6 - 1.0).abs() < 0.01, "{pixels}");
    }
}
