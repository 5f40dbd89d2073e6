//! Where the cameras of the views stand.

use super::ViewParams;
use super::hidden::Nearest;
use super::obstacles::{BEFORE_M, Bodies};
use super::walls::Walls;
use crate::geometry::{Camera, FaceFrame, NearPlane, Rigid3, View};
use crate::id::ImageId;
use crate::statistics::upper_median;
use crate::surface::SurfaceCell;
use nalgebra::{Matrix3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};

/// Least part of the wall that gets views of its own direction.
const LEAST_SHARE: f64 = 0.02;
/// Directions of a wall that get views at most.
const MOST_DIRECTIONS: usize = 24;
/// Cells of a target at least: half a square metre of a wall, with cells of a quarter of a metre.
const LEAST_CELLS: usize = 8;
/// Part of all walls that a target must hold, unless it holds [`MANY_CELLS`]: where a survey shows much, small pieces
/// are things that stand before the wall.
const LEAST_PART: f64 = 0.1;
const MANY_CELLS: usize = 48;
/// Part of the rectangle around its cells that a target fills at least, unless it is small.
const LEAST_FILLED: f64 = 0.25;
/// Largest side of a target that may be filled less, cells.
const SMALL_CELLS: f64 = 16.0;
/// Part of the cells of a target that a view must see.
const LEAST_SEEN: f64 = 0.6;
/// Distances that are tried where something stands between wall and camera, as parts of the distance of
/// cameras in the open.
const DISTANCES: [f64; 4] = [1.0, 0.6, 0.35, 0.2];

/// Size of a pixel as a part of the distance between points: borders of stones are drawn smoothly. With pixels as
/// large as the distance, 136 stones of a terrestrial scan (5 mm) are measured instead of 139.
const PIXEL: f64 = 0.6;

/// A camera that sees a part of a wall.
#[derive(Clone, Debug)]
pub struct PlannedView {
    /// The camera.
    pub view: View,
    /// Distance between the points that it sees, pixels; 1 at least.
    pub spacing_px: f64,
    /// Size of a pixel on the wall, metres.
    pub pixel_m: f64,
    /// Whether it looks at its part of the wall straight on.
    pub is_straight: bool,
}

/// Views that cover the walls among the cells of a surface: each part of a wall is seen straight, and from
/// directions turned to the left, to the right, upwards and downwards.
///
/// `cells`: with normals that point outside. `stone_m`: the size across of the smaller stones, metres; where it is
/// known, pixels grow until all views fit into [`ViewParams::megapixels`] or these stones are only
/// [`ViewParams::stone_px`] across. Beyond [`ViewParams::most_megapixels`] they grow in any case. Views are numbered
/// and named in their order. A camera comes nearer where something hides the wall from it; a part that is hidden from
/// near, too, has no views. Views leave out what stands more than 20 cm before their part of the wall, and small
/// bodies that stand there have none of their own.
pub fn plan_views(cells: &[SurfaceCell], params: &ViewParams, stone_m: Option<f64>) -> Vec<PlannedView> {
    let walls = Walls::among(cells, params.cell_m).cells;
    let least_cells = MANY_CELLS
        .min((LEAST_PART * walls.len() as f64) as usize)
        .max(LEAST_CELLS);
    let faces = faces_of(&walls, params);
    let scene = Scene {
        cells,
        bodies: Bodies::of(&walls),
        least_cells,
    };
    let fitted = |megapixels: f64, largest_m: f64| {
        let pixels = |coarser: f64| Pixels {
            least_m: params.pixel_m,
            coarser,
            largest_m,
        };
        let mut coarser = 1.0;
        let mut views = views_of(&faces, &scene, &pixels(coarser), params);
        // Margins do not shrink with the pixels, and pixels that have reached `largest_m` do not grow, so that further
        // steps may be needed.
        for _ in 0..3 {
            let excess = megapixels_of(&views) / megapixels;
            if excess <= 1.0 {
                break;
            }
            coarser *= excess.sqrt();
            let before = megapixels_of(&views);
            views = views_of(&faces, &scene, &pixels(coarser), params);
            if megapixels_of(&views) >= before {
                break;
            }
        }
        views
    };
    let seen_well = stone_m.map(|size_m| fitted(params.megapixels, size_m / params.stone_px));
    seen_well
        .filter(|views| megapixels_of(views) <= params.most_megapixels)
        .unwrap_or_else(|| fitted(params.most_megapixels, f64::INFINITY))
}

