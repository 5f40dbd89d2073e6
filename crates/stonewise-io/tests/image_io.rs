//! Photos written and read.
#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests")]

use stonewise_core::raster::{Raster, RgbImage};
use stonewise_io::image_io::{image_size, read_rgb, write_jpeg, write_png_rgb};

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
    let nowhere = folder.path().join("nowhere/out.png");
    assert!(
        write_png_rgb(&nowhere, &picture())
            .unwrap_err()
            .to_string()
            .contains("out.png")
    );
}
