//! Cameras that lie on the earth, brought into the map coordinates of the clouds.
//!
//! A map is no rigid copy of the ground: its scale differs from that of heights, by up to 0.04 % in UTM. What
//! a camera sees of a linear copy is the picture of another camera at the same place (Hartley and Zisserman
//! 2004, section 6.2.4), whose focal lengths, centre and skew differ by as little. What remains is the
//! curvature of the earth, 0.8 mm at 100 m, and a thousandth of the lens's distortion.

use crate::crs::{Coordinates, Ellipsoid, Geoid, MapSystem, Projection, UnitName, Units, in_metres};
use nalgebra::{Matrix3, Point3, Vector3};
use std::path::PathBuf;
use stonewise_core::geometry::{Camera, Rigid3, View, nearest_rotation};

/// Half the way over which the turn of the map is measured, metres: long against rounding (1 nm), short
/// against the earth.
const STEP_M: f64 = 50.0;
/// Heights above the ellipsoid at which a camera can be, metres.
const HEIGHTS_M: std::ops::Range<f64> = -1000.0..20_000.0;

/// Where the clouds of a survey lie on the map.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MapFrame {
    /// System of the clouds' coordinates: WKT, or `EPSG:` and a code; `None` where they name none.
    pub crs: Option<String>,
    /// What was taken off the coordinates of the clouds, metres.
    pub false_origin: [f64; 3],
    /// Grid of the geoid above which the heights of the clouds are, in a format of [`Geoid::read`]; `None` for heights
    /// above the ellipsoid.
    pub geoid: Option<PathBuf>,
}

/// What happens to the poses of a chunk.
#[derive(Debug, PartialEq)]
pub enum Placing {
    /// They are in the frame of the clouds already.
    Kept,
    /// They are earth-centred, and are brought to the map of the clouds.
    Mapped(MapPlacing),
}

/// The way from earth-centred to map coordinates.
#[derive(Debug, PartialEq)]
pub struct MapPlacing {
    /// Name of the system of the clouds.
    pub name: String,
    ellipsoid: Ellipsoid,
    projection: Projection,
    false_origin: Vector3<f64>,
    geoid: Option<Geoid>,
}

impl MapFrame {
    /// How poses of a chunk in a system come to the clouds.
    ///
    /// # Errors
    /// Why they cannot.
    pub(super) fn placing(&self, chunk_crs: &str) -> Result<Placing, String> {
        // Poses on the earth are in metres, whatever the unit of the chunk's map, and so are the clouds once they are read.
        let units = Units::of(chunk_crs)?;
        let Some(chunk) = MapSystem::parse(&in_metres(chunk_crs))? else {
            return match units.are_metres() {
                true => Ok(Placing::Kept),
                false => Err(format!(
                    "it is a local frame in {}, and the file does not say whether its poses are, too: choose local coordinates in metres",
                    UnitName(units.plane_m)
                )),
            };
        };
        let clouds = match &self.crs {
            Some(text) => MapSystem::parse(&in_metres(text))
                .map_err(|reason| format!("of the clouds' system, {reason}"))?,
            None => None,
        };
        let target = match (clouds, chunk.coordinates) {
            (Some(clouds), _) => clouds,
            (None, Coordinates::Projected(_)) if !units.are_metres() => {
                return Err(format!(
                    "it is in {}, and the clouds name no system: give theirs as crs under [project]",
                    UnitName(units.plane_m)
                ));
            }
            (None, Coordinates::Projected(_)) => chunk.clone(),
            (None, Coordinates::Geocentric) => return Ok(Placing::Kept),
            (None, Coordinates::Geographic) => {
                return Err("the clouds name no system: give theirs as crs under [project]".to_owned());
            }
        };

        if !target.shares_datum(&chunk) {
            return Err(format!(
                "the clouds are in {}, on another geodetic datum, and shifts between datums are not covered",
                target.name
            ));
        }

        match target.coordinates {
            Coordinates::Geocentric => Ok(Placing::Kept),
            Coordinates::Geographic => Err(format!("the clouds are in degrees ({})", target.name)),
            Coordinates::Projected(projection) => {
                let geoid = self.geoid.as_deref().map(Geoid::read).transpose();
                let geoid = geoid.map_err(|error| error.to_string())?;
                if let (Some(heights), None) = (&target.heights, &geoid) {
                    return Err(format!(
                        "the heights of the clouds are above a geoid ({heights}): give its grid (GTX or GeoTIFF) as geoid under [project]"
                    ));
                }
                Ok(Placing::Mapped(MapPlacing {
                    name: target.name,
                    ellipsoid: target.ellipsoid,
                    projection,
                    false_origin: self.false_origin.into(),
                    geoid,
                }))
            }
        }
    }
}

