//! Camera files of every format against pixels computed elsewhere, and back through the writers.

use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use stonewise_core::geometry::{Camera, Distortion, NearPlane, Rigid3, View};
use stonewise_core::id::ImageId;
use stonewise_io::cameras::{
    CameraError, CameraFile, MapFrame, Remark, find_photos, read_cameras, read_cameras_on_map, write_colmap,
    write_metashape,
};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../testdata/cameras")
        .join(name)
}

type Expected = BTreeMap<String, Vec<[f64; 5]>>;

fn expected(section: &str) -> Expected {
    let text = std::fs::read_to_string(fixture("expected.json")).unwrap();
    let file: Value = serde_json::from_str(&text).unwrap();
    serde_json::from_value(file[section].clone()).unwrap()
}

fn assert_pixels(file: &CameraFile, expected: &Expected) {
    assert_eq!(file.views.len(), expected.len());
    for (index, view) in file.views.iter().enumerate() {
        assert_eq!(view.image, ImageId(index as u32));
        // A group of cameras is a folder of the name.
        let (_, own) = view.name.rsplit_once("Group 1/").unwrap_or(("", &view.name));
        let rows = &expected[own];
        assert_eq!(rows.len(), 20);
        for [x, y, z, u, v] in rows {
            let pixel = view.project(&Point3::new(*x, *y, *z)).unwrap().pixel;
            let error = (pixel[0] - u).hypot(pixel[1] - v);
            assert!(error < 1e-6, "{}: {error:e} px", view.name);
        }
    }
}

#[test]
fn colmap_text_and_binary_put_points_where_opencv_does() {
    for folder in [
        "colmap_txt",
        "colmap_bin",
        "colmap_bin/images.bin",
        "colmap_txt/cameras.txt",
    ] {
        let file = read_cameras(&fixture(folder)).unwrap();
        assert_pixels(&file, &expected("colmap"));
        assert_eq!(file.views[0].name, "flight 0/simple_pinhole.JPG");
        assert!(file.skipped.is_empty() && file.warnings.is_empty());
    }
}

#[test]
fn metashape_puts_points_where_its_formulae_do() {
    let file = read_cameras(&fixture("metashape.xml")).unwrap();
    assert_pixels(&file, &expected("metashape"));
    let names: Vec<&str> = file.views.iter().map(|v| v.name.as_str()).collect();
    assert_eq!(names, ["DJI_0001", "Group 1/DJI_0002.v2", "DJI_0003", "DJI & 4"]);
    let skipped = [("unaligned", Remark::NotAligned), ("off", Remark::Disabled)];
    let skipped = skipped.map(|(name, reason)| (name.to_owned(), reason));
    assert_eq!(file.skipped, skipped);
    assert_eq!(file.warnings, [Remark::ChunkDisabled("old try".to_owned())]);
    assert!(file.crs.unwrap().starts_with("LOCAL_CS"));
}

#[test]
fn metashape_says_that_a_shutter_is_rolling() {
    let good = std::fs::read_to_string(fixture("metashape.xml")).unwrap();
    let rows = "<rolling_shutter>1 0 0 0.002 0 1 0 0 0 0 1 0</rolling_shutter></camera>";
    let dir = tempfile::tempdir().unwrap();
    for (text, says) in [(good.clone(), false), (good.replacen("</camera>", rows, 1), true)] {
        let path = dir.path().join("cameras.xml");
        std::fs::write(&path, text).unwrap();
        let file = read_cameras(&path).unwrap();
        assert_eq!(file.rolling_shutter, says);
        let warned = file.warnings.contains(&Remark::RollingShutter);
        assert_eq!(warned, says, "{:?}", file.warnings);
    }
}

#[test]
fn opensfm_puts_points_where_opencv_does() {
    let file = read_cameras(&fixture("opensfm.json")).unwrap();
    assert_pixels(&file, &expected("opensfm"));
    assert_eq!(file.skipped.len(), 1);
    assert_eq!(file.skipped[0].0, "alone.jpg");
    assert_eq!(file.warnings.len(), 1);
}

#[test]
fn pix4d_puts_points_where_opencv_does() {
    let file = read_cameras(&fixture("pix4d/dam_calibrated_camera_parameters.txt")).unwrap();
    assert_pixels(&file, &expected("pix4d"));
    assert!(file.skipped.is_empty() && file.warnings.is_empty());
}

