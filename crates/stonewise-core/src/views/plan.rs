//! Where the cameras of the views stand.

use super::ViewParams;
use crate::geometry::{Camera, FaceFrame, Rigid3, View};
use crate::id::ImageId;
use crate::surface::SurfaceCell;
use nalgebra::{Matrix3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};

/// Cosine of the angle to the vertical above which a surface is no wall: ground, roofs, soffits.
const LEVEL: f64 = 0.8;
/// Least part of the wall that gets views of its own direction.
const LEAST_SHARE: f64 = 0.02;
/// Directions of a wall that get views at most.
const MOST_DIRECTIONS: usize = 24;
/// Cells of a view at least, as a part of those that would fill it.
const LEAST_FILLED: f64 = 0.02;

/// Views that cover the walls among the cells of a surface: for each direction in which walls face, a grid of
/// views straight at them, and each of these again turned left, right, up and down.
///
/// `cells`: with normals that point outside. Views are numbered and named in their order.
pub fn plan_views(cells: &[SurfaceCell], params: &ViewParams) -> Vec<View> {
    let walls: Vec<&SurfaceCell> = cells.iter().filter(|c| c.normal.z.abs() < LEVEL).collect();
    let faces = faces_of(&walls, params);
    let spacing_m = median(walls.iter().map(|c| c.spacing_m).collect());
    let mut pixel_m = params.pixel_m.max(spacing_m);
    let mut views = views_of(&faces, pixel_m, params);
    let pixels = |views: &[View]| -> f64 {
        let of = |v: &View| f64::from(v.camera.width) * f64::from(v.camera.height);
        views.iter().map(of).sum()
    };
    // Margins do not shrink with the pixels, so a second step may be needed.
    for _ in 0..3 {
        let excess = pixels(&views) / (1e6 * params.megapixels);
        if excess <= 1.0 {
            break;
        }
        pixel_m *= excess.sqrt();
        views = views_of(&faces, pixel_m, params);
    }
    views
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

fn views_of(faces: &[Face], pixel_m: f64, params: &ViewParams) -> Vec<View> {
    let mut views = Vec::new();
    for face in faces {
        for target in targets_of(face, pixel_m, params) {
            for direction in directions(&face.frame, params.turn_rad) {
                let number = views.len() as u32;
                views.push(target.view(direction, ImageId(number), pixel_m, params));
            }
        }
    }
    views
}

/// The axis of a face and this axis turned to four sides.
fn directions(frame: &FaceFrame, turn_rad: f64) -> Vec<Vector3<f64>> {
    let turned = |axis: Vector3<f64>, angle: f64| {
        Rotation3::from_axis_angle(&Unit::new_normalize(axis), angle) * frame.out
    };
    vec![
        frame.out,
        turned(frame.up, turn_rad),
        turned(frame.up, -turn_rad),
        turned(frame.along, turn_rad),
        turned(frame.along, -turn_rad),
    ]
}

/// A rectangle of a face that one view shows.
struct Target {
    middle: Point3<f64>,
    size_px: [u32; 2],
}

/// The rectangle around a face, cut into parts that fit a view; parts that hold next to nothing are left out.
fn targets_of(face: &Face, pixel_m: f64, params: &ViewParams) -> Vec<Target> {
    let axes = face.frame.face_from_world();
    let Some(first) = face.cells.first() else {
        return Vec::new();
    };
    let base = first.centroid;
    let places: Vec<Vector3<f64>> = face.cells.iter().map(|c| axes * (c.centroid - base)).collect();
    let half = 0.5 * params.cell_m;
    let bounds = [0, 1].map(|axis| {
        let values = || places.iter().map(move |p| p[axis]);
        let low = values().fold(f64::INFINITY, f64::min) - half;
        [low, values().fold(f64::NEG_INFINITY, f64::max) + half]
    });
    let most_m = f64::from(params.side_px) * pixel_m;
    let counts = bounds.map(|[low, high]| ((high - low) / most_m).ceil().max(1.0));
    let sides = [0, 1].map(|k| (bounds[k][1] - bounds[k][0]) / counts[k]);
    let cells_of_target = sides[0] * sides[1] / (params.cell_m * params.cell_m);
    let mut targets = Vec::new();
    for row in 0..counts[1] as u32 {
        for column in 0..counts[0] as u32 {
            let low = [
                bounds[0][0] + f64::from(column) * sides[0],
                bounds[1][0] + f64::from(row) * sides[1],
            ];
            let inside = |p: &&Vector3<f64>| (0..2).all(|k| p[k] >= low[k] && p[k] < low[k] + sides[k]);
            let depths: Vec<f64> = places.iter().filter(inside).map(|p| p.z).collect();
            if (depths.len() as f64) < LEAST_FILLED * cells_of_target {
                continue;
            }
            let middle = Vector3::new(low[0] + 0.5 * sides[0], low[1] + 0.5 * sides[1], median(depths));
            targets.push(Target {
                middle: base + axes.transpose() * middle,
                // A tenth more, so that stones on a border are whole in one of the two views.
                size_px: sides.map(|side| (1.1 * side / pixel_m).ceil() as u32),
            });
        }
    }
    targets
}

impl Target {
    /// A camera at a distance in a direction that looks at the middle.
    fn view(&self, direction: Vector3<f64>, image: ImageId, pixel_m: f64, params: &ViewParams) -> View {
        let [width, height] = self.size_px;
        let longest_m = f64::from(width.max(height)) * pixel_m;
        let distance = params.distance_m.max(longest_m);
        let frame = FaceFrame::from_normal(&direction);
        // Camera axes: x right (along), y down, z into the wall.
        let turn = Matrix3::from_rows(&[
            frame.along.transpose(),
            -frame.up.transpose(),
            -frame.out.transpose(),
        ]);
        let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn));
        let centre = self.middle + frame.out * distance;
        View {
            image,
            name: format!("view_{:03}.png", image.0 + 1),
            camera: Camera::pinhole(width, height, distance / pixel_m),
            cam_from_world: Rigid3::from_parts(Translation3::from(-(turn * centre.coords)), turn),
        }
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells of half a metre on a quarter of a round wall, radius 20 m, 6 m high, which faces away from the
    /// middle.
    fn round_wall() -> Vec<SurfaceCell> {
        let places =
            (0..63).flat_map(|i| (0..12).map(move |j| (0.025 * f64::from(i), 0.25 + 0.5 * f64::from(j))));
        let cell = |(angle, z): (f64, f64)| {
            let normal = Vector3::new(angle.cos(), angle.sin(), 0.0);
            let centroid = Point3::from(20.0 * normal + z * Vector3::z());
            SurfaceCell {
                cell: [0; 3],
                centroid,
                normal,
                points: 1000,
                spacing_m: 0.008,
                skewness: 0.0,
            }
        };
        places.map(cell).collect()
    }

    #[test]
    fn every_place_is_seen_well_from_three_directions() {
        let (cells, params) = (round_wall(), ViewParams::default());
        let views = plan_views(&cells, &params);
        assert_eq!(views[3].name, "view_004.png");
        for cell in &cells {
            let sees = |view: &&View| {
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
        }
        let sizes = views.iter().map(|v| v.view_gsd(&cells));
        assert!(
            sizes.clone().all(|gsd| (gsd / 0.008 - 1.0).abs() < 0.15),
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
    fn pixels_grow_until_all_views_fit() {
        let (cells, params) = (
            round_wall(),
            ViewParams {
                megapixels: 2.0,
                ..ViewParams::default()
            },
        );
        let views = plan_views(&cells, &params);
        let pixels: u64 = views
            .iter()
            .map(|v| u64::from(v.camera.width) * u64::from(v.camera.height))
            .sum();
        assert!(!views.is_empty() && pixels < 2_100_000, "{pixels}");
        assert!(plan_views(&[], &params).is_empty());
    }
}
