//! Posed photos.

use crate::arrays::{points, table};
use crate::error::{error, explained};
use nalgebra::{Matrix3, Point3, Translation3, UnitQuaternion, Vector3};
use numpy::{PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use std::path::PathBuf;
use stonewise_core::geometry::{self, Camera, Distortion, Rigid3};
use stonewise_core::id::ImageId;

/// A posed photo: what its camera shows, and from where.
///
/// Camera frame: x right, y down, z along the view. Pixels: x right, y down, the first pixel's centre at
/// (0.5, 0.5).
#[pyclass(frozen, module = "stonewise")]
pub struct View(pub geometry::View);

#[pymethods]
impl View {
    /// `rotation`: from world axes to those of the camera; `centre`: of projection, metres; `radial`: k1 to
    /// k4; `tangential`: p1, p2 in OpenCV's order.
    #[new]
    #[pyo3(signature = (width, height, focal_px, rotation, centre, *, principal_point_px=None, radial=[0.0; 4], tangential=[0.0; 2], name=String::new()))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        width: u32,
        height: u32,
        focal_px: f64,
        rotation: [[f64; 3]; 3],
        centre: [f64; 3],
        principal_point_px: Option<[f64; 2]>,
        radial: [f64; 4],
        tangential: [f64; 2],
        name: String,
    ) -> PyResult<Self> {
        let given = Matrix3::from_fn(|row, column| rotation[row][column]);
        let is_rotation =
            (given * given.transpose() - Matrix3::identity()).norm() < 1e-6 && given.determinant() > 0.0;

        if !is_rotation {
            return Err(error(
                "rotation must be a rotation matrix, from world axes to those of the camera",
            ));
        }

        if width == 0 || height == 0 || !(focal_px.is_finite() && focal_px > 0.0) {
            return Err(error("width, height and focal_px must be positive"));
        }
        let centre = Vector3::from(centre);
        if !centre.iter().all(|c| c.is_finite()) {
            return Err(error("centre must be finite"));
        }
        let mut camera = Camera::pinhole(width, height, focal_px);
        camera.center_px = principal_point_px.unwrap_or(camera.center_px);
        camera.distortion = Distortion::brown(radial, [0.0; 3], tangential);
        let turn = UnitQuaternion::from_matrix(&given);
        let shift = Translation3::from(-(turn * centre));

        Ok(Self(geometry::View {
            image: ImageId(0),
            name,
            camera,
            cam_from_world: Rigid3::from_parts(shift, turn),
        }))
    }

    /// Name of the photo in the camera file.
    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    /// Width of the photo, pixels.
    #[getter]
    fn width(&self) -> u32 {
        self.0.camera.width
    }

    /// Height of the photo, pixels.
    #[getter]
    fn height(&self) -> u32 {
        self.0.camera.height
    }

    /// Centre of projection (x, y, z), world, metres.
    #[getter]
    fn centre(&self) -> [f64; 3] {
        self.0.centre().coords.into()
    }

    /// Pixels (n, 2) of points (n, 3); NaN behind the camera and where the lens shows nothing. A pixel may
    /// lie outside the photo.
    fn project<'py>(
        &self,
        py: Python<'py>,
        points_world: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let list: Vec<Point3<f64>> = points(&points_world)?;
        let pixel = |p: &Point3<f64>| self.0.project(p).map_or([f64::NAN; 2], |found| found.pixel);
        let flat = list.iter().flat_map(pixel).collect();
        table(py, list.len(), 2, flat)
    }

    fn __repr__(&self) -> String {
        let camera = &self.0.camera;
        format!("View({:?}, {} x {} px)", self.0.name, camera.width, camera.height)
    }
}

/// The posed photos of a camera file: Metashape XML, COLMAP folder, OpenSfM reconstruction.json.
#[pyfunction]
pub fn read_cameras(path: PathBuf) -> PyResult<Vec<View>> {
    let file = stonewise_io::cameras::read_cameras(&path).map_err(explained)?;
    Ok(file.views.into_iter().map(View).collect())
}