#[test]
fn formats_that_are_not_read_say_what_to_export() {
    let folder = tempfile::tempdir().unwrap();
    let poses = "{\"fl_x\": 1400.0, \"frames\": [{\"file_path\": \"a.jpg\", \"transform_matrix\": []}]}";
    for (name, content, expected) in [
        (
            "bundle.out",
            "# Bundle file v0.3\n1 0\n",
            "Bundler files are not read: export",
        ),
        ("a.out", "some log\n", "not a camera file"),
        (
            "any.json",
            "{\n  \"sfm_data_version\": \"0.3\",\n",
            "openMVG_main_openMVG2Colmap",
        ),
        (
            "transforms.json",
            poses,
            "nerfstudio's transforms are not read: give",
        ),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        let error = message(&path);
        assert!(error.contains(expected), "{error}");
    }
}

/// A folder with photos of these sizes.
fn photos(sizes: &[(&str, u32, u32)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, width, height) in sizes {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        image::GrayImage::new(*width, *height).save(path).unwrap();
    }
    folder
}

fn realitycapture_photos() -> tempfile::TempDir {
    photos(&[
        ("none.jpg", 400, 300),
        ("wing/brown3, b.jpg", 300, 400),
        ("brown3t2.jpg", 400, 300),
        ("wing/brown4t2.jpg", 300, 400),
    ])
}

#[test]
fn realitycapture_puts_points_where_opencv_does() {
    let photos = realitycapture_photos();
    let expected = expected("realitycapture");
    let read = |path: &str| {
        let path = fixture("realitycapture").join(path);
        read_cameras_on_map(&path, Some(photos.path()), &MapFrame::default()).unwrap()
    };
    for path in ["cameras.csv", "opencv.csv"] {
        let file = read(path);
        assert_pixels(&file, &expected);
        assert!(file.skipped.is_empty() && file.warnings.is_empty());
        assert_eq!(
            find_photos(photos.path(), &file).unwrap().without_camera,
            Vec::<PathBuf>::new()
        );
    }
    let without_extension =
        |(name, rows): (&String, &Vec<[f64; 5]>)| (name.replace(".jpg", ""), rows.clone());
    let expected: Expected = expected.iter().map(without_extension).collect();
    for path in ["xmp", "xmp/none.xmp"] {
        let file = read(path);
        assert_pixels(&file, &expected);
        assert_eq!(
            find_photos(photos.path(), &file).unwrap().without_camera,
            Vec::<PathBuf>::new()
        );
    }
}

#[test]
fn realitycapture_warns_of_yaw_on_a_map() {
    let photos = realitycapture_photos();
    let text = std::fs::read_to_string(fixture("realitycapture/cameras.csv")).unwrap();
    let path = photos.path().join("cameras.csv");
    std::fs::write(&path, text.replacen(".jpg,", ".jpg,4512", 1)).unwrap();
    assert_eq!(read_cameras(&path).unwrap().warnings, [Remark::YawFromTrueNorth]);
}

#[test]
fn cameras_without_sizes_that_cannot_be_read_say_why() {
    let photos = realitycapture_photos();
    let check = |source: &str, name: &str, from: &str, to: &str, part: &str| {
        let path = photos.path().join(name);
        let good = std::fs::read_to_string(fixture(source)).unwrap();
        assert!(good.contains(from), "{from}");
        std::fs::write(&path, good.replace(from, to)).unwrap();
        let text = read_cameras(&path).unwrap_err().to_string();
        assert!(text.contains(part) && text.contains(name), "{text}");
        std::fs::remove_file(path).unwrap();
    };
    for (from, to, part) in [
        (",pitch,", ",slope,", "column pitch is missing"),
        (",f,", ",focus,", "a positive focal length"),
        (",heading,", ",direction,", "column heading or yaw is missing"),
        (
            "26.280000000000001,",
            "wide,",
            "f is no number: \"wide\", at line 4",
        ),
        (
            "26.280000000000001,",
            "NaN,",
            "f is no number: \"NaN\", at line 4",
        ),
        ("none.jpg,", "none.jpg", "expected 16 values, found 15, at line 3"),
        (
            ",0.083000000000000004,-0.017000000000000001,0,0,0\n",
            ",0,0,0,0,0\n",
            "model division (k1 alone) of photo wing/brown3, b.jpg",
        ),
        ("#name", "#image", "not a camera file"),
        (".jpg", ".tif2", "none of them can be read"),
    ] {
        check("realitycapture/cameras.csv", "cameras.csv", from, to, part);
    }
    check(
        "realitycapture/opencv.csv",
        "opencv.csv",
        ",ty,",
        ",why,",
        "column ty is missing",
    );
    check(
        "realitycapture/opencv.csv",
        "opencv.csv",
        ",f_pix,",
        ",focus,",
        "a positive focal length",
    );
    for (from, to, part) in [
        ("brown3t2\"", "division\"", "model division of photo brown3t2"),
        (
            "Skew=\"0\"",
            "Skew=\"0.1\"",
            "model K + brown3t2 of photo brown3t2",
        ),
        (
            "xcr:FocalLength35mm",
            "xcr:FocalLength",
            "a positive xcr:FocalLength35mm is missing",
        ),
        (
            "<xcr:Rotation>",
            "<xcr:Rotation>1 ",
            "xcr:Rotation needs 9 number(s)",
        ),
        (
            "<xcr:Rotation>",
            "<xcr:Rotation>1 0 0 0 1 0 0 0 -1</xcr:Rotation><xcr:R>",
            "broken xml",
        ),
        (
            "<xcr:Rotation>",
            "<xcr:Rotation>1 0 0 0 1 0 0 0 -1</xcr:Rotation><xcr:Rotation>",
            "xcr:Rotation is no rotation",
        ),
        (
            "xcr:Rotation>",
            "xcr:Turn>",
            "no aligned camera in the file (1 without",
        ),
    ] {
        check("realitycapture/xmp/brown3t2.xmp", "brown3t2.xmp", from, to, part);
    }
}

