//! Finding the photo of each camera.

use std::path::Path;
use stonewise_core::geometry::{Camera, Rigid3, View};
use stonewise_core::id::ImageId;
use stonewise_io::cameras::{CameraError, CameraFile, find_photos};

fn cameras(names: &[&str]) -> CameraFile {
    let view = |(i, name): (usize, &&str)| View {
        image: ImageId(i as u32),
        name: (*name).to_owned(),
        camera: Camera::pinhole(10, 10, 10.0),
        cam_from_world: Rigid3::identity(),
    };
    CameraFile {
        views: names.iter().enumerate().map(view).collect(),
        ..CameraFile::default()
    }
}

fn folder(files: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for file in files {
        let path = folder.path().join(file);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, "").unwrap();
    }
    folder
}

/// The paths below the folder that each camera got.
fn found(files: &[&str], names: &[&str]) -> (Vec<Option<String>>, Vec<String>) {
    let folder = folder(files);
    let relative = |path: &Path| {
        let path = path.strip_prefix(folder.path()).unwrap();
        path.to_string_lossy().replace('\\', "/")
    };
    let photos = find_photos(folder.path(), &cameras(names)).unwrap();
    (
        photos.paths.iter().map(|p| p.as_deref().map(relative)).collect(),
        photos.without_camera.iter().map(|p| relative(p)).collect(),
    )
}

#[test]
fn names_match_without_extension_and_case() {
    let (paths, rest) = found(
        &[
            "DJI_0001.JPG",
            "dji_0002.jpeg",
            "DJI_0003.v2.png",
            "notes.txt",
            ".DJI_0001.JPG",
            "DJI_9.jpg",
        ],
        &["dji_0001", "DJI_0002.JPG", "DJI_0003.v2", "DJI_0004"],
    );
    let expected = [
        Some("DJI_0001.JPG"),
        Some("dji_0002.jpeg"),
        Some("DJI_0003.v2.png"),
        None,
    ];
    assert_eq!(paths, expected.map(|p| p.map(str::to_owned)));
    assert_eq!(rest, ["DJI_9.jpg"]);
}

#[test]
fn folders_in_the_name_tell_photos_apart() {
    let (paths, rest) = found(
        &[
            "flight1/0001.jpg",
            "flight2/0001.jpg",
            "0002.jpg",
            "masks/0002.png",
        ],
        &["Flight2/0001.jpg", "survey\\flight1\\0001.jpg", "0002"],
    );
    let expected = ["flight2/0001.jpg", "flight1/0001.jpg", "0002.jpg"];
    assert_eq!(paths, expected.map(|p| Some(p.to_owned())));
    assert_eq!(rest, ["masks/0002.png"]);
}

/// Apple's file systems take letters and their accents apart.
#[test]
fn names_match_in_either_form_of_unicode() {
    let (paths, rest) = found(&["No\u{308}rd/Ma\u{308}uer_1.jpg"], &["n\u{f6}rd/m\u{e4}uer_1"]);
    assert_eq!((paths.len(), rest.len()), (1, 0));
    assert!(paths[0].is_some());
    let (paths, _) = found(&["M\u{e4}uer_1.jpg"], &["Ma\u{308}uer_1.JPG"]);
    assert!(paths[0].is_some());
}

#[test]
fn two_fitting_photos_are_an_error_that_names_both() {
    let folder = folder(&["flight1/0001.jpg", "flight2/0001.jpg"]);
    let error = find_photos(folder.path(), &cameras(&["0001"])).unwrap_err();
    assert!(matches!(error, CameraError::AmbiguousPhoto { .. }));
    let text = error.to_string();
    assert!(text.contains("flight1") && text.contains("flight2") && text.contains("0001"));
}

#[test]
fn an_empty_folder_and_a_missing_one_are_errors() {
    let folder = folder(&["readme.txt"]);
    let error = find_photos(folder.path(), &cameras(&["0001"])).unwrap_err();
    assert!(matches!(error, CameraError::NoPhotos { .. }), "{error}");
    let missing = folder.path().join("nowhere");
    let error = find_photos(&missing, &cameras(&["0001"])).unwrap_err();
    assert!(error.to_string().contains("nowhere"));
}
