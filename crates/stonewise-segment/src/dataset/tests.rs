//! Labelled photos from files to training images.

use super::split::Split;
use super::*;
use crate::Sample;
use crate::augment::AugmentParams;
use crate::train::SampleSource;
use std::collections::BTreeSet;
use std::path::PathBuf;
use stonewise_core::raster::{Raster, RgbImage};
use stonewise_io::image_io::write_png_rgb;
use stonewise_io::masks::{CocoFile, CocoPhoto};
use tempfile::TempDir;

/// Stones of 16 x 16 pixels with joints of 4, `columns` a row.
fn labels(columns: u32, rows: u32) -> Raster<u32> {
    let label = |x: u32, y: u32| {
        let is_joint = x % 20 < 4 || y % 20 < 4;
        if is_joint {
            0
        } else {
            y / 20 * columns + x / 20 + 1
        }
    };
    let (width, height) = (20 * columns, 20 * rows);
    let values = (0..height)
        .flat_map(|y| (0..width).map(move |x| label(x, y)))
        .collect();
    Raster::from_vec(width, height, values).unwrap()
}

fn sample(columns: u32, rows: u32) -> Sample {
    let labels = labels(columns, rows);
    let (width, height) = (labels.width(), labels.height());
    let image = Raster::filled(width, height, [90; 3]);
    Sample::new(image, labels, Raster::filled(width, height, false)).unwrap()
}

fn stones(sample: &Sample) -> BTreeSet<u32> {
    sample
        .labels()
        .data()
        .iter()
        .copied()
        .filter(|&l| l != 0)
        .collect()
}

#[test]
fn a_stone_is_learnt_from_or_measured_on_and_never_both() {
    let all = sample(30, 20);
    for seed in 0..5 {
        let split = Split::new(&all, 64, 0.1, seed);
        let (learnt, measured) = (split.for_training(&all), split.for_validation(&all));
        let (a, b) = (stones(&learnt), stones(&measured));
        assert!(a.is_disjoint(&b));
        assert_eq!(a.len() + b.len(), 600);
        let share = b.len() as f64 / 600.0;
        assert!((0.04..0.2).contains(&share), "{share}");
        let both_known = learnt.ignore().data().iter().zip(measured.ignore().data());
        assert!(both_known.into_iter().all(|(a, b)| *a || *b));
    }
    let [one, other] = [1, 2].map(|seed| Split::new(&all, 64, 0.1, seed));
    assert_ne!(one, other);
}

#[test]
fn chosen_stones_are_measured_on_and_all_others_learnt_from() {
    let all = sample(30, 20);
    let chosen: BTreeSet<u32> = stones(&all).into_iter().filter(|label| label % 30 <= 6).collect();
    let split = Split::of_stones(&all, 40, &chosen);
    assert_eq!(stones(&split.for_validation(&all)), chosen);
    let learnt = stones(&split.for_training(&all));
    assert!(learnt.is_disjoint(&chosen) && learnt.len() + chosen.len() == 600);
    // Label 30 n + 1 is in the first column: the first six columns and the last are kept, 20 pixels each.
    let corners: BTreeSet<[u32; 2]> = split.kept_blocks().collect();
    let expected = (0..10).flat_map(|row| [0, 40, 80].map(|x| [x, 40 * row]));
    assert_eq!(corners, expected.collect());
}

/// Two photos with masks, one without.
fn folder() -> (TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let image: RgbImage = Raster::filled(200, 160, [90, 80, 70]);
    for name in ["a.png", "b.png", "c.png"] {
        write_png_rgb(&dir.path().join(name), &image).unwrap();
    }
    let labels = labels(10, 8);
    let photo = |file_name| CocoPhoto {
        file_name,
        labels: &labels,
        instances: &[],
    };
    let masks = dir.path().join("masks.json");
    let mut file = CocoFile::default();
    for name in ["a.png", "b.png"] {
        file.add(&photo(name));
    }
    file.write(&masks).unwrap();
    (dir, masks)
}

#[test]
fn crops_come_from_labelled_photos_and_repeat() {
    let (dir, masks) = folder();
    let photos = LabelledPhotos::open(dir.path(), &masks, None).unwrap();
    assert_eq!((photos.photos().len(), photos.unlabelled().len()), (2, 1));
    let crops = PhotoCrops::new(&photos, AugmentParams::default(), 64, 5);
    let first = crops.sample(7).unwrap();
    assert_eq!(
        first,
        PhotoCrops::new(&photos, AugmentParams::default(), 64, 5)
            .sample(7)
            .unwrap()
    );
    assert_ne!(first, crops.sample(8).unwrap());
    assert!((0..10).all(|n| !stones(&crops.sample(n).unwrap()).is_empty()));
    let validation = PhotoCrops::new(&photos, AugmentParams::default(), 320, 5)
        .validation()
        .unwrap();
    assert!(!validation.is_empty() && validation.iter().all(|v| !stones(v).is_empty()));
}

#[test]
fn crops_show_no_label_of_what_is_held_out() {
    let (dir, masks) = folder();
    std::fs::remove_file(dir.path().join("b.png")).unwrap();
    let photos = LabelledPhotos::open(dir.path(), &masks, None).unwrap();
    let crops = PhotoCrops::new(&photos, AugmentParams::default(), 64, 5);
    let held_out: BTreeSet<u32> = crops.validation().unwrap().iter().flat_map(stones).collect();
    let learnt: BTreeSet<u32> = (0..200).flat_map(|n| stones(&crops.sample(n).unwrap())).collect();
    assert!(!held_out.is_empty() && held_out.is_disjoint(&learnt));
    // All 80 stones are seen by one or the other.
    assert_eq!(held_out.len() + learnt.len(), 80);
}

#[test]
fn outside_valid_regions_nothing_is_known() {
    let (dir, masks) = folder();
    let valid = dir.path().join("valid.json");
    let regions = r#"{"a.png": {"width": 200, "height": 160, "valid": [{"outer": [0, 0, 100, 0, 100, 160, 0, 160], "holes": [[20, 20, 40, 20, 40, 40, 20, 40]]}]}}"#;
    std::fs::write(&valid, regions).unwrap();
    let photos = LabelledPhotos::open(dir.path(), &masks, Some(&valid)).unwrap();
    let [a, b] = [0, 1].map(|i| photos.read(&photos.photos()[i]).unwrap());
    let unknown = |s: &Sample| s.ignore().data().iter().filter(|i| **i).count();
    assert_eq!([unknown(&a), unknown(&b)], [100 * 160 + 20 * 20, 200 * 160]);
}

#[test]
fn a_folder_without_labelled_photos_is_an_error_that_says_so() {
    let (dir, masks) = folder();
    let other = tempfile::tempdir().unwrap();
    write_png_rgb(&other.path().join("z.png"), &Raster::filled(8, 8, [0; 3])).unwrap();
    let error = LabelledPhotos::open(other.path(), &masks, None)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("none of the photos (1)") && error.contains("masks.json"),
        "{error}"
    );
    std::fs::remove_dir_all(dir.path()).unwrap();
}
