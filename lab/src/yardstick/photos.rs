//! Clouds of photos whose interior orientation differs from photo to photo.
//!
//! A stabiliser moves a lens element and with it the principal point of each photo (image-variant interior orientation:
//! Tecklenburg, Luhmann and Hastedt 2001). A bundle with one shared camera turns and shifts the photos until most of it
//! is compensated; the rest bends the cloud. With A the derivatives of image points by poses and by what the bundle
//! estimates of the camera (focal length, radial distortion), B by the places of tie points, F the shift of the
//! principal point, and P = I - B (B'B)^-1 B', the bundle takes poses and camera for (A'PA)^-1 A'P F, and a place that
//! is matched moves by (B'B)^-1 B' (F - A (poses, camera)).

use super::points::{Points, SurveyPoint};
use nalgebra::{
    DMatrix, DVector, Matrix2, Matrix2x3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector2,
    Vector3,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use stonewise_core::geometry::{Camera, DisplacementSample, Rigid3, SmallMotion, View};
use stonewise_core::id::ImageId;
use stonewise_core::registration::observers::PhotoNetwork;
use stonewise_simulate::{Noise, Scan, normal};

/// Photos of an epoch, in a row.
const PHOTOS: usize = 4;
/// Distance from the wall, and focal length in pixels: 3.8 mm a pixel.
const DISTANCE_M: f64 = 4.5;
const FOCAL_PX: f64 = 1200.0;
/// Side of a photo, which shows the whole wall.
const SIDE_PX: u32 = 4000;
/// Standard deviation of a principal point per axis, pixels.
const PRINCIPAL_PX: f64 = 3.0;
/// Places of tie points along and up the wall.
const TIES: [usize; 2] = [12, 9];
/// Registration of an epoch on its control points: shift and rotation, per axis.
const DATUM: [f64; 2] = [5e-4, 5e-5];
/// Errors of dense matching out of the wall: smooth ones, their length, and those of single points out and in the face.
const SMOOTH_M: f64 = 4e-4;
const SMOOTH_LENGTH_M: f64 = 0.45;
const POINT_M: [f64; 2] = [1.2e-3, 3e-4];
/// What the standard deviation of gradient noise is about.
const NOISE_SD: f64 = 0.3;
/// Unknowns of the camera: focal length, radial distortion.
const CAMERA: usize = 2;
/// Keeps the datum of a free bundle solvable; far below what any tie point says.
const RIDGE: f64 = 1e-6;

/// A photo: where it was taken, its axes (right, down, ahead) as rows, and where its principal point truly is.
struct Photo {
    centre: Point3<f64>,
    axes: Matrix3<f64>,
    principal: Vector2<f64>,
}

/// What the photos of both epochs get wrong.
pub struct PhotoErrors {
    epochs: [Epoch; 2],
    is_joint: bool,
    seed: u64,
}

struct Epoch {
    photos: Vec<Photo>,
    /// What the bundle gets wrong of each photo's rotation and place, and of the camera.
    poses: DVector<f64>,
    camera: DVector<f64>,
    /// What the control points take off.
    datum: SmallMotion,
    scale: f64,
    error: SmallMotion,
}

impl PhotoErrors {
    /// `is_joint`: whether one bundle adjusts the photos of both epochs.
    pub fn new(is_joint: bool, size_m: [f64; 2], seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0xb1d);
        let photos = [0, 1].map(|_| taken(size_m, &mut rng));
        let ties = ties(size_m);
        let split = |first: usize, all: &DVector<f64>| {
            let camera = all.rows(all.len() - CAMERA, CAMERA);
            (all.rows(6 * first, 6 * PHOTOS).into_owned(), camera.into_owned())
        };
        let bundles = match is_joint {
            true => {
                let all = bundle(photos.iter().flatten(), &ties);
                [split(0, &all), split(PHOTOS, &all)]
            }
            false => photos.each_ref().map(|p| split(0, &bundle(p.iter(), &ties))),
        };
        let mut bundles = bundles.into_iter();
        let epochs = photos.map(|photos| {
            let mut draw = |sd: f64| Vector3::from_fn(|_, _| sd * normal(&mut rng));
            let mut error = SmallMotion::shift(draw(DATUM[0]));
            error.motion.fixed_rows_mut::<3>(3).copy_from(&draw(DATUM[1]));
            let (poses, camera) = bundles.next().unwrap();
            let free = Epoch {
                photos,
                poses,
                camera,
                datum: SmallMotion::shift(Vector3::zeros()),
                scale: 0.0,
                error,
            };
            free.on_control_points(&ties)
        });
        Self {
            epochs,
            is_joint,
            seed,
        }
    }

    /// The photos as a project names them: without what is wrong in them.
    pub fn network(&self) -> PhotoNetwork {
        PhotoNetwork {
            photos: self
                .epochs
                .each_ref()
                .map(|epoch| epoch.photos.iter().map(Photo::view).collect()),
            is_joint: self.is_joint,
            shifts: Vec::new(),
        }
    }

    /// The places that a scan truly met, as matching the photos of an epoch shows them.
    pub fn measured(&self, scan: &Scan, epoch: usize) -> Points {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ (0xf0 + epoch as u64));
        let smooth = Noise::new(self.seed, 77 + epoch as u64);
        let mut points = Points::new();
        for (i, &stone) in scan.stone.iter().enumerate() {
            let exact = scan.cloud.origin() + Vector3::from(scan.exact[i]).cast::<f64>();
            let [y, z] = [exact.y, exact.z].map(|v| v / SMOOTH_LENGTH_M);
            let out = SMOOTH_M / NOISE_SD * smooth.at(y, z) + POINT_M[0] * normal(&mut rng);
            let in_face = [0, 1].map(|_| POINT_M[1] * normal(&mut rng));
            let place = exact
                + self.epochs[epoch].bent(&exact)
                + self.epochs[epoch].error.at(&exact)
                + Vector3::new(out, in_face[0], in_face[1]);
            points.entry(stone).or_default().push(SurveyPoint {
                place,
                source: 1,
                time_s: 0.0,
            });
        }
        points
    }
}

