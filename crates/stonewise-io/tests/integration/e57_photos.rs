//! Photos that E57 files hold: a point is where the standard says that the image shows it.

use e57::{
    CylindricalImageProperties, E57Writer, ImageFormat, ImageWriter, PinholeImageProperties, Quaternion,
    SphericalImageProperties, Transform, Translation, VisualReferenceImageProperties,
};
use nalgebra::{Point3, UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use stonewise_core::progress::Silent;
use stonewise_core::raster::{Raster, RgbImage};
use stonewise_io::cameras::{
    E57Photos, LeftOut, count_e57_images, find_photos, read_cameras, unpack_e57_photos,
};
use stonewise_io::cloud::cloud_details;
use stonewise_io::image_io::{read_rgb, write_jpeg, write_png_rgb};

type Images<'a> = ImageWriter<'a, File>;
/// Adds an image to a file.
type Add<'a> = &'a dyn Fn(&mut Images<'_>);

/// A far place on a map.
const PLACE: [f64; 3] = [412_345.678, 5_654_321.987, 312.5];

fn unpack(paths: &[PathBuf], out: &Path) -> Result<E57Photos, String> {
    unpack_e57_photos::<Box<dyn std::error::Error>>(paths, out, &Silent).map_err(|e| e.to_string())
}

fn pose(rotation: &UnitQuaternion<f64>, [x, y, z]: [f64; 3]) -> Transform {
    let (w, i, j, k) = (rotation.w, rotation.i, rotation.j, rotation.k);
    Transform {
        rotation: Quaternion { w, x: i, y: j, z: k },
        translation: Translation { x, y, z },
    }
}

/// A file of these images, whose text `change` changes.
fn changed_e57(path: &Path, images: &[Add<'_>], change: impl Fn(String) -> String) -> PathBuf {
    let mut file = E57Writer::from_file(path, "file").unwrap();
    for (i, add) in images.iter().enumerate() {
        let mut image = file.add_image(&format!("image {i}")).unwrap();
        add(&mut image);
        image.finalize().unwrap();
    }
    file.finalize_customized_xml(|xml| Ok(change(xml))).unwrap();
    path.to_owned()
}

fn e57(path: &Path, images: &[Add<'_>]) -> PathBuf {
    changed_e57(path, images, |xml| xml)
}

/// Bytes of a picture as a file of this extension.
fn encoded(picture: &RgbImage, extension: &str) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a");
    match extension {
        "png" => write_png_rgb(&path, picture).unwrap(),
        _ => write_jpeg(&path, picture, 90).unwrap(),
    }
    fs::read(&path).unwrap()
}

fn pinhole_lens(width: u32, height: u32) -> PinholeImageProperties {
    PinholeImageProperties {
        width,
        height,
        focal_length: 0.008,
        pixel_width: 0.000_04,
        pixel_height: 0.000_05,
        principal_x: 90.25,
        principal_y: 77.5,
    }
}

/// A picture of 200 x 150 pixels that fills many pages of a file.
fn noise() -> RgbImage {
    let pixels =
        (0..200 * 150u32).map(|i| [3, 5, 7].map(|k| (i.wrapping_mul(2_654_435_761) >> (k + 8)) as u8));
    Raster::from_vec(200, 150, pixels.collect()).unwrap()
}

/// A pinhole image in this format.
fn add_pinhole(image: &mut Images<'_>, extension: &str, pose: Option<Transform>) {
    let bytes = encoded(&noise(), extension);
    let format = match extension {
        "png" => ImageFormat::Png,
        _ => ImageFormat::Jpeg,
    };
    image
        .add_pinhole(format, &mut bytes.as_slice(), pinhole_lens(200, 150), None)
        .unwrap();
    if let Some(pose) = pose {
        image.set_transform(pose);
    }
}

fn add_spherical(image: &mut Images<'_>, picture: &RgbImage, extension: &str, pose: Transform) {
    let bytes = encoded(picture, extension);
    let format = match extension {
        "png" => ImageFormat::Png,
        _ => ImageFormat::Jpeg,
    };
    let (width, height) = (picture.width(), picture.height());
    let lens = SphericalImageProperties {
        width,
        height,
        pixel_width: TAU / f64::from(width),
        pixel_height: PI / f64::from(height),
    };
    image
        .add_spherical(format, &mut bytes.as_slice(), lens, None)
        .unwrap();
    image.set_transform(pose);
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn points_are_where_the_standard_projects_them_in_pinhole_images() {
    let folder = tempfile::tempdir().unwrap();
    let turned = UnitQuaternion::from_euler_angles(0.4, -1.1, 2.3);
    // Looks north, upright: the image's x is east, its y up, its z south.
    let north = Transform {
        rotation: Quaternion {
            w: FRAC_1_SQRT_2,
            x: FRAC_1_SQRT_2,
            y: 0.0,
            z: 0.0,
        },
        translation: Translation {
            x: 10.0,
            y: 20.0,
            z: 30.0,
        },
    };
    let path = e57(
        &folder.path().join("a.e57"),
        &[
            &|image: &mut Images<'_>| add_pinhole(image, "jpg", Some(pose(&turned, PLACE))),
            &|image: &mut Images<'_>| add_pinhole(image, "png", Some(north.clone())),
        ],
    );
    let unpacked = unpack(&[path], folder.path()).unwrap();
    assert_eq!((unpacked.views.len(), unpacked.panoramas), (2, 0));
    let file = read_cameras(&folder.path().join("colmap")).unwrap();
    let lens = pinhole_lens(200, 150);
    let [fx, fy] = [lens.pixel_width, lens.pixel_height].map(|pixel| lens.focal_length / pixel);
    for local in [[0.0, 0.0, -4.0], [1.0, 0.5, -3.0], [-0.4, 1.2, -6.5]] {
        let [x, y, z] = local;
        let world = Point3::from(turned * Vector3::from(local) + Vector3::from(PLACE));
        let expected = [lens.principal_x - fx * x / z, lens.principal_y + fy * y / z];
        for view in [&unpacked.views[0], &file.views[0]] {
            let shown = view.project(&world).unwrap();
            let error = [0, 1].map(|i| (shown.pixel[i] - expected[i]).abs());
            assert!(
                error[0].max(error[1]) < 1e-5,
                "{local:?}: {:?}, {expected:?}",
                shown.pixel
            );
            assert!((shown.depth_m + z).abs() < 1e-8);
        }
        // What is behind the camera is not shown.
        let behind = Point3::from(turned * Vector3::new(x, y, -z) + Vector3::from(PLACE));
        assert!(file.views[0].project(&behind).is_none());
    }
    // 8 m north, 1 m east, 2 m up: right of the middle and above it.
    let shown = file.views[1].project(&Point3::new(11.0, 28.0, 32.0)).unwrap();
    let expected = [90.25 + 200.0 / 8.0, 77.5 - 160.0 * 2.0 / 8.0];
    assert!(
        (shown.pixel[0] - expected[0]).abs() < 1e-9 && (shown.pixel[1] - expected[1]).abs() < 1e-9,
        "{shown:?}"
    );
    // The photos are the bytes of the file.
    assert_eq!(
        names(&folder.path().join("images")),
        ["photo_001.jpg", "photo_002.png"]
    );
    for name in ["photo_001.jpg", "photo_002.png"] {
        let bytes = fs::read(folder.path().join("images").join(name)).unwrap();
        assert!(bytes == encoded(&noise(), &name[10..]), "{name}");
    }
}

#[test]
fn what_a_panorama_shows_is_where_its_photos_project_it() {
    let dots = [
        (0.0, 0.0, [255, 0, 0]),
        (PI - 0.004, 0.1, [0, 255, 0]),
        (0.7, -0.5, [0, 0, 255]),
        (-0.95, 0.55, [255, 255, 0]),
        (-2.2, -0.3, [255, 0, 255]),
        (1.5, 0.4, [0, 255, 255]),
    ];
    let direction = |azimuth: f64, elevation: f64| {
        let (sin, cos) = azimuth.sin_cos();
        Vector3::new(elevation.cos() * cos, elevation.cos() * sin, elevation.sin())
    };
    let (width, height) = (1600u32, 800u32);
    let pixels = (0..width * height).map(|i| {
        let azimuth = PI - (f64::from(i % width) + 0.5) * TAU / f64::from(width);
        let elevation = PI / 2.0 - (f64::from(i / width) + 0.5) * PI / f64::from(height);
        let seen = direction(azimuth, elevation);
        let dot = dots
            .iter()
            .find(|(a, e, _)| seen.dot(&direction(*a, *e)) > f64::cos(0.02));
        dot.map_or([60; 3], |dot| dot.2)
    });
    let panorama = Raster::from_vec(width, height, pixels.collect()).unwrap();
    let turned = UnitQuaternion::from_euler_angles(0.1, -0.2, 2.0);

    let folder = tempfile::tempdir().unwrap();
    let path = e57(
        &folder.path().join("a.e57"),
        &[&|image: &mut Images<'_>| {
            image.set_name("station 1");
            add_spherical(image, &panorama, "png", pose(&turned, PLACE));
        }],
    );
    assert_eq!(unpack(&[path], folder.path()).unwrap().panoramas, 1);
    let file = read_cameras(&folder.path().join("colmap")).unwrap();
    let photos = ["000", "090", "180", "270"].map(|heading| format!("station_1_{heading}.png"));
    assert_eq!(names(&folder.path().join("images")), photos);

    let mut found = [0; 6];
    for view in &file.views {
        assert_eq!((view.camera.width, view.camera.height), (400, 400));
        assert!((view.centre() - Point3::from(PLACE)).amax() < 1e-8);
        let photo = read_rgb(&folder.path().join("images").join(&view.name)).unwrap();
        for (i, (azimuth, elevation, colour)) in dots.iter().enumerate() {
            let world = Point3::from(turned * (direction(*azimuth, *elevation) * 7.0) + Vector3::from(PLACE));
            let Some(shown) = view.project(&world) else {
                continue;
            };
            if !shown.pixel.iter().all(|p| (10.0..390.0).contains(p)) {
                continue;
            }
            let (mut sum, mut count) = ([0.0; 2], 0.0);
            for (place, pixel) in photo.data().iter().enumerate() {
                if pixel.iter().zip(colour).all(|(p, c)| p.abs_diff(*c) < 100) {
                    sum[0] += (place % 400) as f64 + 0.5;
                    sum[1] += (place / 400) as f64 + 0.5;
                    count += 1.0;
                }
            }
            assert!(count > 20.0, "{} does not show dot {i}", view.name);
            let error = [0, 1].map(|k| (sum[k] / count - shown.pixel[k]).abs());
            assert!(
                error[0].max(error[1]) < 0.5,
                "{}: dot {i} is {error:?} off",
                view.name
            );
            found[i] += 1;
        }
    }
    assert!(found.iter().all(|n| *n > 0), "{found:?}");
}

#[test]
fn every_photo_of_several_files_has_a_name_of_its_own_and_others_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let here = pose(&UnitQuaternion::identity(), PLACE);
    let named = |name: &'static str| {
        let here = here.clone();
        move |image: &mut Images<'_>| {
            image.set_name(name);
            add_pinhole(image, "jpg", Some(here.clone()));
        }
    };
    let (front, nameless) = (named("Front: 1.JPG"), named("../."));
    let lower = named("front: 1");
    let first = e57(&folder.path().join("a.e57"), &[&front, &lower, &nameless]);
    let jpeg = encoded(&Raster::filled(40, 20, [9; 3]), "jpg");
    let second = changed_e57(
        &folder.path().join("b.e57"),
        &[
            &front,
            &|image: &mut Images<'_>| {
                let lens = CylindricalImageProperties {
                    width: 40,
                    height: 20,
                    radius: 1.0,
                    principal_y: 10.0,
                    pixel_width: 0.1,
                    pixel_height: 0.1,
                };
                image
                    .add_cylindrical(ImageFormat::Jpeg, &mut jpeg.as_slice(), lens, None)
                    .unwrap();
                image.set_transform(here.clone());
            },
            &|image: &mut Images<'_>| {
                let size = VisualReferenceImageProperties {
                    width: 40,
                    height: 20,
                };
                image
                    .add_visual_reference(ImageFormat::Jpeg, &mut jpeg.as_slice(), size, None)
                    .unwrap();
            },
            &|image: &mut Images<'_>| add_pinhole(image, "jpg", None),
            &|image: &mut Images<'_>| {
                let lens = pinhole_lens(80, 40);
                image
                    .add_pinhole(ImageFormat::Jpeg, &mut jpeg.as_slice(), lens, None)
                    .unwrap();
                image.set_transform(here.clone());
            },
            &|image: &mut Images<'_>| {
                let mut turn = here.clone();
                turn.rotation.w = 0.3;
                add_pinhole(image, "jpg", Some(turn));
            },
            &|image: &mut Images<'_>| {
                let lens = PinholeImageProperties {
                    focal_length: 0.0,
                    ..pinhole_lens(40, 20)
                };
                image
                    .add_pinhole(ImageFormat::Jpeg, &mut jpeg.as_slice(), lens, None)
                    .unwrap();
            },
            &|image: &mut Images<'_>| {
                let lens = SphericalImageProperties {
                    width: 40,
                    height: 20,
                    pixel_width: 0.1,
                    pixel_height: 0.1,
                };
                image
                    .add_spherical(ImageFormat::Jpeg, &mut jpeg.as_slice(), lens, None)
                    .unwrap();
            },
            &|image: &mut Images<'_>| {
                image.set_name("front: 1");
                add_spherical(image, &Raster::filled(40, 20, [9; 3]), "jpg", here.clone());
            },
        ],
        // The writer misspells what its reader requires.
        |xml| xml.replace("readius", "radius"),
    );
    let counts = count_e57_images(std::slice::from_ref(&second)).unwrap();
    assert_eq!((counts.photos, counts.panoramas, counts.total()), (2, 1, 9));
    assert_eq!(cloud_details(&second).unwrap().summary.records, 0);

    let unpacked = unpack(&[first, second], folder.path()).unwrap();
    let found: Vec<&str> = unpacked.views.iter().map(|v| v.name.as_str()).collect();
    let expected = [
        "Front__1.jpg",
        "front__1_2.jpg",
        "photo_003.jpg",
        "Front__1_3.jpg",
        "front__1_4_000.jpg",
        "front__1_4_090.jpg",
        "front__1_4_180.jpg",
        "front__1_4_270.jpg",
    ];
    assert_eq!(found, expected);
    let left_out = [
        LeftOut::Cylindrical,
        LeftOut::NoProjection,
        LeftOut::NoPose,
        LeftOut::WrongPose,
        LeftOut::WrongLens,
        LeftOut::NotTheCircle,
        LeftOut::OtherSize,
    ];
    assert_eq!(unpacked.left_out, left_out.map(|reason| (reason, 1)).into());
    let file = read_cameras(&folder.path().join("colmap")).unwrap();
    let photos = find_photos(&folder.path().join("images"), &file).unwrap();
    assert!(photos.paths.iter().all(Option::is_some) && photos.without_camera.is_empty());
}