#[test]
fn files_of_other_programs_that_cannot_be_read_say_why() {
    let folder = tempfile::tempdir().unwrap();
    for (source, from, to, part) in [
        (
            "pix4d/dam_calibrated_camera_parameters.txt",
            "\n0 0 1\n",
            "\n0 0\n",
            "line 12: expected 3 numbers",
        ),
        (
            "pix4d/dam_calibrated_camera_parameters.txt",
            "2900.5 0",
            "-2900.5 0",
            "photo DJI 0001.JPG: its focal lengths must be positive",
        ),
    ] {
        let name = Path::new(source).file_name().unwrap();
        let path = folder.path().join(name);
        let good = std::fs::read_to_string(fixture(source)).unwrap();
        assert!(good.contains(from), "{from}");
        std::fs::write(&path, good.replacen(from, to, 1)).unwrap();
        let error = message(&path);
        let (place, problem) = part.split_once(": ").unwrap_or(("", part));
        assert!(error.contains(place) && error.contains(problem), "{error}");
    }
    // Every cut at the end of a line but the last of a photo is an error.
    let good = std::fs::read_to_string(fixture("pix4d/dam_calibrated_camera_parameters.txt")).unwrap();
    let path = folder.path().join("cut_calibrated_camera_parameters.txt");
    for (number, (end, _)) in good.match_indices('\n').enumerate() {
        std::fs::write(&path, &good[..end]).unwrap();
        assert_eq!(
            read_cameras(&path).is_ok(),
            [17, 27].contains(&number),
            "{number}"
        );
    }
}

fn message(path: &Path) -> String {
    let error = read_cameras(path).unwrap_err();
    let text = error.to_string();
    let file = path.file_name().unwrap().to_string_lossy();
    assert!(text.contains(&*file), "{text} names the file");
    text
}

#[test]
fn colmap_folders_that_cannot_be_read_say_why() {
    let fov = message(&fixture("rejected/fov"));
    assert!(fov.contains("FOV") && fov.contains("photo_1.jpg"), "{fov}");
    let missing = message(&fixture("rejected/missing_parameter"));
    assert!(
        missing.contains("OPENCV has 8 parameters, found 7") && missing.contains("line 1"),
        "{missing}"
    );
    let lines = message(&fixture("rejected/no_points_lines"));
    assert!(
        lines.contains("line 2") && lines.contains("image points"),
        "{lines}"
    );
    assert!(message(&fixture("rejected")).contains("not a camera file"));
}

/// A COLMAP model whose cameras stand in a row.
fn colmap(folder: &Path, photos: &[&str]) {
    std::fs::create_dir_all(folder).unwrap();
    std::fs::write(
        folder.join("cameras.txt"),
        "1 SIMPLE_PINHOLE 4000 3000 3200 2000 1500\n",
    )
    .unwrap();
    let images: Vec<String> = photos
        .iter()
        .enumerate()
        .map(|(i, name)| format!("{i} 1 0 0 0 -{i} 0 5 1 {name}\n\n"))
        .collect();
    std::fs::write(folder.join("images.txt"), images.concat()).unwrap();
}

