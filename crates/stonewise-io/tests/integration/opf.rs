//! A project of the Open Photogrammetry Format that Pix4D's own package wrote, against pixels by OpenCV, and damaged
//! copies of it.

use nalgebra::Point3;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use stonewise_io::cameras::{CameraFile, Remark, find_photos, is_camera_file, read_cameras};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../testdata/cameras")
        .join(name)
}

fn read_fixture() -> CameraFile {
    read_cameras(&fixture("opf/dam.opf")).unwrap()
}

#[test]
fn a_project_puts_points_where_opencv_does() {
    let text = fs::read_to_string(fixture("opf.json")).unwrap();
    let all: BTreeMap<String, BTreeMap<String, Vec<[f64; 5]>>> = serde_json::from_str(&text).unwrap();
    let file = read_fixture();
    let names: Vec<&str> = file.views.iter().map(|view| view.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "photos/DJI 0001.JPG",
            "photos/möhne.tif",
            "file:///d:/flight/DJI_0003.JPG"
        ]
    );
    let mut worst: f64 = 0.0;
    for view in &file.views {
        let rows = &all["opf"][&view.name];
        assert_eq!(rows.len(), 20);
        for [x, y, z, u, v] in rows {
            let pixel = view.project(&Point3::new(*x, *y, *z)).unwrap().pixel;
            worst = worst.max((pixel[0] - u).hypot(pixel[1] - v));
        }
    }
    println!("largest difference: {worst:e} px");
    // Places of millions of metres in double precision are rounded by 1 nm, which is 1e-6 px at 2 m.
    assert!(worst < 5e-6, "{worst:e} px");
    assert_eq!(
        (file.views[1].camera.width, file.views[1].camera.height),
        (3000, 4000)
    );
}

#[test]
fn photos_that_are_not_read_are_listed() {
    let file = read_fixture();
    assert_eq!(file.crs.as_deref(), Some("EPSG:31468+7837"));
    let page = "page=1 of its file, of which only the first page is read".to_owned();
    let skipped = [
        ("photos/bands.tif", Remark::NotPlaced(page)),
        ("photos/alone.jpg", Remark::SmallerReconstruction),
        ("photos/lost.jpg", Remark::NotAligned),
    ];
    assert_eq!(
        file.skipped,
        skipped.map(|(name, remark)| (name.to_owned(), remark))
    );
    assert_eq!(file.warnings, [Remark::SeveralReconstructions(2)]);
    assert!(!file.rolling_shutter);
}

#[test]
fn photos_of_a_project_are_found_by_their_names() {
    let folder = tempfile::tempdir().unwrap();
    let files = ["photos/DJI 0001.JPG", "photos/möhne.tif", "flight/DJI_0003.JPG"].map(|name| {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, "").unwrap();
        Some(path)
    });
    assert_eq!(find_photos(folder.path(), &read_fixture()).unwrap().paths, files);
    assert!(is_camera_file(Path::new("survey/dam.OPF")));
}

const LAST: &str = "last/calibrated_cameras.json";
const FRAME: &str = "scene_reference_frame_1.json";

/// Reads a copy of the project with one change in one of its files.
fn changed(file: &str, from: &str, to: &str) -> Result<CameraFile, String> {
    let folder = tempfile::tempdir().unwrap();
    for name in [
        "dam.opf",
        "camera_list.json",
        "input_cameras.json",
        "scene_reference_frame_0.json",
        FRAME,
        LAST,
        "old try/calibrated_cameras.json",
    ] {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        let mut text = fs::read_to_string(fixture("opf").join(name)).unwrap();
        if name == file {
            assert!(text.contains(from), "{from}");
            text = text.replacen(from, to, 1);
        }
        fs::write(path, text).unwrap();
    }
    let file = read_cameras(&folder.path().join("dam.opf"));
    file.map_err(|error| {
        error
            .to_string()
            .replace(&folder.path().display().to_string(), "FOLDER")
    })
}

