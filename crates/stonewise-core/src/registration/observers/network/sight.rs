//! How an image point depends on its place, on the pose and camera of its photo, and on the photo's field.

use crate::geometry::{Camera, View};
use crate::registration::observers::sight::SeenStone;
use nalgebra::{DMatrix, Matrix2x3, Matrix2xX, Matrix3, Matrix3xX, SMatrix, Vector3};

/// Standard deviation of the principal point of a photo, pixels per axis: 2.3 and 3.5 px along the rows and the columns
/// of a camera with a stabiliser, 1.3 and 1.2 px of one without.
pub(super) const PRINCIPAL_PX: f64 = 3.0;
/// Standard deviation of each coefficient of a quadratic field at [`AT_SLOPE`] from the principal point, pixels: 0.41
/// and 0.26 px on the same two cameras.
pub(super) const QUADRATIC_PX: f64 = 0.3;
/// Tangent of the angle from the principal point to which this refers.
pub(super) const AT_SLOPE: f64 = 0.4;
/// Fields of a photo: principal point, and three quadratic terms on each axis.
pub(super) const FIELDS: usize = 8;
/// Unknowns of a pose: turn about the centre, and place of the centre.
pub(super) const POSE: usize = 6;
/// What a bundle estimates of a camera: focal length, principal point, two terms of radial distortion.
pub(super) const CAMERA: usize = 5;
/// Least cosine between a ray and the normal of the face that it shows.
const LEAST_COSINE: f64 = 0.2;
/// Step of the numerical derivatives as a share of the distance.
const STEP: f64 = 1e-5;
/// Least ratio of the smallest to the largest information on a place that photos see: below, their rays are parallel.
pub(super) const LEAST_INTERSECTION: f64 = 1e-4;

/// A photo that sees a place.
#[derive(Clone)]
pub(super) struct Sight {
    pub photo: usize,
    pub by_place: Matrix2x3<f64>,
    pub by_pose: SMatrix<f64, 2, POSE>,
    pub by_camera: SMatrix<f64, 2, CAMERA>,
    pub fields: SMatrix<f64, 2, FIELDS>,
}

impl Sight {
    pub fn of(photo: usize, view: &View, stone: &SeenStone) -> Option<Self> {
        let place = &stone.centroid;
        let ray = view.centre() - place;
        if ray.dot(&stone.normal) < LEAST_COSINE * ray.norm() {
            return None;
        }
        let pixel = view.project(place)?.pixel;
        if !view.is_inside(pixel) {
            return None;
        }
        let step = STEP * ray.norm();
        let mut by_place = Matrix2x3::zeros();
        for axis in 0..3 {
            let mut by = Vector3::zeros();
            by[axis] = step;
            let [after, before] = [
                view.project(&(place + by))?.pixel,
                view.project(&(place - by))?.pixel,
            ];
            for k in 0..2 {
                by_place[(k, axis)] = (after[k] - before[k]) / (2.0 * step);
            }
        }
        let mut by_pose = SMatrix::<f64, 2, POSE>::zeros();
        by_pose
            .fixed_columns_mut::<3>(0)
            .copy_from(&(by_place * ray.cross_matrix()));
        by_pose.fixed_columns_mut::<3>(3).copy_from(&-by_place);

        let [x, y] = slopes(&view.camera, pixel);
        let [fx, fy] = view.camera.focal_px;
        let square = x * x + y * y;
        #[rustfmt::skip]
        let by_camera = SMatrix::<f64, 2, CAMERA>::new(
            x, 1.0, 0.0, fx * x * square, fx * x * square * square,
            y, 0.0, 1.0, fy * y * square, fy * y * square * square,
        );
        let mut fields = SMatrix::<f64, 2, FIELDS>::zeros();
        let quadratic = QUADRATIC_PX / (AT_SLOPE * AT_SLOPE);
        let of_axis = [
            PRINCIPAL_PX,
            quadratic * x * x,
            quadratic * x * y,
            quadratic * y * y,
        ];
        for (term, value) in of_axis.into_iter().enumerate() {
            fields[(0, 2 * term)] = value;
            fields[(1, 2 * term + 1)] = value;
        }
        Some(Self {
            photo,
            by_place,
            by_pose,
            by_camera,
            fields,
        })
    }

    /// Shift of the image point by the fields of all photos.
    pub fn shifts(&self, fields: &DMatrix<f64>) -> Matrix2xX<f64> {
        self.fields * fields.rows(FIELDS * self.photo, FIELDS)
    }
}

/// Tangents of the angles from the principal point.
pub(super) fn slopes(camera: &Camera, pixel: [f64; 2]) -> [f64; 2] {
    [0, 1].map(|k| (pixel[k] - camera.center_px[k]) / camera.focal_px[k])
}

/// Inverse information of rays on a place; `None` where they do not intersect well.
pub(super) fn intersection(sights: &[&Sight]) -> Option<Matrix3<f64>> {
    let information: Matrix3<f64> = sights.iter().map(|s| s.by_place.transpose() * s.by_place).sum();
    let values = information.symmetric_eigenvalues();
    (values.min() > LEAST_INTERSECTION * values.max())
        .then(|| information.try_inverse())
        .flatten()
}

/// How shifts of image points pull a place.
pub(super) fn shift(sights: &[&Sight], of: impl Fn(&Sight) -> Matrix2xX<f64>) -> Matrix3xX<f64> {
    let pulls = sights.iter().map(|s| s.by_place.transpose() * of(s));
    pulls
        .reduce(|sum, pull| sum + pull)
        .unwrap_or_else(|| Matrix3xX::zeros(0))
}
