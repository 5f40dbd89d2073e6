//! Bundler's `bundle.out`, version 0.3.
//!
//! A camera sees R X + t with y up and z against the view; a pixel is f (1 + k1 r^2 + k2 r^4) times the place,
//! counted from the middle of the photo (Bundler v0.4 User's Manual, section "Output format and scene
//! representation"). The names of the photos lie beside the file.

use super::photo_sizes::PhotoSizes;
use super::pose::{FLIP, rotation};
use super::{CameraError, CameraFile, Remark, malformed, read_text};
use nalgebra::{Matrix3, Point3, Vector3};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::str::{FromStr, SplitAsciiWhitespace};
use stonewise_core::geometry::{Camera, Distortion, Rigid3, View};
use stonewise_core::id::ImageId;

const HEAD: &str = "# Bundle file v0.3";
/// Most points that are tested for lying in front of the photos that show them.
const POINTS: usize = 1000;

/// Whether a file is of this format, by its first line.
pub fn is_bundler(path: &Path) -> bool {
    let mut head = [0; HEAD.len()];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut head));
    read.is_ok() && head == HEAD.as_bytes()
}

/// Reads the file; photos without a camera are skipped.
pub fn read(path: &Path, photos: &PhotoSizes<'_>) -> Result<CameraFile, CameraError> {
    let text = read_text(path)?;
    let bad = |place: &str, problem: &str| malformed(path, place, problem);
    let body = text.trim_start().strip_prefix(HEAD);
    let body = body.ok_or_else(|| bad("line 1", "not a Bundler file: it begins with # Bundle file v0.3"))?;
    let mut values = Values(body.split_ascii_whitespace());
    let counts = values.next::<usize>().zip(values.next::<usize>());
    let (count, points) = counts.ok_or_else(|| bad("line 2", "expected the numbers of photos and points"))?;
    let names = names(path, count)?;

    let mut cameras = Vec::with_capacity(names.len());
    for name in &names {
        let place = format!("photo {name}");
        let problem = "expected 15 numbers: f, k1, k2, a rotation and a translation";
        let numbers = values.numbers().ok_or_else(|| bad(&place, problem))?;
        let is_aligned = numbers[0] != 0.0;
        let camera = BundlerCamera::of(&numbers).filter(|camera| !is_aligned || camera.focal_px > 0.0);
        if is_aligned && camera.is_none() {
            return Err(bad(
                &place,
                "its focal length must be positive, and its rotation a rotation",
            ));
        }
        cameras.push(camera.filter(|_| is_aligned));
    }
    check_side(&mut values, points.min(POINTS), &cameras).map_err(|problem| bad("the points", &problem))?;

    let all: Vec<&str> = names.iter().map(String::as_str).collect();
    let sizes = photos.of(&all)?;
    let mut file = CameraFile::default();
    for ((name, camera), size) in names.iter().zip(cameras).zip(sizes) {
        match camera {
            Some(camera) => file.views.push(View {
                image: ImageId(file.views.len() as u32),
                name: name.clone(),
                camera: camera.lens(size),
                cam_from_world: camera.cam_from_world,
            }),
            None => file.skipped.push((name.clone(), Remark::NotAligned)),
        }
    }
    Ok(file)
}

/// A camera as the file gives it.
struct BundlerCamera {
    focal_px: f64,
    radial: [f64; 4],
    cam_from_world: Rigid3,
}

impl BundlerCamera {
    /// `None` where the numbers hold no rotation.
    fn of(numbers: &[f64; 15]) -> Option<Self> {
        let [focal_px, k1, k2, rest @ ..] = *numbers;
        let turn = rotation(&(FLIP * Matrix3::from_row_slice(&rest[..9])))?;
        let shift = FLIP * Vector3::from_row_slice(&rest[9..]);
        Some(Self {
            focal_px,
            radial: [k1, k2, 0.0, 0.0],
            cam_from_world: Rigid3::from_parts(shift.into(), turn),
        })
    }

    fn lens(&self, [width, height]: [u32; 2]) -> Camera {
        Camera {
            distortion: Distortion::brown(self.radial, [0.0; 3], [0.0; 2]),
            ..Camera::pinhole(width, height, self.focal_px)
        }
    }
}

/// The words of the file.
struct Values<'a>(SplitAsciiWhitespace<'a>);

impl Values<'_> {
    fn next<T: FromStr>(&mut self) -> Option<T> {
        self.0.next()?.parse().ok()
    }

    fn numbers<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.next().filter(|value: &f64| value.is_finite())?;
        }
        Some(numbers)
    }
}

/// Refuses files whose points lie behind the photos that show them: RealityCapture also writes such, with z along
/// the view.
fn check_side(
    values: &mut Values<'_>,
    points: usize,
    cameras: &[Option<BundlerCamera>],
) -> Result<(), String> {
    let (mut before, mut behind) = (0, 0);
    for point in 1..=points {
        let cut = || format!("point {point} needs its place, colour and views");
        let [x, y, z, ..] = values.numbers::<6>().ok_or_else(cut)?;
        for _ in 0..values.next::<usize>().ok_or_else(cut)? {
            let [camera, ..] = values.numbers::<4>().ok_or_else(cut)?;
            let camera = cameras.get(camera as usize).and_then(Option::as_ref);
            let depth_m = camera.map(|camera| (camera.cam_from_world * Point3::new(x, y, z)).z);
            before += usize::from(depth_m.is_some_and(|depth| depth > 0.0));
            behind += usize::from(depth_m.is_some_and(|depth| depth < 0.0));
        }
    }
    if behind > before {
        return Err(format!(
            "{behind} of {} lie behind the photos that show them: export as Bundler v0.3 (negative Z)",
            before + behind
        ));
    }
    Ok(())
}

/// The names of the photos, from the list beside the file.
fn names(path: &Path, count: usize) -> Result<Vec<String>, CameraError> {
    let lists = lists(path);
    let Some(list) = lists.iter().find(|list| list.is_file()) else {
        let names: Vec<_> = lists.iter().map(|list| list.to_string_lossy()).collect();
        let problem = format!(
            "the list of its photos is missing; looked for {}",
            names.join(", ")
        );
        return Err(malformed(path, "line 1", problem));
    };
    let text = read_text(list)?;
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    let names: Vec<String> = lines.map(|line| photo_name(line).to_owned()).collect();
    if names.len() != count {
        let problem = format!(
            "it has {count} photos, but {} names {}",
            list.display(),
            names.len()
        );
        return Err(malformed(path, "line 2", problem));
    }
    Ok(names)
}

/// Where the list may lie: Bundler, COLMAP and RealityCapture each have their way.
fn lists(path: &Path) -> Vec<PathBuf> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let short = stem.strip_suffix(".bundle").unwrap_or(&stem);
    let mut lists: Vec<PathBuf> = ["list.txt", "lst", "imagelist"]
        .iter()
        .map(|ending| path.with_file_name(format!("{short}.{ending}")))
        .collect();
    let folder = path.parent().unwrap_or(Path::new("."));
    lists.push(folder.join("list.txt"));
    lists.push(folder.join("../list.txt"));
    lists
}

/// A line of the list without what Bundler adds to it: 0 and the focal length in pixels.
fn photo_name(line: &str) -> &str {
    let added = line.rsplit_once(' ').and_then(|(rest, focal)| {
        let name = rest.trim_end().strip_suffix(" 0")?;
        focal.parse::<f64>().ok().map(|_| name.trim_end())
    });
    added.unwrap_or(line)
}