/// Pixels of all views together, millions.
pub fn megapixels_of(views: &[PlannedView]) -> f64 {
    let cameras = views.iter().map(|planned| &planned.view.camera);
    1e-6 * cameras
        .map(|c| f64::from(c.width) * f64::from(c.height))
        .sum::<f64>()
}

/// How large pixels are on the wall.
struct Pixels {
    /// Least size, metres.
    least_m: f64,
    /// Factor by which pixels exceed their finest size.
    coarser: f64,
    /// Size up to which `coarser` enlarges them, metres.
    largest_m: f64,
}

impl Pixels {
    fn size_m(&self, spacing_m: f64) -> f64 {
        let finest_m = self.least_m.max(PIXEL * spacing_m);
        finest_m.max((self.coarser * finest_m).min(self.largest_m))
    }
}

/// What is there.
struct Scene<'a> {
    /// All cells.
    cells: &'a [SurfaceCell],
    /// Bodies of the walls.
    bodies: Bodies,
    /// Least cells of a target.
    least_cells: usize,
}

/// Cells of walls that face in one direction.
struct Face<'a> {
    frame: FaceFrame,
    cells: Vec<&'a SurfaceCell>,
}

/// Faces by direction, each the mean of the cells near the direction in which most of the remaining cells
/// face.
fn faces_of<'a>(walls: &[&'a SurfaceCell], params: &ViewParams) -> Vec<Face<'a>> {
    let near = params.spread_rad.cos();
    let mut left: Vec<&SurfaceCell> = walls.to_vec();
    let mut faces = Vec::new();

    while faces.len() < MOST_DIRECTIONS {
        // A few hundred candidates are enough to find a peak that holds a fiftieth of the cells.
        let step = left.len().div_ceil(400).max(1);
        let count = |d: &Vector3<f64>| left.iter().filter(|c| c.normal.dot(d) > near).count();
        let best = left.iter().step_by(step).map(|c| (count(&c.normal), c.normal));
        let Some((most, direction)) = best.max_by_key(|(count, _)| *count) else {
            break;
        };
        if (most as f64) < LEAST_SHARE * walls.len() as f64 {
            break;
        }
        let sum: Vector3<f64> = left
            .iter()
            .map(|c| c.normal)
            .filter(|n| n.dot(&direction) > near)
            .sum();
        let frame = FaceFrame::from_normal(&sum);
        let (cells, rest): (Vec<&SurfaceCell>, Vec<&SurfaceCell>) =
            left.iter().partition(|c| c.normal.dot(&frame.out) > near);
        if cells.is_empty() {
            break;
        }
        left = rest;
        faces.push(Face { frame, cells });
    }

    faces
}

fn views_of(faces: &[Face], scene: &Scene, pixels: &Pixels, params: &ViewParams) -> Vec<PlannedView> {
    let mut views = Vec::new();
    for face in faces {
        for target in targets_of(face, scene, pixels, params) {
            let Some(distance_m) = target.distance(&face.frame.out, scene.cells, params) else {
                continue;
            };
            for (turn, direction) in directions(&face.frame, params.turn_rad).into_iter().enumerate() {
                views.push(PlannedView {
                    view: target.view(direction, distance_m, ImageId(views.len() as u32)),
                    spacing_px: (target.spacing_m / target.pixel_m).max(1.0),
                    pixel_m: target.pixel_m,
                    is_straight: turn == 0,
                });
            }
        }
    }
    views
}

/// The axis of a face and this axis turned to four sides.
fn directions(frame: &FaceFrame, turn_rad: f64) -> [Vector3<f64>; 5] {
    let turned = |axis: Vector3<f64>, angle: f64| {
        Rotation3::from_axis_angle(&Unit::new_normalize(axis), angle) * frame.out
    };
    [
        frame.out,
        turned(frame.up, turn_rad),
        turned(frame.up, -turn_rad),
        turned(frame.along, turn_rad),
        turned(frame.along, -turn_rad),
    ]
}

/// Part of a wall that the same views show.
struct Target<'a> {
    cells: Vec<&'a SurfaceCell>,
    middle: Point3<f64>,
    size_m: [f64; 2],
    spacing_m: f64,
    pixel_m: f64,
    /// Mean normal, and how far out along it views show anything, metres from the origin of the world.
    out: Vector3<f64>,
    limit_m: f64,
}

