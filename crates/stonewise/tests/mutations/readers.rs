//! Every reader, through every door of its kind: an answer or the text of the error.

use super::seeds::testdata_path;
use nalgebra::Point3;
use std::fs;
use std::path::Path;
use stonewise::Project;
use stonewise_io::cameras::{MapFrame, find_photos, read_cameras_on_map};
use stonewise_io::cloud::{
    CloudError, CloudFormat, LabelColumns, PointChunk, PointLabel, cloud_info, measure_cloud, read_mesh,
    write_labelled,
};
use stonewise_io::crs::{Crs, Geodetic, Geoid, MapSystem};
use stonewise_io::image_io::{image_size, read_rgb};
use stonewise_io::masks::{CocoMasks, LabelFolder, ValidRegions};

fn line(error: impl std::fmt::Display) -> String {
    error.to_string()
}

pub fn cloud(path: &Path) -> Result<(), String> {
    let info = cloud_info(path).map_err(line)?;
    let mut bounds = info.bounds;
    // Of other formats `cloud_info` has read every point already.
    if info.format == CloudFormat::Las {
        let (summary, measured) = measure_cloud(path).map_err(line)?;
        assert_eq!(info.records, summary.records);
        bounds = measured;
    }
    assert!(bounds.is_none_or(|b| b.min.iter().chain(b.max.iter()).all(|c| c.is_finite())));
    if let Some(crs) = info.crs {
        let _ = (Crs::parse(&crs), MapSystem::parse(&crs));
    }
    Ok(())
}

/// Copies a cloud as well.
pub fn las(path: &Path) -> Result<(), String> {
    cloud(path)?;
    let nothing = |chunk: &PointChunk| Ok::<_, CloudError>(vec![PointLabel::default(); chunk.len()]);
    let copy = path.with_file_name("copy.laz");
    write_labelled(path, &copy, LabelColumns::Stone, nothing).map_err(line)?;
    cloud(&copy)
}

pub fn ply(path: &Path) -> Result<(), String> {
    let _ = read_mesh(path);
    cloud(path)
}

/// Cameras whose poses may be georeferenced.
pub fn map_cameras(path: &Path) -> Result<(), String> {
    let on_map = MapFrame {
        crs: Some("EPSG:25832".to_owned()),
        false_origin: [450_000.0, 5_600_000.0, 0.0],
        geoid: None,
    };
    let _ = read_cameras_on_map(path, None, &on_map);
    cameras(path)
}

pub fn cameras(path: &Path) -> Result<(), String> {
    let file = read_cameras_on_map(path, None, &MapFrame::default()).map_err(line)?;
    for view in &file.views {
        assert!(
            view.centre().iter().all(|c| c.is_finite()),
            "camera {} is nowhere",
            view.name
        );
        let ahead = view.cam_from_world.inverse() * Point3::new(0.1, -0.2, 5.0);
        let _ = view.project(&ahead);
    }
    let _ = find_photos(&path.with_file_name("images"), &file);
    Ok(())
}

pub fn geoid(path: &Path) -> Result<(), String> {
    let geoid = Geoid::read(path).map_err(line)?;
    for (latitude, longitude) in [(0.89, 0.135), (-1.5, 6.0), (f64::NAN, 0.1)] {
        let _ = geoid.height_m(&Geodetic {
            latitude,
            longitude,
            height_m: 0.0,
        });
    }
    Ok(())
}

pub fn coco(path: &Path) -> Result<(), String> {
    let masks = CocoMasks::open(path).map_err(line)?;
    for photo in masks.photos().filter(|p| p.width.max(p.height) < 4000) {
        masks
            .labels_for(photo.file_name, photo.width, photo.height)
            .map_err(line)?;
    }
    Ok(())
}

pub fn regions(path: &Path) -> Result<(), String> {
    let regions = ValidRegions::open(path).map_err(line)?;
    regions.outside("images/0001.jpg", 64, 48).map_err(line)?;
    Ok(())
}

pub fn labels(path: &Path) -> Result<(), String> {
    let folder = path.parent().unwrap();
    let masks = LabelFolder::open(folder).map_err(line)?;
    let name = path.with_extension("jpg");
    let found = masks.labels_for(&name.to_string_lossy(), 64, 48);
    // The other seed is found beside it where this one has another name.
    found.map(|_| ()).map_err(line)?;
    stonewise_io::masks::read_label_png(path)
        .map(|_| ())
        .map_err(line)
}

pub fn photo(path: &Path) -> Result<(), String> {
    let size = image_size(path).map_err(line)?;
    let picture = read_rgb(path).map_err(line)?;
    assert_eq!(size, (picture.width(), picture.height()));
    Ok(())
}

pub fn project(path: &Path) -> Result<(), String> {
    Project::read(path).map(|_| ()).map_err(line)
}

/// Makes a folder as the bytes of the file say, and a project of it.
pub fn init(path: &Path) -> Result<(), String> {
    const NAMES: [&str; 16] = [
        "epoch1",
        "epoch2",
        "images",
        "masks",
        "results",
        "a.laz",
        "b.e57",
        "c.txt",
        "one.jpg",
        "one.png",
        "cameras.xml",
        "reconstruction.json",
        "masks.json",
        "images.txt",
        "=a\"b'.ply",
        "\u{fc}\u{308} \n\\.xyz",
    ];
    let home = tempfile::tempdir_in(path.parent().unwrap()).unwrap();
    let mut folder = home.path().to_owned();
    for byte in fs::read(path).unwrap().into_iter().take(40) {
        let name = folder.join(NAMES[usize::from(byte % 16)]);
        match byte / 16 % 4 {
            0 => folder = home.path().to_owned(),
            1 if fs::create_dir_all(&name).is_ok() => folder = name,
            2 => drop(fs::copy(testdata_path("clouds/plain.xyz"), &name)),
            _ => drop(fs::write(&name, "")),
        }
    }
    stonewise::init(home.path()).map(|_| ()).map_err(line)?;
    let _ = Project::read(home.path());
    Ok(())
}
