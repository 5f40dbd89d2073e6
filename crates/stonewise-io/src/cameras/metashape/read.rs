//! Reading of chunks, components and cameras.

use super::super::map_frame::{MapFrame, Placing};
use super::super::{CameraError, CameraFile, Remark, malformed, parse_xml, read_text};
use super::frame::{Frames, Similarity};
use super::sensor;
use crate::crs::in_metres;
use crate::xml::Element;
use std::collections::BTreeMap;
use std::path::Path;
use stonewise_core::geometry::{Camera, View};
use stonewise_core::id::ImageId;

/// Reads the first enabled chunk that has aligned cameras, and brings them to the clouds.
pub fn read(path: &Path, map: &MapFrame) -> Result<CameraFile, CameraError> {
    let text = read_text(path)?;
    let document = parse_xml(&text, path)?;
    let root = Element::root(&document);
    let chunks: Vec<Element> = match root.name() {
        "chunk" => vec![root],
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
            fallback.warnings.push(Remark::ChunkDisabled(label.to_owned()));
        } else if let Some(file) = &mut chosen {
            file.warnings.push(Remark::ChunkNotRead {
                chunk: label.to_owned(),
                used: used_label.to_owned(),
            });
        } else {
            let file = read_chunk(chunk, path, map)?;
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

fn read_chunk(chunk: Element<'_>, path: &Path, map: &MapFrame) -> Result<CameraFile, CameraError> {
    let mut file = CameraFile {
        crs: chunk
            .child("reference")
            .map(|r| r.text().trim().to_owned())
            .filter(|crs| !crs.is_empty()),
        ..CameraFile::default()
    };
    let frames = Frames::read(chunk, path)?;
    let mut sensors: BTreeMap<&str, Camera> = BTreeMap::new();
    for (group, element) in cameras(chunk) {
        let label = element.attribute("label").unwrap_or_default();
        // The group of photos that were added as a folder has the folder's name.
        let name = group.map_or_else(|| label.to_owned(), |group| format!("{group}/{label}"));
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
        file.rolling_shutter |= element.child("rolling_shutter").is_some();
        file.views.push(View {
            image: ImageId(file.views.len() as u32),
            camera: sensors[id].clone(),
            cam_from_world: posed.frame.cam_from_world(posed.transform, path)?,
            name,
        });
    }
    if file.rolling_shutter {
        file.warnings.push(Remark::RollingShutter);
    }
    if file.crs.is_some() && !file.views.is_empty() {
        place(&mut file, path, map)?;
    }
    Ok(file)
}

/// The cameras of a chunk, each with the label of its group.
fn cameras(chunk: Element<'_>) -> impl Iterator<Item = (Option<&str>, Element<'_>)> {
    let entries = chunk.child("cameras").into_iter().flat_map(Element::children);
    entries.flat_map(|entry| {
        let group = entry.attribute("label").filter(|_| entry.name() == "group");
        entry.below("camera").map(move |camera| (group, camera))
    })
}

/// Brings the cameras of a chunk to the clouds: Metashape stores the poses of all but local chunks
/// earth-centred.
fn place(file: &mut CameraFile, path: &Path, map: &MapFrame) -> Result<(), CameraError> {
    let crs = file.crs.clone().unwrap_or_default();
    let unsupported = |reason| CameraError::UnsupportedCrs {
        path: path.to_owned(),
        crs: crs.split('"').nth(1).unwrap_or(&crs).to_owned(),
        reason,
    };
    if let Placing::Mapped(placing) = map.placing(&crs).map_err(unsupported)? {
        for view in &mut file.views {
            placing.place(view).map_err(unsupported)?;
        }
        let crs = map.crs.clone().or_else(|| file.crs.take());
        file.crs = crs.map(|crs| in_metres(&crs));
    }
    Ok(())
}

struct Posed<'a> {
    transform: Element<'a>,
    frame: &'a Similarity,
}

/// The camera's own transform and the frame it is in, or why it has none.
fn posed<'a>(camera: Element<'a>, frames: &'a Frames) -> Result<Posed<'a>, Remark> {
    if is_disabled(camera) {
        return Err(Remark::Disabled);
    }
    let Some(transform) = camera.child("transform") else {
        return Err(match camera.attribute("master_id") {
            Some(master) if camera.attribute("id") != Some(master) => Remark::RigSlave,
            _ => Remark::NotAligned,
        });
    };
    let frame = frames
        .of(camera.attribute("component_id"))
        .map_err(Remark::NotPlaced)?;
    Ok(Posed { transform, frame })
}

fn find_sensor<'a>(
    chunk: Element<'a>,
    id: &str,
    camera: Element<'_>,
    path: &Path,
) -> Result<Element<'a>, CameraError> {
    chunk
        .child("sensors")
        .and_then(|list| list.children().find(|s| s.attribute("id") == Some(id)))
        .ok_or_else(|| malformed(path, camera.place(), format!("sensor_id {id:?} names no sensor")))
}

fn is_disabled(element: Element<'_>) -> bool {
    matches!(element.attribute("enabled"), Some("false" | "0"))
}
