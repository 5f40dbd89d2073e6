//! Photos written and read.

use std::path::{Path, PathBuf};
use stonewise_core::raster::{Raster, RgbImage};
use stonewise_io::exif::read_exif;
use stonewise_io::image_io::{
    image_size, photo_is_cut_off, picture_head, read_rgb, write_jpeg, write_png_rgb,
};

fn picture() -> RgbImage {
    let pixel = |i: u32| [(i % 40 * 6) as u8, (i / 40 * 8) as u8, 128];
    Raster::from_vec(40, 30, (0..1200).map(pixel).collect()).unwrap()
}

#[test]
fn png_is_exact_and_jpeg_close() {
    let folder = tempfile::tempdir().unwrap();
    let (png, jpeg) = (folder.path().join("a.png"), folder.path().join("b.JPG"));
    write_png_rgb(&png, &picture()).unwrap();
    write_jpeg(&jpeg, &picture(), 95).unwrap();
    assert_eq!(read_rgb(&png).unwrap(), picture());
    let read = read_rgb(&jpeg).unwrap();
    let error = |(a, b): (&[u8; 3], &[u8; 3])| a[1].abs_diff(b[1]);
    assert!(picture().data().iter().zip(read.data()).map(error).max().unwrap() < 12);
    for path in [&png, &jpeg] {
        assert_eq!(image_size(path).unwrap(), (40, 30));
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
}

#[test]
fn the_content_decides_the_format() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("really_a_png.jpg");
    write_png_rgb(&path, &picture()).unwrap();
    assert_eq!(read_rgb(&path).unwrap(), picture());
}

#[test]
fn bytes_behind_the_end_of_a_jpeg_do_not_matter() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.jpg");
    write_jpeg(&path, &picture(), 95).unwrap();
    let (whole, expected) = (std::fs::read(&path).unwrap(), read_rgb(&path).unwrap());
    for behind in [&[0xff, 0xda, 1, 2, 3][..], &[0; 9], &[0xff, 0xd8, 0xff, 0xd9]] {
        std::fs::write(&path, [&whole, behind].concat()).unwrap();
        assert_eq!(read_rgb(&path).unwrap(), expected, "{behind:?}");
        assert!(!photo_is_cut_off(&path).unwrap());
    }
    // A preview of its own before the picture has an end, too; fill bytes may come before a marker.
    let preview = [&[0xff, 0xff, 0xe1, 0, 2 + 4][..], &[0xff, 0xd8, 0xff, 0xd9]].concat();
    let nested = [&whole[..2], &preview, &whole[2..]].concat();
    std::fs::write(&path, &nested).unwrap();
    assert_eq!(read_rgb(&path).unwrap(), expected);
    for length in [nested.len() / 2, nested.len() - 2] {
        std::fs::write(&path, &nested[..length]).unwrap();
        assert!(read_rgb(&path).unwrap_err().to_string().contains("cut off"));
        assert!(photo_is_cut_off(&path).unwrap());
    }
}

fn testdata(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../testdata/photos")
        .join(name)
}

#[test]
fn tiff_photos_of_8_and_16_bits_are_read() {
    let pixel = |i: u32| [(i % 40 * 6) as u8, (i / 40 * 8) as u8, 100];
    let expected = Raster::from_vec(40, 30, (0..1200).map(pixel).collect()).unwrap();
    for name in ["rgb8.tif", "rgb16.tif"] {
        assert_eq!(read_rgb(&testdata(name)).unwrap(), expected, "{name}");
        assert_eq!(image_size(&testdata(name)).unwrap(), (40, 30));
        assert!(!picture_head(&testdata(name)).unwrap().is_label);
    }
}

#[test]
fn cameras_say_what_they_are_when_and_where() {
    let exif = read_exif(&testdata("exif.jpg")).unwrap();
    assert_eq!(exif.camera.as_deref(), Some("DJI FC6310"));
    assert_eq!(exif.taken.as_deref(), Some("2025-04-12 09:31:02"));
    assert_eq!((exif.focal_mm, exif.focal_35_mm), (Some(8.8), Some(24.0)));
    let [latitude, longitude] = exif.position.unwrap();
    assert!((latitude + 51.0 + 5.0 / 60.0 + 16.74 / 3600.0).abs() < 1e-12);
    assert!((longitude - 7.0 - 44.0 / 60.0 - 9.8 / 3600.0).abs() < 1e-12);
    assert_eq!(exif.altitude_m, Some(-12.345));
    let tiff = read_exif(&testdata("rgb16.tif")).unwrap();
    assert_eq!(tiff.camera.as_deref(), Some("Phase One"));
    assert_eq!(tiff.taken.as_deref(), Some("2025-04-12 09:31:02"));
    assert_eq!((tiff.focal_mm, tiff.position), (None, None));
}

#[test]
fn damaged_photos_do_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["exif.jpg", "rgb8.tif", "rgb16.tif"] {
        let whole = std::fs::read(testdata(name)).unwrap();
        let path = folder.path().join(name);
        for place in (0..400).chain(whole.len() - 400..whole.len()) {
            let mut bytes = whole.clone();
            bytes[place] ^= [0xff, 0x80, 0x01][place % 3];
            std::fs::write(&path, &bytes).unwrap();
            let _ = (read_rgb(&path), read_exif(&path), image_size(&path));
            std::fs::write(&path, &bytes[..place]).unwrap();
            let _ = (read_rgb(&path), read_exif(&path), image_size(&path));
        }
    }
}

#[test]
fn errors_name_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("photo.jpg");
    let check = || {
        let error = read_rgb(&path).unwrap_err().to_string();
        assert!(error.contains("photo.jpg"), "{error}");
    };
    check();
    assert!(image_size(&path).unwrap_err().to_string().contains("photo.jpg"));
    std::fs::write(&path, "no photo").unwrap();
    check();
    write_png_rgb(&path, &picture()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    check();
    assert_eq!(image_size(&path).unwrap(), (40, 30));
    write_jpeg(&path, &picture(), 95).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    for length in [
        bytes.len() / 2,
        bytes.len() * 3 / 4,
        bytes.len() - 10,
        bytes.len() - 2,
    ] {
        std::fs::write(&path, &bytes[..length]).unwrap();
        check();
    }
    // A file where the folder should be.
    let nowhere = path.join("out.png");
    assert!(
        write_png_rgb(&nowhere, &picture())
            .unwrap_err()
            .to_string()
            .contains("out.png")
    );
}