#[test]
fn damaged_projects_are_refused_with_file_and_place() {
    for (file, from, to, expected) in [
        (
            "dam.opf",
            "\"camera_list.json\"",
            "\"list.json\"",
            "FOLDER/dam.opf: the project names list.json, which is not there: copy all files of the project, at item camera_list",
        ),
        (
            "dam.opf",
            "\"camera_list.json\"",
            "\"https://example.org/list.json\"",
            "FOLDER/dam.opf: https://example.org/list.json does not lie beside the project: export it with all its files, at item \
             camera_list",
        ),
        (
            "dam.opf",
            "\"type\": \"camera_list\"\n  }",
            "\"type\": \"ext_list\"\n  }",
            "FOLDER/dam.opf: the project has no camera_list: calibrate the cameras and export the project again, at items",
        ),
        (
            "dam.opf",
            "\"version\": \"1.0\"",
            "\"version\": \"2.0\"",
            "FOLDER/dam.opf: OPF 2.0 is not supported: export the project as OPF 1, at version",
        ),
        (
            "camera_list.json",
            "[",
            "",
            "FOLDER/camera_list.json: not a file of the format application/opf-camera-list+json (invalid type: map, expected \
             a sequence at line 5 column 2), at line 5 column 2",
        ),
        (
            "camera_list.json",
            "12379813733990400002",
            "7",
            "FOLDER/last/calibrated_cameras.json: no camera_list names its photo, at camera 12379813733990400002",
        ),
        (
            "input_cameras.json",
            "4000,\n",
            "4000.5,\n",
            "FOLDER/last/calibrated_cameras.json: \
             sensor 17293822569102704641 has an impossible image size 4000.5x3000, at photo photos/DJI 0001.JPG",
        ),
        (
            FRAME,
            "\"scale\": [\n   1.0",
            "\"scale\": [\n   0.3048",
            "FOLDER/scene_reference_frame_1.json: the axes have different units: export the project in a system with one unit for all axes, at \
             base_to_canonical scale",
        ),
    ] {
        assert_eq!(changed(file, from, to).unwrap_err(), expected);
    }
}

#[test]
fn damaged_calibrations_are_refused_with_file_and_place() {
    for (from, to, expected) in [
        (
            "\"position\": [",
            "\"position\": [1,",
            "expected 3 numbers, found 4 at line",
        ),
        (
            "\"radial_distortion\": [",
            "\"radial_distortion\": [0, ",
            "expected 3 numbers, found 4 at line",
        ),
        (
            "\"sensor_id\": 1729",
            "\"sensor_id\": 1",
            "sensor 13822569102704641 is not among both",
        ),
        (
            "\"focal_length_px\": ",
            "\"focal_length_px\": -",
            "the focal length of sensor 17293822569102704641 must be positive, at photo photos/DJI 0001.JPG",
        ),
        (
            "\"type\": \"perspective\"",
            "\"type\": \"fisheye\"",
            "camera model fisheye (Pix4D's polynomial) of photo photos/DJI 0001.JPG is not supported",
        ),
        (
            "\"type\": \"perspective\"",
            "\"type\": \"spherical\"",
            "camera model spherical of photo",
        ),
        (
            "\"type\": \"perspective\"",
            "\"type\": \"fish\"",
            "unknown variant `fish`",
        ),
        (
            "\"position\": [",
            "\"position\": [1e999,",
            "number out of range at line",
        ),
    ] {
        let error = changed(LAST, from, to).unwrap_err();
        assert!(
            error.contains(expected) && error.starts_with(&format!("FOLDER/{LAST}: ")),
            "{error}"
        );
    }
}

#[test]
fn a_rolling_shutter_of_a_sensor_or_a_photo_gives_a_warning() {
    let with_terms = "\"rolling_shutter\": [0.1, 0.0, 0.0],\n   \"position\": [";
    for (name, from, to) in [
        ("input_cameras.json", "\"global\"", "\"rolling\""),
        (LAST, "\"position\": [", with_terms),
    ] {
        let file = changed(name, from, to).unwrap();
        assert!(
            file.rolling_shutter && file.warnings.contains(&Remark::RollingShutter),
            "{name}"
        );
    }
}

#[test]
fn positions_of_a_scene_in_feet_are_divided_by_its_scale() {
    let metres = changed("dam.opf", "dam", "dam").unwrap();
    let ones = "1.0,\n   1.0,\n   1.0";
    let feet = changed(FRAME, ones, &ones.replace("1.0", "0.3048")).unwrap();
    for (metres, feet) in metres.views.iter().zip(&feet.views) {
        let error = metres.centre() - feet.centre() * 0.3048;
        assert!(error.norm() < 1e-8, "{error}");
    }
}

#[test]
fn positions_are_kept_where_the_scene_has_no_frame() {
    let resource = "{\n     \"format\": \"application/opf-scene-reference-frame+json\",\n     \"uri\": \"scene_reference_frame_1.json\"\n    }";
    let file = changed("dam.opf", resource, "").unwrap();
    assert_eq!(file.crs, None);
    assert!(file.views.iter().all(|view| view.centre().coords.amax() <= 20.0));
}
