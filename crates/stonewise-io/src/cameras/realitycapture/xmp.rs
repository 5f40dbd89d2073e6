//! XMP sidecars: a file of the photo's name beside it.

use super::super::photo_sizes::PhotoSizes;
use super::super::pose::{camera_at, rotation};
use super::super::{CameraError, CameraFile, Remark, malformed, parse_xml, read_text};
use super::lens::{FILM_MM, Lens, unsupported};
use crate::folder::files_below;
use crate::text;
use crate::xml::Element;
use nalgebra::{Matrix3, Point3};
use std::path::Path;
use stonewise_core::geometry::{Rigid3, View};
use stonewise_core::id::ImageId;

/// What the namespace begins with that distinguishes these sidecars from those of other programs.
const NAMESPACE: &str = "http://www.capturingreality.com/ns/xcr/";

/// Whether sidecars of RealityCapture lie in a folder itself.
pub fn is_sidecar_folder(folder: &Path) -> bool {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut paths = entries.map(|entry| entry.path());
    paths.any(|path| is_xmp(&path) && text::read_text(&path).is_ok_and(|text| text.contains(NAMESPACE)))
}

fn is_xmp(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("xmp"))
}

/// Reads the sidecars in a folder and below it, sorted.
pub fn read_sidecars(folder: &Path, photos: Option<&Path>) -> Result<CameraFile, CameraError> {
    let mut paths =
        files_below(folder, &is_xmp).map_err(|(path, source)| CameraError::Read { path, source })?;
    paths.sort();
    let mut file = CameraFile::default();
    let mut sidecars = Vec::new();

    for path in &paths {
        let text = read_text(path)?;
        if !text.contains(NAMESPACE) {
            continue;
        }
        let name = path.strip_prefix(folder).unwrap_or(path).with_extension("");
        let name = name.to_string_lossy().into_owned();
        let document = parse_xml(&text, path)?;
        match Sidecar::of(Element::root(&document), path, &name)? {
            Some(sidecar) => sidecars.push((name, sidecar)),
            None => file.skipped.push((name, Remark::NotAligned)),
        }
    }

    if sidecars.is_empty() {
        return Ok(file);
    }
    let names: Vec<&str> = sidecars.iter().map(|(name, _)| name.as_str()).collect();
    let sizes = PhotoSizes::below(photos.unwrap_or(folder), folder)?.of(&names)?;

    for ((name, sidecar), size) in sidecars.into_iter().zip(sizes) {
        file.views.push(View {
            image: ImageId(file.views.len() as u32),
            name,
            camera: sidecar.lens.camera(size),
            cam_from_world: sidecar.pose,
        });
    }

    Ok(file)
}

/// What a sidecar says of its photo.
struct Sidecar {
    lens: Lens,
    pose: Rigid3,
}

impl Sidecar {
    /// `None` where it gives no pose.
    fn of(root: Element<'_>, path: &Path, photo: &str) -> Result<Option<Self>, CameraError> {
        let descriptions = root.all("RDF").flat_map(|rdf| rdf.all("Description"));
        let mut tags = descriptions.map(|element| Tags { element, path });
        let Some(tags) = tags.find(|tags| tags.text("Position").is_some() && tags.text("Rotation").is_some())
        else {
            return Ok(None);
        };

        let turn = Matrix3::from_row_slice(&tags.numbers("Rotation", [0.0; 9])?);
        let turn = rotation(&turn).ok_or_else(|| tags.bad("xcr:Rotation is no rotation"))?;
        let centre = Point3::from(tags.numbers("Position", [0.0; 3])?);
        Ok(Some(Self {
            lens: tags.lens(photo)?,
            pose: camera_at(centre, &turn),
        }))
    }
}

/// Values are attributes or elements, whichever the version of the program writes.
struct Tags<'a> {
    element: Element<'a>,
    path: &'a Path,
}

impl Tags<'_> {
    fn text(&self, name: &str) -> Option<String> {
        self.element.value_in(NAMESPACE, name)
    }

    fn numbers<const N: usize>(&self, name: &str, or: [f64; N]) -> Result<[f64; N], CameraError> {
        let Some(text) = self.text(name) else {
            return Ok(or);
        };
        let words = text.split_ascii_whitespace();
        let values: Option<Vec<f64>> = words
            .map(|word| word.parse().ok().filter(|v: &f64| v.is_finite()))
            .collect();
        values
            .and_then(|values| values.try_into().ok())
            .ok_or_else(|| self.bad(&format!("xcr:{name} needs {N} number(s): {text:?}")))
    }

    fn bad(&self, problem: &str) -> CameraError {
        malformed(self.path, self.element.place(), problem)
    }

    fn lens(&self, photo: &str) -> Result<Lens, CameraError> {
        let model = self.text("DistortionModel");
        let model = model.as_deref().unwrap_or("none");
        let terms = self.numbers("DistortionCoeficients", [0.0; 6])?;
        let has_terms = terms.iter().any(|term| *term != 0.0);
        let terms = match model {
            "none" | "perspective" => [0.0; 6],
            "brown3" | "brown4" | "brown3t2" | "brown4t2" => terms,
            _ if !has_terms => terms,
            _ => return Err(unsupported(self.path, model, photo)),
        };
        let [skew] = self.numbers("Skew", [0.0])?;
        let [aspect] = self.numbers("AspectRatio", [1.0])?;
        if skew != 0.0 || aspect != 1.0 {
            return Err(unsupported(self.path, &format!("K + {model}"), photo));
        }
        let [focal_mm] = self.numbers("FocalLength35mm", [0.0])?;
        if focal_mm <= 0.0 {
            return Err(self.bad("a positive xcr:FocalLength35mm is missing"));
        }
        let [u] = self.numbers("PrincipalPointU", [0.0])?;
        let [v] = self.numbers("PrincipalPointV", [0.0])?;
        Ok(Lens {
            focal: focal_mm / FILM_MM,
            centre: [u, v],
            terms,
        })
    }
}