/// The targets of a face: its rectangle, halved until each part fits a view and is filled, without obstacles.
fn targets_of<'a>(face: &Face<'a>, scene: &Scene, pixels: &Pixels, params: &ViewParams) -> Vec<Target<'a>> {
    let axes = face.frame.face_from_world();
    let mut targets = Vec::new();
    let mut left = vec![face.cells.clone()];

    while let Some(cells) = left.pop() {
        if cells.len() < scene.least_cells {
            continue;
        }
        let places: Vec<Vector3<f64>> = cells.iter().map(|c| axes * c.centroid.coords).collect();
        let along = |axis: usize| -> Vec<f64> { places.iter().map(|p| p[axis]).collect() };
        let bounds = [0, 1].map(|axis| {
            let values = along(axis);
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            [low - 0.5 * params.cell_m, high + 0.5 * params.cell_m]
        });
        let size_m = bounds.map(|[low, high]| high - low);
        let spacing_m = median(cells.iter().map(|c| c.spacing_m).collect());
        let pixel_m = pixels.size_m(spacing_m);
        let longest = usize::from(size_m[1] > size_m[0]);
        let filled = cells.len() as f64 * params.cell_m * params.cell_m / (size_m[0] * size_m[1]);
        let is_scattered = filled < LEAST_FILLED && size_m[longest] > SMALL_CELLS * params.cell_m;
        let middle = bounds.map(|[low, high]| 0.5 * (low + high));
        if is_scattered || size_m[longest] > f64::from(params.side_px) * pixel_m {
            let half = |upper: bool| {
                let inside = |p: &Vector3<f64>| (p[longest] >= middle[longest]) == upper;
                let of_half = cells.iter().zip(&places).filter(|(_, p)| inside(p));
                of_half.map(|(cell, _)| *cell).collect()
            };
            left.extend([half(true), half(false)]);
            continue;
        }
        let remaining = scene.bodies.without_obstacles(&cells, &places, params.cell_m);
        if remaining.len() < cells.len() {
            left.push(remaining);
            continue;
        }
        let middle = Vector3::new(middle[0], middle[1], median(along(2)));
        let out = FaceFrame::from_normal(&cells.iter().map(|c| c.normal).sum()).out;
        let heights_m = cells.iter().map(|c| out.dot(&c.centroid.coords));
        let limit_m = heights_m.fold(f64::NEG_INFINITY, f64::max) + BEFORE_M;
        targets.push(Target {
            cells,
            middle: Point3::from(axes.transpose() * middle),
            size_m,
            spacing_m,
            pixel_m,
            out,
            limit_m,
        });
    }

    targets
}