#[test]
fn files_without_photos_say_so() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let scans = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/clouds/two_scans.e57");
    let message = unpack(&[scans], &out).unwrap_err();
    assert!(message.contains("two_scans.e57: no images inside"), "{message}");
    let path = e57(
        &folder.path().join("a.e57"),
        &[&|image: &mut Images<'_>| add_pinhole(image, "jpg", None)],
    );
    let message = unpack(&[path], &out).unwrap_err();
    assert!(
        message.contains("(1 without a pose)") && message.contains("a.e57: "),
        "{message}"
    );
    assert!(!out.exists());
    let laz = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/clouds/las12_format3.las");
    let message = unpack(&[laz], &out).unwrap_err();
    assert!(
        message.contains(".las: ") && message.contains("not an E57 file"),
        "{message}"
    );
}

#[test]
fn a_damaged_image_is_named_and_leaves_nothing_half_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.e57");
    let out = folder.path().join("out");
    let here = pose(&UnitQuaternion::identity(), PLACE);
    let images: [Add<'_>; 2] = [
        &|image: &mut Images<'_>| add_pinhole(image, "png", Some(here.clone())),
        &|image: &mut Images<'_>| {
            image.set_name("face 2");
            add_pinhole(image, "jpg", Some(here.clone()));
        },
    ];
    e57(&path, &images);
    unpack(std::slice::from_ref(&path), &out).unwrap();
    assert!(out.join("colmap/images.txt").exists());

    let sound = fs::read(&path).unwrap();
    let refusal = || {
        let message = unpack(std::slice::from_ref(&path), &out).unwrap_err();
        assert!(message.contains("a.e57: "), "{message}");
        let left = [names(&out.join("images")), names(&out.join("colmap"))].concat();
        assert!(!left.iter().any(|name| name.ends_with(".partial")), "{left:?}");
        assert!(!out.join("colmap/images.txt").exists());
        message
    };
    // A byte in the middle of the second image.
    let start = sound.windows(3).position(|w| w == [0xff, 0xd8, 0xff]).unwrap();
    let mut bytes = sound.clone();
    bytes[start + encoded(&noise(), "jpg").len() / 2] ^= 1;
    fs::write(&path, bytes).unwrap();
    let message = refusal();
    assert!(message.contains("at image 2 of 2, \"face 2\""), "{message}");
    // Bytes that are no image, and a length that the file does not have.
    changed_e57(&path, &images, |xml| {
        xml.replace(
            "jpegImage type=\"Blob\" fileOffset=\"",
            "jpegImage type=\"Blob\" fileOffset=\"1",
        )
    });
    assert!(refusal().contains("image 2 of 2"));
    let longer = |xml: String| xml.replace("length=\"", "length=\"99999999");
    changed_e57(&path, &images, longer);
    assert!(refusal().contains("image 1 of 2"));
}

