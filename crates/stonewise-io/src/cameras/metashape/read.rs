//! Reading of chunks, components and cameras.

use super::super::xml::{Element, parse};
use super::super::{CameraError, CameraFile, malformed, read_text};
use super::sensor;
use nalgebra::{Matrix3, Point3, Vector3};
use std::collections::BTreeMap;
use std::path::Path;
use stonewise_core::geometry::{Camera, Rigid3, View, nearest_rotation};
use stonewise_core::id::ImageId;

/// Reads the first enabled chunk that has aligned cameras.
pub fn read(path: &Path) -> Result<CameraFile, CameraError> {
    let text = read_text(path)?;
    let root = parse(&text, path)?;
    let chunks: Vec<&Element> = match root.name.as_str() {
        "chunk" => vec![&root],
        "document" => root.all("chunk").collect(),
        other => {
            let problem = format!("<{other}> where Metashape writes <document>");
            return Err(malformed(path, root.place(), problem));
        }
    };
    let mut fallback = CameraFile::default();
    let mut chosen: Option<CameraFile> = None;
    let mut used_label = "";
    for chunk in chunks {
        let label = chunk.attribute("label").unwrap_or("without label");
        if is_disabled(chunk) {
            fallback
                .warnings
                .push(format!("chunk {label} is disabled and was not read"));
        } else if let Some(file) = &mut chosen {
            let warning =
                format!("chunk {label} was not read, only {used_label}, the first with aligned cameras");
            file.warnings.push(warning);
        } else {
            let file = read_chunk(chunk, path)?;
            if file.views.is_empty() {
                fallback.skipped.extend(file.skipped);
            } else {
                used_label = label;
                chosen = Some(file);
            }
        }
    }
    Ok(match chosen {
        Some(mut file) => {
            file.warnings.extend(fallback.warnings);
            file
        }
        None => fallback,
    })
}

fn read_chunk(chunk: &Element, path: &Path) -> Result<CameraFile, CameraError> {
    let mut file = CameraFile {
        crs: chunk
            .child("reference")
            .map(|r| r.text.trim().to_owned())
            .filter(|crs| !crs.is_empty()),
        ..CameraFile::default()
    };
    let frames = Frames::read(chunk, path)?;
    let mut sensors: BTreeMap<&str, Camera> = BTreeMap::new();
    let mut rolling = false;
    let mut cameras = Vec::new();
    if let Some(list) = chunk.child("cameras") {
        collect_cameras(list, &mut cameras);
    }
    for element in cameras {
        let name = element.attribute("label").unwrap_or_default().to_owned();
        let posed = match posed(element, &frames) {
            Ok(posed) => posed,
            Err(reason) => {
                file.skipped.push((name, reason));
                continue;
            }
        };
        let id = element.attribute("sensor_id").unwrap_or_default();
        if !sensors.contains_key(id) {
            sensors.insert(
                id,
                sensor::camera(find_sensor(chunk, id, element, path)?, &name, path)?,
            );
        }
        rolling |= element.child("rolling_shutter").is_some();
        file.views.push(View {
            image: ImageId(file.views.len() as u32),
            camera: sensors[id].clone(),
            cam_from_world: posed.frame.cam_from_world(posed.transform, path)?,
            name,
        });
    }
    if rolling {
        let warning = "rolling shutter compensation is not applied: points may fall some pixels beside their photo place";
        file.warnings.push(warning.to_owned());
    }
    if let Some(crs) = &file.crs
        && !file.views.is_empty()
    {
        check_crs(crs, path)?;
    }
    Ok(file)
}

/// Cameras in file order, those in groups included.
fn collect_cameras<'a>(parent: &'a Element, cameras: &mut Vec<&'a Element>) {
    for child in &parent.children {
        match child.name.as_str() {
            "camera" => cameras.push(child),
            "group" => collect_cameras(child, cameras),
            _ => {}
        }
    }
}

struct Posed<'a> {
    transform: &'a Element,
    frame: &'a Similarity,
}

/// The camera's own transform and the frame it is in, or why it has none.
fn posed<'a>(camera: &'a Element, frames: &'a Frames) -> Result<Posed<'a>, String> {
    if is_disabled(camera) {
        return Err("disabled in Metashape".to_owned());
    }
    let Some(transform) = camera.child("transform") else {
        return Err(match camera.attribute("master_id") {
            Some(master) if camera.attribute("id") != Some(master) => {
                "slave of a multi-camera rig, stored without a pose of its own".to_owned()
            }
            _ => "not aligned".to_owned(),
        });
    };
    let frame = frames.of(camera.attribute("component_id"))?;
    Ok(Posed { transform, frame })
}