impl Target<'_> {
    /// The largest distance from which a camera in this direction sees the target; none where something hides
    /// it even from near. `all`: what may stand between.
    fn distance(&self, direction: &Vector3<f64>, all: &[SurfaceCell], params: &ViewParams) -> Option<f64> {
        let open_m = params.distance_m.max(self.size_m[0]).max(self.size_m[1]);
        DISTANCES
            .into_iter()
            .map(|part| part * open_m)
            .find(|&distance_m| {
                let view = self.view(*direction, distance_m, ImageId(0));
                Nearest::of(&view, all, params.cell_m).seen_share(&self.cells) >= LEAST_SEEN
            })
    }

    /// A camera at a distance in a direction that looks at the middle.
    fn view(&self, direction: Vector3<f64>, distance_m: f64, image: ImageId) -> View {
        // A tenth more, so that stones on a border are whole in one of two views.
        let [width, height] = self.size_m.map(|side| (1.1 * side / self.pixel_m).ceil() as u32);
        let frame = FaceFrame::from_normal(&direction);
        // Camera axes: x right (along), y down, z into the wall.
        let turn = Matrix3::from_rows(&[
            frame.along.transpose(),
            -frame.up.transpose(),
            -frame.out.transpose(),
        ]);
        let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn));
        let centre = self.middle + frame.out * distance_m;
        let near = NearPlane {
            normal: turn * -self.out,
            distance_m: self.out.dot(&centre.coords) - self.limit_m,
        };
        View {
            image,
            name: format!("view_{:03}.png", image.0 + 1),
            camera: Camera {
                near: Some(near),
                ..Camera::pinhole(width, height, distance_m / self.pixel_m)
            },
            cam_from_world: Rigid3::from_parts(Translation3::from(-(turn * centre.coords)), turn),
        }
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    upper_median(&mut values).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells of a quarter of a metre on a quarter of a round wall, radius 20 m, 6 m high, which faces away from the
    /// middle.
    fn round_wall() -> Vec<SurfaceCell> {
        let places =
            (0..126).flat_map(|i| (0..24).map(move |j| (0.0125 * f64::from(i), 0.125 + 0.25 * f64::from(j))));
        let cell = |(angle, z): (f64, f64)| {
            let normal = Vector3::new(angle.cos(), angle.sin(), 0.0);
            let centroid = Point3::from(20.0 * normal + z * Vector3::z());
            SurfaceCell {
                cell: [0; 3],
                centroid,
                normal,
                spacing_m: 0.008,
                skewness: 0.0,
            }
        };
        places.map(cell).collect()
    }

    #[test]
    fn every_place_is_seen_well_from_three_directions() {
        let (cells, params) = (round_wall(), ViewParams::default());
        let planned = plan_views(&cells, &params, None);
        let views: Vec<&View> = planned.iter().map(|p| &p.view).collect();
        assert_eq!(views[3].name, "view_004.png");
        // Points 8 mm apart are drawn in pixels of 4.8 mm.
        assert!(planned.iter().all(|p| (p.spacing_px - 8.0 / 4.8).abs() < 1e-9));
        let (mut all, mut before_it) = (0, 0);
        for cell in &cells {
            let sees = |view: &&&View| {
                let to_camera = (view.centre() - cell.centroid).normalize();
                view.project(&cell.centroid)
                    .is_some_and(|seen| view.is_inside(seen.pixel))
                    && to_camera.dot(&cell.normal) > (params.spread_rad + params.turn_rad + 0.4).cos()
            };
            let seen = views.iter().filter(sees).count();
            assert!(
                seen >= 3,
                "{} of {} views at {}",
                seen,
                views.len(),
                cell.centroid
            );
            // The wall bulges by 37 cm over the width of a view.
            let before = cell.centroid + cell.normal;
            let shows = |view: &&&View| sees(view) && view.project(&before).is_some();
            all += seen;
            before_it += views.iter().filter(shows).count();
        }
        // What stands a metre before the wall is hardly in any picture of the wall behind it: beside the target of a view,
        // the wall falls back.
        assert!(100 * before_it < all, "{before_it} of {all}");
        let sizes = views.iter().map(|v| v.view_gsd(&cells));
        assert!(
            sizes.clone().all(|gsd| (gsd / 0.0048 - 1.0).abs() < 0.15),
            "{:?}",
            sizes.collect::<Vec<_>>()
        );
    }

    impl View {
        /// Median pixel size on the cells that it shows, metres.
        fn view_gsd(&self, cells: &[SurfaceCell]) -> f64 {
            let seen = cells.iter().filter_map(|c| self.project(&c.centroid));
            let inside = seen.filter(|seen| self.is_inside(seen.pixel));
            self.gsd_m(median(inside.map(|seen| seen.depth_m).collect()))
        }
    }

    #[test]
    fn pixels_grow_until_all_views_fit_or_stones_are_small() {
        let params = ViewParams {
            megapixels: 2.0,
            ..ViewParams::default()
        };
        let cells = round_wall();
        let plan = |stone_m| plan_views(&cells, &params, stone_m);
        let largest_m = |views: &[PlannedView]| views.iter().map(|v| v.pixel_m).fold(0.0, f64::max);
        let finest = plan(None);
        assert!(megapixels_of(&finest) > 20.0 && (largest_m(&finest) - 0.0048).abs() < 1e-12);
        // Fifty pixels across stones of 35 cm, and across stones of two metres.
        let small = plan(Some(0.35));
        assert!((largest_m(&small) - 0.007).abs() < 1e-12);
        assert!(megapixels_of(&small) < 0.6 * megapixels_of(&finest));
        assert!(megapixels_of(&plan(Some(2.0))) < 2.1);
        // Pixels are never finer than the points allow. `most_megapixels` enlarges them whatever the size of the stones.
        assert!((largest_m(&plan(Some(0.1))) - 0.0048).abs() < 1e-12);
        let params = ViewParams {
            most_megapixels: 2.0,
            ..params
        };
        for stone_m in [None, Some(0.35)] {
            let views = plan_views(&cells, &params, stone_m);
            assert!(!views.is_empty() && megapixels_of(&views) < 2.1);
        }
        assert!(plan_views(&[], &params, None).is_empty());
    }
}