#[test]
fn the_largest_of_several_models_is_read_and_the_others_are_named() {
    for (small, large) in [("sparse/0", "sparse/1"), ("2", "10"), ("sparse/0", "sparse/geo")] {
        let folder = tempfile::tempdir().unwrap();
        colmap(&folder.path().join(small), &["a.jpg", "other.jpg"]);
        colmap(&folder.path().join(large), &["a.jpg", "b.jpg", "c.jpg"]);
        let file = read_cameras(folder.path()).unwrap();
        assert_eq!(file.views.len(), 3);
        assert_eq!(
            file.skipped,
            [("other.jpg".to_owned(), Remark::SmallerReconstruction)]
        );
        let said = file.warnings[0].to_string();
        assert!(
            said.contains(&format!("model {large} was read, with 3 photos")),
            "{said}"
        );
        assert!(said.contains(&format!("not {small} (2)")), "{said}");
        // Of equal ones the first; one that is named itself has no rival.
        colmap(&folder.path().join(small), &["a.jpg", "b.jpg", "d.jpg"]);
        assert_eq!(read_cameras(folder.path()).unwrap().views[2].name, "d.jpg");
        let named = read_cameras(&folder.path().join(large)).unwrap();
        assert!(named.warnings.is_empty() && named.skipped.is_empty());
    }
}

#[test]
fn camera_files_may_begin_with_a_mark_and_be_in_utf_16() {
    let utf_16 = |text: &str| -> Vec<u8> {
        let text = format!("\u{feff}{text}");
        text.encode_utf16().flat_map(u16::to_le_bytes).collect()
    };
    let marked = |text: &str| format!("\u{feff}{text}").into_bytes();
    let writers: [fn(&str) -> Vec<u8>; 2] = [utf_16, marked];
    for name in [
        "metashape.xml",
        "opensfm.json",
        "pix4d/dam_calibrated_camera_parameters.txt",
    ] {
        let source = fixture(name);
        let text = std::fs::read_to_string(&source).unwrap();
        let expected = read_cameras(&source).unwrap().views;
        for write in writers {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join(source.file_name().unwrap());
            std::fs::write(&path, write(&text)).unwrap();
            let offset = source.with_file_name("dam_offset.xyz");
            if name.starts_with("pix4d") {
                let offset = std::fs::read_to_string(offset).unwrap();
                std::fs::write(folder.path().join("dam_offset.xyz"), write(&offset)).unwrap();
            }
            assert_eq!(read_cameras(&path).unwrap().views, expected, "{name}");
        }
    }
    let folder = tempfile::tempdir().unwrap();
    for file in ["cameras.txt", "images.txt"] {
        let text = std::fs::read_to_string(fixture("colmap_txt").join(file)).unwrap();
        std::fs::write(folder.path().join(file), marked(&text)).unwrap();
    }
    assert_eq!(
        read_cameras(folder.path()).unwrap().views,
        read_cameras(&fixture("colmap_txt")).unwrap().views
    );
}

#[test]
fn every_truncation_of_a_binary_file_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(
        fixture("colmap_bin/cameras.bin"),
        folder.path().join("cameras.bin"),
    )
    .unwrap();
    let bytes = std::fs::read(fixture("colmap_bin/images.bin")).unwrap();
    for length in (0..bytes.len()).step_by(13) {
        std::fs::write(folder.path().join("images.bin"), &bytes[..length]).unwrap();
        let error = read_cameras(folder.path()).unwrap_err();
        assert!(error.to_string().contains("complete"), "{length}: {error}");
    }
}

#[test]
fn metashape_files_that_cannot_be_read_say_why() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cameras.xml");
    let good = std::fs::read_to_string(fixture("metashape.xml")).unwrap();
    let check = |text: String, parts: &[&str]| {
        std::fs::write(&path, text).unwrap();
        let error = message(&path);
        for part in parts {
            assert!(error.contains(part), "{error} has {part}");
        }
    };
    check(good[..good.len() / 2].to_owned(), &["line", "complete"]);
    check(String::new(), &["no xml element"]);
    check("<svg/>".to_owned(), &["<svg>", "<document>"]);
    check("<document/>".to_owned(), &["no aligned camera"]);
    check(
        good.replace("<transform>", "<other>")
            .replace("</transform>", "</other>"),
        &["no aligned camera", "7 without"],
    );
    check(
        good.replace("fisheye", "spherical"),
        &["spherical", "DJI_0002.v2"],
    );
    check(
        good.replace("<f>2897.25", "<f>nonsense"),
        &["<f>", "line", "nonsense"],
    );
    check(
        good.replace("sensor_id=\"7\"", "sensor_id=\"70\""),
        &["70", "line"],
    );
    check(
        good.replace("LOCAL_CS[", "PROJCS["),
        &["names no geographic system", "local coordinates"],
    );
    let scaled = good.replace("<scale locked=\"true\">", "<scale locked=\"true\">-");
    check(scaled, &["scale must be positive"]);
}

