//! From the frames of cameras and chunks to the world.

use super::super::{CameraError, malformed};
use super::numbers::parse_numbers;
use crate::xml::Element;
use nalgebra::{Matrix3, Point3, Vector3};
use std::path::Path;
use stonewise_core::geometry::{Rigid3, nearest_rotation};

/// Chunk to world: scale, then rotation, then translation.
pub struct Similarity {
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
    scale: f64,
}

impl Similarity {
    fn identity() -> Self {
        Self {
            rotation: Matrix3::identity(),
            translation: Vector3::zeros(),
            scale: 1.0,
        }
    }

    /// A `<transform>`; `None` where it is empty.
    fn read(element: Element<'_>, path: &Path) -> Result<Option<Self>, CameraError> {
        if element.children().next().is_none() {
            let text = element.text();
            if text.trim().is_empty() {
                return Ok(None);
            }
            let m = parse_numbers::<16>(&text, element, path)?;
            let linear = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
            let scale = linear.determinant().cbrt();
            let rotation = checked_rotation(&(linear / scale), element, path)?;
            return Ok(Some(Self {
                rotation,
                translation: Vector3::new(m[3], m[7], m[11]),
                scale,
            }));
        }

        let mut similarity = Self::identity();
        if let Some(rotation) = element.child("rotation") {
            let m = parse_numbers::<9>(&rotation.text(), rotation, path)?;
            similarity.rotation = checked_rotation(&Matrix3::from_row_slice(&m), rotation, path)?;
        }

        if let Some(translation) = element.child("translation") {
            similarity.translation = parse_numbers::<3>(&translation.text(), translation, path)?.into();
        }

        if let Some(scale) = element.child("scale") {
            [similarity.scale] = parse_numbers::<1>(&scale.text(), scale, path)?;
            if similarity.scale <= 0.0 {
                return Err(malformed(path, scale.place(), "scale must be positive"));
            }
        }

        Ok(Some(similarity))
    }

    /// The pose of a camera whose `<transform>` takes camera to chunk.
    pub fn cam_from_world(&self, transform: Element<'_>, path: &Path) -> Result<Rigid3, CameraError> {
        let m = parse_numbers::<16>(&transform.text(), transform, path)?;
        let linear = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
        let chunk_from_cam = checked_rotation(&linear, transform, path)?;
        let centre = self.rotation * Vector3::new(m[3], m[7], m[11]) * self.scale + self.translation;
        let world_from_cam = Rigid3::from_parts(
            Point3::from(centre).into(),
            nearest_rotation(&(self.rotation * chunk_from_cam)),
        );
        Ok(world_from_cam.inverse())
    }
}

/// The transforms of a chunk and its components.
pub struct Frames {
    chunk: Option<Similarity>,
    components: Vec<(String, Option<Similarity>)>,
    identity: Similarity,
}

impl Frames {
    pub fn read(chunk: Element<'_>, path: &Path) -> Result<Self, CameraError> {
        let own = |element: Element<'_>| match element.child("transform") {
            Some(transform) => Similarity::read(transform, path),
            None => Ok(None),
        };
        let mut components = Vec::new();
        if let Some(list) = chunk.child("components") {
            for component in list.all("component") {
                let id = component.attribute("id").unwrap_or_default().to_owned();
                components.push((id, own(component)?));
            }
        }
        Ok(Self {
            chunk: own(chunk)?,
            components,
            identity: Similarity::identity(),
        })
    }

    /// The frame of a camera: its component's, else the chunk's, else the chunk's own coordinates.
    pub fn of(&self, component_id: Option<&str>) -> Result<&Similarity, String> {
        let component = component_id.and_then(|id| self.components.iter().find(|(key, _)| key == id));
        if let Some((_, Some(frame))) = component {
            return Ok(frame);
        }
        let others_have_one = self.components.iter().any(|(_, frame)| frame.is_some());
        match (component, &self.chunk) {
            (Some((id, None)), _) if others_have_one => Err(format!(
                "component {id} is not placed in the world: merge the components"
            )),
            (_, Some(frame)) => Ok(frame),
            (None, None) if others_have_one => {
                // A camera without a component, in a file whose only transforms are components'.
                let mut placed = self.components.iter().filter_map(|(_, frame)| frame.as_ref());
                match (placed.next(), placed.next()) {
                    (Some(frame), None) => Ok(frame),
                    _ => Err("belongs to no component, and several have a transform".to_owned()),
                }
            }
            (_, None) => Ok(&self.identity),
        }
    }
}

fn checked_rotation(
    matrix: &Matrix3<f64>,
    place: Element<'_>,
    path: &Path,
) -> Result<Matrix3<f64>, CameraError> {
    let rotation = nearest_rotation(matrix).to_rotation_matrix().into_inner();
    if (rotation - matrix).abs().max() < 1e-3 {
        Ok(rotation)
    } else {
        Err(malformed(path, place.place(), "not a rotation matrix"))
    }
}