impl MapPlacing {
    /// Brings a view from earth-centred to map coordinates.
    ///
    /// # Errors
    /// The camera is nowhere near the ground, off the map, or off the grid of the geoid.
    pub fn place(&self, view: &mut View) -> Result<(), String> {
        let centre = view.centre();
        let height = self.ellipsoid.geodetic(&centre).height_m;
        if !HEIGHTS_M.contains(&height) {
            return Err(format!(
                "photo {} would be {height:.0} m above the ellipsoid: its poses are not earth-centred",
                view.name
            ));
        }

        let place = self.map(&centre) - self.false_origin;
        let side = |axis: usize| {
            let step = Vector3::ith(axis, STEP_M);
            (self.map(&(centre + step)) - self.map(&(centre - step))) / (2.0 * STEP_M)
        };
        let turn = Matrix3::from_columns(&[side(0), side(1), side(2)]);
        let grid = if self.geoid.is_some() {
            ", or off the grid of the geoid"
        } else {
            ""
        };
        let off_map = || format!("photo {} lies off the map of {}{grid}", view.name, self.name);
        let is_on_map = place.iter().chain(turn.iter()).all(|v| v.is_finite());
        let earth_from_map = turn.try_inverse().filter(|_| is_on_map).ok_or_else(off_map)?;

        let seen = calibration(&view.camera)
            * view.cam_from_world.rotation.to_rotation_matrix().matrix()
            * earth_from_map;
        let (calibration, rotation) = split_camera(&seen);
        let is_camera = calibration.iter().chain(rotation.iter()).all(|v| v.is_finite());

        if !is_camera || rotation.determinant() < 0.5 {
            return Err(format!(
                "the camera of photo {} has impossible parameters",
                view.name
            ));
        }

        view.camera.focal_px = [calibration[(0, 0)], calibration[(1, 1)]];
        view.camera.center_px = [calibration[(0, 2)], calibration[(1, 2)]];
        view.camera.skew_px = calibration[(0, 1)];
        let world_from_cam = nearest_rotation(&rotation).inverse();
        view.cam_from_world = Rigid3::from_parts(place.into(), world_from_cam).inverse();
        Ok(())
    }

    fn map(&self, position: &Point3<f64>) -> Point3<f64> {
        let at = self.ellipsoid.geodetic(position);
        let [east, north] = self.projection.forward(&self.ellipsoid, &at);
        // Off the grid there is no height, which `place` refuses.
        let geoid_m = self.geoid.as_ref().map_or(Some(0.0), |geoid| geoid.height_m(&at));
        Point3::new(east, north, at.height_m - geoid_m.unwrap_or(f64::NAN))
    }
}

/// From directions in the camera to pixels.
fn calibration(camera: &Camera) -> Matrix3<f64> {
    let ([fx, fy], [cx, cy]) = (camera.focal_px, camera.center_px);
    Matrix3::new(fx, camera.skew_px, cx, 0.0, fy, cy, 0.0, 0.0, 1.0)
}

/// The calibration (upper triangular, 1 in the corner) and the rotation whose product is a multiple of the
/// matrix.
fn split_camera(seen: &Matrix3<f64>) -> (Matrix3<f64>, Matrix3<f64>) {
    let [u, v, w] = [0, 1, 2].map(|row| seen.row(row).transpose());
    let ahead = w.normalize();
    let down = (v - ahead * v.dot(&ahead)).normalize();
    let right = (u - ahead * u.dot(&ahead) - down * u.dot(&down)).normalize();
    let scale = w.norm();
    let calibration = Matrix3::new(
        u.dot(&right),
        u.dot(&down),
        u.dot(&ahead),
        0.0,
        v.dot(&down),
        v.dot(&ahead),
        0.0,
        0.0,
        scale,
    );
    let rotation = Matrix3::from_rows(&[right, down, ahead].map(|axis| axis.transpose()));
    (calibration / scale, rotation)
}