/// 60,000 x 60,000 pixels in a few bytes.
#[test]
fn images_that_claim_more_pixels_than_any_camera_has_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let claim = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/hostile/claim.png");
    let bytes = fs::read(claim).unwrap();
    let (width, height) = (60_000, 60_000);
    let here = pose(&UnitQuaternion::identity(), PLACE);
    let photo = |image: &mut Images<'_>| {
        let lens = pinhole_lens(width, height);
        image
            .add_pinhole(ImageFormat::Png, &mut bytes.as_slice(), lens, None)
            .unwrap();
        image.set_transform(here.clone());
    };
    let panorama = |image: &mut Images<'_>| {
        let lens = SphericalImageProperties {
            width,
            height,
            pixel_width: TAU / f64::from(width),
            pixel_height: PI / f64::from(height),
        };
        image
            .add_spherical(ImageFormat::Png, &mut bytes.as_slice(), lens, None)
            .unwrap();
        image.set_transform(here.clone());
    };
    let images: [(Add<'_>, &str); 2] = [
        (
            &photo,
            "the image has 60000 x 60000 pixels, more than any camera has",
        ),
        (&panorama, "the image cannot be read"),
    ];
    for (image, expected) in images {
        let path = e57(&folder.path().join("a.e57"), &[image]);
        let message = unpack(&[path], folder.path()).unwrap_err();
        assert!(
            message.contains(expected) && message.contains("at image 1 of 1"),
            "{message}"
        );
        assert!(names(&folder.path().join("images")).is_empty());
    }
}