fn find_sensor<'a>(
    chunk: &'a Element,
    id: &str,
    camera: &Element,
    path: &Path,
) -> Result<&'a Element, CameraError> {
    chunk
        .child("sensors")
        .and_then(|list| list.children.iter().find(|s| s.attribute("id") == Some(id)))
        .ok_or_else(|| malformed(path, camera.place(), format!("sensor_id {id:?} names no sensor")))
}

/// Accepts Cartesian frames; Metashape stores the poses of all others geocentrically.
fn check_crs(crs: &str, path: &Path) -> Result<(), CameraError> {
    let keyword = crs.split('[').next().unwrap_or_default().trim().to_uppercase();
    let name = crs.split('"').nth(1).unwrap_or(crs);
    match keyword.as_str() {
        "LOCAL_CS" | "ENGCRS" | "ENGINEERINGCRS" | "GEOCCS" | "GEODCRS" if !is_ellipsoidal(crs) => Ok(()),
        _ => Err(CameraError::UnsupportedCrs {
            path: path.to_owned(),
            crs: format!("{keyword} {name}").trim().to_owned(),
        }),
    }
}

/// Whether a WKT 2 geodetic system has latitudes and longitudes.
fn is_ellipsoidal(crs: &str) -> bool {
    crs.to_lowercase().contains("cs[ellipsoidal")
}

/// Chunk to world: scale, then rotation, then translation.
struct Similarity {
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
    fn read(element: &Element, path: &Path) -> Result<Option<Self>, CameraError> {
        if element.children.is_empty() && element.text.trim().is_empty() {
            return Ok(None);
        }
        if element.children.is_empty() {
            let m = parse_numbers::<16>(&element.text, element, path)?;
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
            let m = parse_numbers::<9>(&rotation.text, rotation, path)?;
            similarity.rotation = checked_rotation(&Matrix3::from_row_slice(&m), rotation, path)?;
        }
        if let Some(translation) = element.child("translation") {
            similarity.translation = parse_numbers::<3>(&translation.text, translation, path)?.into();
        }
        if let Some(scale) = element.child("scale") {
            [similarity.scale] = parse_numbers::<1>(&scale.text, scale, path)?;
            if similarity.scale <= 0.0 {
                return Err(malformed(path, scale.place(), "scale must be positive"));
            }
        }
        Ok(Some(similarity))
    }

    /// The pose of a camera whose `<transform>` takes camera to chunk.
    fn cam_from_world(&self, transform: &Element, path: &Path) -> Result<Rigid3, CameraError> {
        let m = parse_numbers::<16>(&transform.text, transform, path)?;
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
struct Frames {
    chunk: Option<Similarity>,
    components: Vec<(String, Option<Similarity>)>,
    identity: Similarity,
}

impl Frames {
    fn read(chunk: &Element, path: &Path) -> Result<Self, CameraError> {
        let own = |element: &Element| match element.child("transform") {
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
    fn of(&self, component_id: Option<&str>) -> Result<&Similarity, String> {
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

fn is_disabled(element: &Element) -> bool {
    matches!(element.attribute("enabled"), Some("false" | "0"))
}

fn checked_rotation(
    matrix: &Matrix3<f64>,
    place: &Element,
    path: &Path,
) -> Result<Matrix3<f64>, CameraError> {
    let rotation = nearest_rotation(matrix).to_rotation_matrix().into_inner();
    if (rotation - matrix).abs().max() < 1e-3 {
        Ok(rotation)
    } else {
        Err(malformed(path, place.place(), "not a rotation matrix"))
    }
}

/// The number in a child element; `None` where there is no such child.
pub fn child_number(parent: &Element, name: &str, path: &Path) -> Result<Option<f64>, CameraError> {
    parent
        .child(name)
        .map(|child| parse_numbers::<1>(&child.text, child, path).map(|[value]| value))
        .transpose()
}

/// Exactly N finite numbers.
pub fn parse_numbers<const N: usize>(
    text: &str,
    place: &Element,
    path: &Path,
) -> Result<[f64; N], CameraError> {
    let numbers: Option<Vec<f64>> = text
        .split_whitespace()
        .map(|word| word.parse::<f64>().ok().filter(|v| v.is_finite()))
        .collect();
    numbers
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| {
            malformed(
                path,
                place.place(),
                format!("{N} numbers expected, found {:?}", text.trim()),
            )
        })
}
