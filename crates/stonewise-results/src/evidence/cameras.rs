//! Where the photos were taken from.

use super::files::{make_dir, path, read_table};
use nalgebra::{Point3, Vector3};
use std::path::Path;
use stonewise_base::error::Error;
use stonewise_core::geometry::View;
use stonewise_io::table::{Table, write_parquet};

/// A photo's place and frame in the world.
#[derive(Clone, Debug, PartialEq)]
pub struct PosedPhoto {
    /// Name of its camera.
    pub name: String,
    /// Centre of projection.
    pub centre: Point3<f64>,
    /// View axis, unit length.
    pub axis: Vector3<f64>,
    /// From the axis to the right edge of the picture, at a depth of one metre.
    pub right: Vector3<f64>,
    /// From the axis to the lower edge of the picture, at a depth of one metre.
    pub down: Vector3<f64>,
}

impl PosedPhoto {
    /// The frame of a view, lens distortion left aside.
    pub fn of(view: &View) -> Self {
        let world = |v: Vector3<f64>| view.cam_from_world.inverse_transform_vector(&v);
        let [fx, fy] = view.camera.focal_px;
        Self {
            name: view.name.clone(),
            centre: view.centre(),
            axis: world(Vector3::z()),
            right: world(Vector3::x()) * (f64::from(view.camera.width) / 2.0 / fx),
            down: world(Vector3::y()) * (f64::from(view.camera.height) / 2.0 / fy),
        }
    }
}

/// One of the vectors of a photo.
type VectorOf = fn(&PosedPhoto) -> Vector3<f64>;

/// Writes `evidence/cameras_E.parquet`.
///
/// # Errors
/// The file cannot be written.
pub fn write_cameras(dir: &Path, epoch: usize, photos: &[PosedPhoto]) -> Result<(), Error> {
    make_dir(dir)?;
    let mut table = Table::new();
    let names: Vec<String> = photos.iter().map(|p| p.name.clone()).collect();
    table.push("name", "", "name of the photo", names)?;
    let vectors: [(&str, &str, &str, VectorOf); 4] = [
        ("centre", "m", "projection centre", |p| p.centre.coords),
        ("axis", "", "unit vector of the view", |p| p.axis),
        (
            "right",
            "m",
            "from the view axis to the right edge of the picture, at a depth of one metre",
            |p| p.right,
        ),
        (
            "down",
            "m",
            "from the view axis to the lower edge of the picture, at a depth of one metre",
            |p| p.down,
        ),
    ];
    for (stem, unit, meaning, of) in vectors {
        for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
            let (name, meaning) = (format!("{stem}_{axis}"), format!("{meaning}, world {axis}"));
            let values: Vec<f64> = photos.iter().map(|p| of(p)[k]).collect();
            table.push(&name, unit, &meaning, values)?;
        }
    }
    Ok(write_parquet(&path(dir, "cameras", epoch, "parquet"), &table)?)
}

/// Reads it back; empty where there is none.
pub(super) fn read_cameras(dir: &Path, epoch: usize) -> Result<Vec<PosedPhoto>, Error> {
    let Some(table) = read_table(&path(dir, "cameras", epoch, "parquet"))? else {
        return Ok(Vec::new());
    };
    let names = table.required::<String>("name")?;
    let vector = |stem: &str| -> Result<Vec<Vector3<f64>>, Error> {
        let [x, y, z] = ["x", "y", "z"].map(|a| table.required::<f64>(&format!("{stem}_{a}")));
        let (x, y, z) = (x?, y?, z?);
        Ok((0..names.len()).map(|i| Vector3::new(x[i], y[i], z[i])).collect())
    };
    let (centre, axis, right, down) = (
        vector("centre")?,
        vector("axis")?,
        vector("right")?,
        vector("down")?,
    );
    let photo = |i: usize| PosedPhoto {
        name: names[i].clone(),
        centre: Point3::from(centre[i]),
        axis: axis[i],
        right: right[i],
        down: down[i],
    };
    Ok((0..names.len()).map(photo).collect())
}
