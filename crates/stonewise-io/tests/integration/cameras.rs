//! Camera files of the sample surveys: every format must describe the same photos.

use nalgebra::Point3;
use stonewise_io::cameras::{CameraFile, Remark, find_photos, read_cameras};
use stonewise_testing::survey;

/// Largest distance, pixels, between where two files put the same points.
fn largest_difference(a: &CameraFile, b: &CameraFile, points: impl Fn(usize) -> Point3<f64>) -> f64 {
    assert_eq!(a.views.len(), b.views.len());
    let mut largest = 0.0f64;
    let mut compared = 0;
    for (left, right) in a.views.iter().zip(&b.views) {
        assert_eq!(left.image, right.image);
        assert_eq!(
            left.name.trim_end_matches(".jpg"),
            right.name.trim_end_matches(".jpg")
        );
        for i in 0..1000 {
            let point = points(i);
            let (p, q) = (left.project(&point), right.project(&point));
            assert_eq!(p.is_some(), q.is_some());
            if let (Some(p), Some(q)) = (p, q)
                && left.is_inside(p.pixel)
            {
                let difference = (p.pixel[0] - q.pixel[0]).hypot(p.pixel[1] - q.pixel[1]);
                largest = largest.max(difference).max((p.depth_m - q.depth_m).abs());
                compared += 1;
            }
        }
    }
    assert!(compared > 500 * a.views.len(), "only {compared} points in view");
    largest
}

/// Spread over [0, 1) without repeating (Weyl sequence).
fn spread(i: usize, step: f64) -> f64 {
    (i as f64 * step).fract()
}

#[test]
fn fountain_metashape_and_colmap_agree() {
    let Some(folder) = survey("fountain") else { return };
    for epoch in ["epoch1", "epoch2"] {
        let metashape = read_cameras(&folder.join(epoch).join("cameras.xml")).unwrap();
        let colmap = read_cameras(&folder.join(epoch)).unwrap();
        // The wall of the survey's description.
        let wall = |i| {
            let (u, v) = (8.0 * spread(i, 0.618_034) - 4.0, 6.0 * spread(i, 0.754_877) - 1.0);
            Point3::new(-16.6963 + 0.95458 * u, 11.4461 + 0.29794 * u, v)
        };
        let difference = largest_difference(&metashape, &colmap, wall);
        println!("{epoch}: {difference:e} px");
        assert!(difference < 1e-9);
    }
}

#[test]
fn dam_metashape_and_colmap_agree_and_the_unaligned_camera_is_named() {
    for case in ["combo", "split"] {
        let Some(folder) = survey(&format!("dam_small/{case}")) else {
            return;
        };
        for epoch in ["epoch1", "epoch2"] {
            let metashape = read_cameras(&folder.join(epoch).join("cameras_metashape.xml")).unwrap();
            let colmap = read_cameras(&folder.join(epoch).join("colmap")).unwrap();
            let wall = |i| {
                let z = 3.0 * spread(i, 0.754_877);
                Point3::new(-0.2 * z, 4.0 * spread(i, 0.618_034) - 2.0, z)
            };
            let difference = largest_difference(&metashape, &colmap, wall);
            println!("{case}/{epoch}: {difference:e} px");
            assert!(difference < 1e-9);
            assert!(
                metashape
                    .skipped
                    .iter()
                    .all(|(_, reason)| *reason == Remark::NotAligned)
            );
            assert_eq!(metashape.skipped.len(), 1);
            let photos = find_photos(&folder.join(epoch).join("images"), &metashape).unwrap();
            assert!(photos.paths.iter().all(Option::is_some));
            assert!(photos.without_camera.is_empty());
        }
    }
}