impl Epoch {
    /// Where a matched place seems to be, less where it is.
    fn bent(&self, place: &Point3<f64>) -> Vector3<f64> {
        self.triangulated(place) - self.datum.at(place) - self.scale * (place - self.datum.centre)
    }

    /// The shift of an image point that the bundle does not explain, pixels.
    fn left(&self, photo: usize, place: &Point3<f64>) -> Vector2<f64> {
        let (by_pose, _) = self.photos[photo].derivatives(place);
        self.photos[photo].principal
            - by_pose * self.poses.fixed_rows::<6>(6 * photo)
            - self.photos[photo].by_camera(place) * self.camera.fixed_rows::<CAMERA>(0)
    }

    fn triangulated(&self, place: &Point3<f64>) -> Vector3<f64> {
        let (mut information, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (k, photo) in self.photos.iter().enumerate() {
            let (_, by_place) = photo.derivatives(place);
            let left = self.left(k, place);
            information += by_place.transpose() * by_place;
            right += by_place.transpose() * left;
        }
        information
            .cholesky()
            .map_or_else(Vector3::zeros, |c| c.solve(&right))
    }

    /// The epoch brought onto control points all over the wall: rigid motion and scale.
    fn on_control_points(mut self, ties: &[Point3<f64>]) -> Self {
        for _ in 0..3 {
            let sample = |p: &Point3<f64>| DisplacementSample {
                place: *p,
                displacement: self.triangulated(p) - self.scale * (p - self.datum.centre),
                covariance: Matrix3::identity(),
            };
            self.datum = SmallMotion::fit(&ties.iter().map(sample).collect::<Vec<_>>()).unwrap();
            let arms = || ties.iter().map(|p| (p, p - self.datum.centre));
            let along: f64 = arms()
                .map(|(p, arm)| arm.dot(&(self.triangulated(p) - self.datum.at(p))))
                .sum();
            self.scale = along / arms().map(|(_, arm)| arm.norm_squared()).sum::<f64>();
        }
        self
    }
}

impl Photo {
    fn view(&self) -> View {
        let turn = Rotation3::from_matrix_unchecked(self.axes);
        let turn = UnitQuaternion::from_rotation_matrix(&turn);
        View {
            image: ImageId(0),
            name: String::new(),
            camera: Camera::pinhole(SIDE_PX, SIDE_PX, FOCAL_PX),
            cam_from_world: Rigid3::from_parts(Translation3::from(-(turn * self.centre.coords)), turn),
        }
    }

