//! `info` of photos and label images.

use super::described::Described;
use crate::counted::counted;
use anyhow::{Result, bail};
use serde_json::json;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use stonewise_io::exif::{Exif, read_exif};
use stonewise_io::image_io::{photos_in, picture_head};
use stonewise_io::masks::read_label_png;

/// A folder of photos, or of label images: those are grey.
pub fn pictures(folder: &Path) -> Result<Described> {
    let paths = photos_in(folder)?;
    if paths.is_empty() {
        bail!(
            "neither photos, label images nor a COLMAP model in the folder: {}",
            folder.display()
        );
    }
    let (mut sizes, mut broken, mut files) = (BTreeMap::new(), String::new(), Vec::new());
    let mut cameras: BTreeMap<String, usize> = BTreeMap::new();
    let (mut dates, mut positions) = (Vec::new(), 0);
    for path in &paths {
        let name = path.strip_prefix(folder).unwrap_or(path).display().to_string();
        let head = match picture_head(path) {
            Ok(head) => head,
            Err(error) if paths.len() == 1 => return Err(error.into()),
            Err(error) => {
                broken += &format!("  not usable: {error}\n");
                files.push(json!({ "name": name, "error": error.to_string() }));
                continue;
            }
        };
        *sizes.entry((head.is_label, head.width, head.height)).or_insert(0) += 1;
        let exif = read_exif(path).unwrap_or_default();
        if let Some(camera) = camera(&exif) {
            *cameras.entry(camera).or_default() += 1;
        }
        dates.extend(exif.taken.clone());
        positions += usize::from(exif.position.is_some());
        files.push(json!({
            "name": name, "width": head.width, "height": head.height, "is_label": head.is_label, "exif": exif,
        }));
    }
    let mut text = String::new();
    for ((is_label, width, height), count) in sizes {
        let what = counted(count, if is_label { "label image" } else { "photo" });
        let _ = writeln!(text, "  {what} of {width} x {height} px");
    }
    for (camera, count) in cameras {
        let _ = writeln!(text, "  {} by {camera}", counted(count, "photo"));
    }
    dates.sort_unstable();
    if let (Some(first), Some(last)) = (dates.first(), dates.last()) {
        let _ = writeln!(text, "  taken {first} to {last}");
    }
    if positions > 0 {
        let _ = writeln!(text, "  {} with a GPS position", counted(positions, "photo"));
    }
    Ok(Described {
        text: text + &broken,
        json: json!({ "kind": "pictures", "files": files }),
    })
}

/// One photo or label image.
pub fn picture(path: &Path) -> Result<Described> {
    let head = picture_head(path)?;
    let size = format!("{} x {} px", head.width, head.height);
    if head.is_label {
        let labels = read_label_png(path)?;
        let mut values: Vec<u32> = labels.data().to_vec();
        values.sort_unstable();
        values.dedup();
        let instances = values.iter().filter(|&&value| value != 0).count();
        return Ok(Described {
            text: format!("  label image, {size}, {}\n", counted(instances, "instance")),
            json: json!({
                "kind": "label image", "width": head.width, "height": head.height, "instances": instances,
            }),
        });
    }
    let exif = read_exif(path).unwrap_or_default();
    let mut text = format!("  photo, {size}\n");
    if let Some(camera) = camera(&exif) {
        let _ = writeln!(text, "  {camera}");
    }
    if let Some(taken) = &exif.taken {
        let _ = writeln!(text, "  taken {taken}");
    }
    if let Some([latitude, longitude]) = exif.position {
        let altitude = exif.altitude_m.map_or(String::new(), |a| format!(", {a:.1} m"));
        let _ = writeln!(text, "  GPS {latitude:.7}, {longitude:.7}{altitude}");
    }
    Ok(Described {
        text,
        json: json!({ "kind": "photo", "width": head.width, "height": head.height, "exif": exif }),
    })
}

/// Camera and focal length.
fn camera(exif: &Exif) -> Option<String> {
    let focal = exif.focal_mm.map(|f| format!("f {f} mm"));
    let film = exif.focal_35_mm.map(|f| format!("{f} mm on 35 mm film"));
    let parts: Vec<String> = [exif.camera.clone(), focal, film].into_iter().flatten().collect();
    (!parts.is_empty()).then(|| parts.join(", "))
}