#[test]
fn other_files_are_not_camera_files() {
    let folder = tempfile::tempdir().unwrap();
    assert!(matches!(
        read_cameras(folder.path()),
        Err(CameraError::UnknownFormat { .. })
    ));
    let path = folder.path().join("reconstruction.json");
    std::fs::write(&path, "[{\"cameras\": 3}]").unwrap();
    assert!(message(&path).contains("line 1"));
    assert!(message(&folder.path().join("cameras.las")).contains("not a camera file"));
    assert!(message(&folder.path().join("missing.xml")).contains("cannot read"));
}

/// Views that differ in pose and lens.
fn views(lenses: &[Distortion], skew_px: f64) -> Vec<View> {
    let view = |(i, lens): (usize, &Distortion)| {
        let angle = i as f64 + 0.3;
        View {
            image: ImageId(i as u32),
            name: format!("left & right <{i}>.jpg"),
            camera: Camera {
                focal_px: [2_900.123_456_789_1, 2899.1],
                center_px: [2010.3, 1480.0 / 3.0],
                skew_px,
                distortion: lens.clone(),
                ..Camera::pinhole(4000, 3000, 1.0)
            },
            cam_from_world: Rigid3::from_parts(
                Translation3::new(4.5e5 / 3.0, 5.6e6 / 7.0, -angle),
                UnitQuaternion::from_euler_angles(angle, 0.1 * angle, -angle),
            ),
        }
    };
    lenses.iter().enumerate().map(view).collect()
}

fn assert_same(a: &[View], b: &[View]) {
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(b) {
        assert_eq!((&a.name, a.image), (&b.name, b.image));
        for i in 0..100 {
            let pixel = [f64::from(i % 10) * 400.0 + 1.0, f64::from(i / 10) * 300.0 + 1.0];
            let (Some((origin, direction)), Some((origin_b, direction_b))) = (a.ray(pixel), b.ray(pixel))
            else {
                panic!("{pixel:?}");
            };
            assert!((origin - origin_b).norm() < 1e-8, "{}", origin - origin_b);
            assert!((direction - direction_b).norm() < 1e-13);
        }
    }
}

#[test]
fn written_metashape_files_read_back() {
    let lenses = [
        Distortion::None,
        Distortion::brown([-0.11, 0.03, -0.01, 0.002], [0.0; 3], [0.001, -0.002]),
        Distortion::fisheye([0.03, -0.01, 0.0, 0.0], [0.001, -0.002]),
        Distortion::None,
    ];
    let mut written = views(&lenses, -1.25);
    written[3].camera.near = Some(NearPlane {
        normal: Vector3::new(0.1, -0.2, 0.95).normalize(),
        distance_m: 11.0 / 3.0,
    });
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cameras.xml");
    write_metashape(&path, &written, None).unwrap();
    let read = read_cameras(&path).unwrap();
    assert_same(&written, &read.views);
    assert!(
        written
            .iter()
            .zip(&read.views)
            .all(|(a, b)| a.camera.near == b.camera.near)
    );
    assert!(read.warnings.is_empty() && read.skipped.is_empty());
    let text = std::fs::read_to_string(&path).unwrap();
    assert_eq!(text.matches("<sensor ").count(), 4);
    let rational = views(&[Distortion::brown([0.1; 4], [0.1; 3], [0.0; 2])], 0.0);
    assert!(write_metashape(&path, &rational, None).is_err());
    assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
}

#[test]
fn written_colmap_folders_read_back() {
    let lenses = [
        Distortion::brown([-0.11, 0.03, 0.0, 0.0], [0.0; 3], [0.001, -0.002]),
        Distortion::None,
        Distortion::brown([-0.11, 0.03, -0.01, 0.0], [0.02, -0.01, 0.005], [0.001, -0.002]),
        Distortion::fisheye([0.03, -0.01, 0.002, 0.001], [0.0; 2]),
    ];
    let written = views(&lenses, 0.0);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sparse/0");
    write_colmap(&path, &written).unwrap();
    assert_same(&written, &read_cameras(folder.path()).unwrap().views);
    assert!(write_colmap(&path, &views(&lenses, 0.5)).is_err());
}