    /// The image point by focal length and radial distortion, both relative; pixels.
    fn by_camera(&self, place: &Point3<f64>) -> Matrix2<f64> {
        let p = self.axes * (place - self.centre);
        let image = p.xy() / p.z;
        Matrix2::from_columns(&[image, image * image.norm_squared()]) * FOCAL_PX
    }

    /// The image point by rotation and place of the photo, and by the place that it shows; pixels by radians, metres.
    fn derivatives(&self, place: &Point3<f64>) -> (nalgebra::SMatrix<f64, 2, 6>, Matrix2x3<f64>) {
        let p = self.axes * (place - self.centre);
        let by_camera = Matrix2x3::new(1.0, 0.0, -p.x / p.z, 0.0, 1.0, -p.y / p.z) * (FOCAL_PX / p.z);
        let by_place = by_camera * self.axes;
        let mut by_pose = nalgebra::SMatrix::<f64, 2, 6>::zeros();
        by_pose
            .fixed_view_mut::<2, 3>(0, 0)
            .copy_from(&(-by_camera * p.cross_matrix()));
        by_pose.fixed_view_mut::<2, 3>(0, 3).copy_from(&-by_place);
        (by_pose, by_place)
    }
}

/// Photos square on to a wall from wherever one stands.
fn taken([width_m, height_m]: [f64; 2], rng: &mut ChaCha8Rng) -> Vec<Photo> {
    let photo = |k: usize| {
        let along = 0.6 * width_m * (k as f64 / (PHOTOS - 1) as f64 - 0.5);
        let up = height_m * [0.3, 0.7][k % 2];
        let mut off = || Vector3::from_fn(|_, _| 0.2 * normal(rng));
        let centre = Point3::new(DISTANCE_M, along, up) + off();
        let aim = Point3::new(0.0, along, 0.5 * height_m) + off();
        let ahead = (aim - centre).normalize();
        let right = ahead.cross(&Vector3::z()).normalize();
        let down = ahead.cross(&right);
        Photo {
            centre,
            axes: Matrix3::from_rows(&[right.transpose(), down.transpose(), ahead.transpose()]),
            principal: Vector2::from_fn(|_, _| PRINCIPAL_PX * normal(rng)),
        }
    };
    (0..PHOTOS).map(photo).collect()
}

/// Places of tie points on the battered face, in and out of it by a few centimetres, as stones are.
fn ties([width_m, height_m]: [f64; 2]) -> Vec<Point3<f64>> {
    let tie = |k: usize| {
        let [along, up] = [k % TIES[0], k / TIES[0]];
        let [along, up] = [
            along as f64 / (TIES[0] - 1) as f64,
            up as f64 / (TIES[1] - 1) as f64,
        ];
        let relief = 0.03 * (7.0 * k as f64).sin();
        Point3::new(
            relief - 0.2 * up * height_m,
            (along - 0.5) * width_m,
            up * height_m,
        )
    };
    (0..TIES[0] * TIES[1]).map(tie).collect()
}

/// What a free bundle of photos that share one camera makes of their poses, and last of the camera.
fn bundle<'a>(photos: impl Iterator<Item = &'a Photo>, ties: &[Point3<f64>]) -> DVector<f64> {
    let photos: Vec<&Photo> = photos.collect();
    let (rows, unknowns) = (2 * photos.len(), 6 * photos.len() + CAMERA);
    let (mut information, mut right) = (DMatrix::zeros(unknowns, unknowns), DVector::zeros(unknowns));
    for tie in ties {
        let mut by_unknowns = DMatrix::zeros(rows, unknowns);
        let mut by_place = DMatrix::zeros(rows, 3);
        let mut shifts = DVector::zeros(rows);
        for (k, photo) in photos.iter().enumerate() {
            let (of_pose, of_place) = photo.derivatives(tie);
            let of_camera = photo.by_camera(tie);
            by_unknowns
                .fixed_view_mut::<2, 6>(2 * k, 6 * k)
                .copy_from(&of_pose);
            by_unknowns
                .fixed_view_mut::<2, CAMERA>(2 * k, 6 * photos.len())
                .copy_from(&of_camera);
            by_place.fixed_view_mut::<2, 3>(2 * k, 0).copy_from(&of_place);
            shifts.fixed_rows_mut::<2>(2 * k).copy_from(&photo.principal);
        }
        let inverse = (by_place.transpose() * &by_place).try_inverse().unwrap();
        let kept = DMatrix::identity(rows, rows) - &by_place * inverse * by_place.transpose();
        let kept = by_unknowns.transpose() * kept;
        information += &kept * &by_unknowns;
        right += kept * shifts;
    }
    for k in 0..unknowns {
        information[(k, k)] += RIDGE * information[(k, k)];
    }
    information.cholesky().unwrap().solve(&right)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(is_joint: bool, seed: u64) -> PhotoErrors {
        PhotoErrors::new(is_joint, [3.0, 2.0], seed)
    }

    /// Root mean square of what is left of the image shifts after bundle and matching, pixels, and of the difference of
    /// the epochs out of the wall, millimetres.
    fn sizes(is_joint: bool) -> [f64; 2] {
        let (mut left, mut apart, mut counts) = (0.0, 0.0, [0.0, 0.0]);
        for seed in 0..12 {
            let errors = errors(is_joint, seed);
            for place in ties([3.0, 2.0]) {
                let [one, two] = errors.epochs.each_ref().map(|e| e.bent(&place));
                apart += (1e3 * (two - one).x).powi(2);
                counts[0] += 1.0;
                for epoch in &errors.epochs {
                    let moved = epoch.triangulated(&place);
                    for (k, photo) in epoch.photos.iter().enumerate() {
                        let rest = epoch.left(k, &place) - photo.derivatives(&place).1 * moved;
                        left += rest.norm_squared() / 2.0;
                        counts[1] += 1.0;
                    }
                }
            }
        }
        [(left / counts[1]).sqrt(), (apart / counts[0]).sqrt()]
    }

    /// Measured on two real walls: image residuals of 0.05 to 0.12 px, clouds of one bundle apart by about 1 mm, of a
    /// bundle an epoch by more.
    #[test]
    fn errors_are_as_large_as_on_real_walls() {
        let [left_px, apart_mm] = sizes(true);
        assert!((0.04..0.15).contains(&left_px), "{left_px} px");
        assert!((0.4..2.0).contains(&apart_mm), "{apart_mm} mm");
        let [_, single_mm] = sizes(false);
        assert!(single_mm > 1.4 * apart_mm, "{single_mm} mm against {apart_mm}");
    }

    /// A turn or a shift of all photos is no error of the interior orientation: the derivatives agree with differences.
    #[test]
    fn derivatives_agree_with_differences() {
        let errors = errors(true, 3);
        let photo = &errors.epochs[0].photos[1];
        let place = Point3::new(0.1, -0.7, 1.3);
        let shown = |axes: &Matrix3<f64>, centre: &Point3<f64>, place: &Point3<f64>| {
            let p = axes * (place - centre);
            Vector2::new(p.x, p.y) * (FOCAL_PX / p.z)
        };
        let (by_pose, by_place) = photo.derivatives(&place);
        const STEP: f64 = 1e-6;
        for axis in 0..3 {
            let step = Vector3::ith(axis, STEP);
            let turned = nalgebra::Rotation3::new(step).into_inner() * photo.axes;
            let cases = [
                (
                    shown(&turned, &photo.centre, &place),
                    by_pose.column(axis).into_owned(),
                ),
                (
                    shown(&photo.axes, &(photo.centre + step), &place),
                    by_pose.column(3 + axis).into_owned(),
                ),
                (
                    shown(&photo.axes, &photo.centre, &(place + step)),
                    by_place.column(axis).into_owned(),
                ),
            ];
            for (moved, derivative) in cases {
                let difference = (moved - shown(&photo.axes, &photo.centre, &place)) / STEP;
                assert!(
                    (difference - derivative).norm() < 1e-2,
                    "{difference} {derivative}"
                );
            }
        }
    }
}
