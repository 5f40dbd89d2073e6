//! Crops of a photo whose colours say which stone a pixel shows.

use super::*;
use crate::Sample;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use stonewise_core::raster::{LabelImage, Raster, RgbImage};

/// Blocks of 30 x 20 pixels, one stone each, with joints of 4 pixels; red and green are the number of the
/// stone.
fn photo() -> Photo {
    let label = |x: u32, y: u32| {
        let is_joint = x % 30 < 4 || y % 20 < 4;
        if is_joint { 0 } else { y / 20 * 10 + x / 30 + 1 }
    };
    let (width, height) = (300, 240);
    let pixels = || (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let labels: LabelImage =
        Raster::from_vec(width, height, pixels().map(|(x, y)| label(x, y)).collect()).unwrap();
    let image: RgbImage =
        Raster::from_vec(width, height, labels.data().iter().map(|&l| colour(l)).collect()).unwrap();
    let ignore = Raster::from_vec(width, height, pixels().map(|(x, _)| x < 60).collect()).unwrap();
    Photo::new(Sample::new(image, labels, ignore).unwrap())
}

fn colour(label: u32) -> [u8; 3] {
    [label as u8, 255 - label as u8, if label == 0 { 0 } else { 200 }]
}

#[test]
fn images_and_labels_are_mapped_alike() {
    let photo = photo();
    let params = AugmentParams {
        stone_px: [8.0, 40.0],
        rotation_deg: 30.0,
        perspective: 0.2,
        ..AugmentParams::default()
    };
    let mut inner = 0;
    for seed in 0..8 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let crop = CropView::random(&photo, [160.0, 120.0], 96, &params, &mut rng).cut(&photo);
        for y in 2..94 {
            for x in 2..94 {
                let label = *crop.labels().get(x, y).unwrap();
                let mut near = (0..25).map(|i| crop.labels().get(x + i % 5 - 2, y + i / 5 - 2).unwrap());
                let outside = (0..25).any(|i| *crop.ignore().get(x + i % 5 - 2, y + i / 5 - 2).unwrap());
                // Averages of smaller images mix colours along borders only.
                if near.all(|l| *l == label) && label != 0 && !outside {
                    inner += 1;
                    assert_eq!(*crop.image().get(x, y).unwrap(), colour(label), "{seed} {x} {y}");
                }
            }
        }
    }
    assert!(inner > 3_000, "{inner}");
}

/// Relief at half the resolution whose first value tells the columns apart.
#[test]
fn relief_is_mapped_like_the_image() {
    let plain = photo();
    let (width, height) = (150, 120);
    let value = |i: u32| [(i % width) as f32, (i / width) as f32, 0.5, 1.0];
    let relief = Raster::from_vec(width, height, (0..width * height).map(value).collect()).unwrap();
    let photo = Photo::new(plain.sample().clone().with_relief(Some(relief)));
    let params = AugmentParams {
        rotation_deg: 40.0,
        perspective: 0.2,
        ..AugmentParams::default()
    };
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let view = CropView::random(&photo, [160.0, 120.0], 64, &params, &mut rng);
    let crop = view.cut(&photo);
    let relief = crop.relief().unwrap();

    assert_eq!((relief.width(), relief.height()), (64, 64));
    for (x, y) in (0..64).flat_map(|y| (0..64).map(move |x| (x, y))) {
        let at = view.to_photo([f64::from(x) + 0.5, f64::from(y) + 0.5]);
        let is_inside = (0.0..300.0).contains(&at[0]) && (0.0..240.0).contains(&at[1]);
        let expected = match is_inside {
            true => [
                (at[0] / 2.0).floor() as f32,
                (at[1] / 2.0).floor() as f32,
                0.5,
                1.0,
            ],
            false => [0.0; 4],
        };
        assert_eq!(relief.get(x, y), Some(&expected));
    }

    assert!(view.cut(&plain).relief().is_none());
}

#[test]
fn nothing_is_known_outside_the_photo_and_where_the_photo_says_so() {
    let photo = photo();
    let crop = CropView::straight([-20.0, 0.0], 100.0, 50).cut(&photo);
    let ignored = |x: u32| *crop.ignore().get(x, 20).unwrap();
    assert!((0..40).all(ignored) && !(40..50).any(ignored));
    assert_eq!(*crop.labels().get(4, 20).unwrap(), 0);
}

#[test]
fn a_straight_crop_of_the_photo_s_size_is_the_photo() {
    let photo = photo();
    let crop = CropView::straight([10.0, 20.0], 64.0, 64).cut(&photo);
    for (x, y) in [(0, 0), (63, 63), (17, 40)] {
        assert_eq!(crop.image().get(x, y), photo.sample().image().get(x + 10, y + 20));
        assert_eq!(
            crop.labels().get(x, y),
            photo.sample().labels().get(x + 10, y + 20)
        );
    }
}

#[test]
fn a_turned_view_keeps_corners_where_they_were_put() {
    let photo = photo();
    let none = AugmentParams {
        stone_px: [photo.stone_px(); 2],
        rotation_deg: 0.0,
        perspective: 0.0,
        mirrored_share: 1.0,
        ..AugmentParams::default()
    };
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let view = CropView::random(&photo, [100.0, 80.0], 60, &none, &mut rng);
    let near = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]) < 1e-9;
    assert!(near(view.to_photo([0.0, 0.0]), [130.0, 50.0]));
    assert!(near(view.to_photo([60.0, 60.0]), [70.0, 110.0]));
}

#[test]
fn colours_change_within_bounds_and_by_the_seed_alone() {
    let image = Raster::filled(40, 30, [120u8, 100, 90]);
    let change = |seed| {
        recolour(
            &image,
            &AugmentParams::default(),
            &mut ChaCha8Rng::seed_from_u64(seed),
        )
    };
    assert_eq!(change(3), change(3));
    assert_ne!(change(3), change(4));
    let none = AugmentParams {
        brightness: 0.0,
        contrast: 0.0,
        saturation: 0.0,
        hue_deg: 0.0,
        white_balance: 0.0,
        blurred_share: 0.0,
        noise: 0.0,
        shadow_share: 0.0,
        jpeg_share: 0.0,
        ..AugmentParams::default()
    };
    assert_eq!(recolour(&image, &none, &mut ChaCha8Rng::seed_from_u64(3)), image);
}
