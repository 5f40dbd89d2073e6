//! Epochs whose clouds lie in different frames.

use crate::support::stones::{number, rows};
use crate::support::{copy_of, run, survey, survey_results};
use nalgebra::{Point3, Vector3};
use std::fs;
use std::path::Path;
use stonewise_core::geometry::{Rigid3, View};
use stonewise_io::cameras::{read_cameras, write_metashape};
use stonewise_io::cloud::{read_cloud, write_points_laz};

/// Brings the second epoch of a survey into another frame: cloud and cameras.
fn turn(survey: &Path, motion: &Rigid3) {
    let cloud = survey.join("epoch2/cloud_tls.laz");
    let mut points: Vec<Point3<f64>> = Vec::new();
    read_cloud(&cloud, 1 << 20, |chunk| {
        points.extend(chunk.positions.iter().map(|p| motion * p));
        Ok::<(), stonewise_io::cloud::CloudError>(())
    })
    .unwrap();
    write_points_laz(&cloud, None, &points, &[]).unwrap();
    let cameras = survey.join("epoch2/cameras_metashape.xml");
    let moved = |view: &View| View {
        cam_from_world: view.cam_from_world * motion.inverse(),
        ..view.clone()
    };
    let views: Vec<View> = read_cameras(&cameras).unwrap().views.iter().map(moved).collect();
    write_metashape(&cameras, &views, None).unwrap();
}

#[test]
fn an_epoch_in_another_frame_is_measured_by_its_stones_up_to_the_motion_of_the_whole() {
    let aligned = tempfile::tempdir().unwrap();
    let turned = copy_of(survey());
    turn(
        turned.path(),
        &Rigid3::new(Vector3::new(300.0, -400.0, 20.0), Vector3::new(0.5, -0.3, 2.2)),
    );
    let (code, text) = run(turned.path(), aligned.path(), &[]);
    assert_ne!(code, 0, "{text}");
    assert!(text.contains("align = \"stones\""), "{text}");

    let project = turned.path().join("stonewise.toml");
    let asked = format!(
        "{}\n[registration]\nalign = \"stones\"\n",
        fs::read_to_string(&project).unwrap()
    );
    fs::write(&project, asked).unwrap();
    let (code, text) = run(turned.path(), aligned.path(), &[]);
    assert_eq!(code, 0, "{text}");
    assert!(text.contains("aligned by"), "{text}");

    let [plain, aligned] = [survey_results(), aligned.path()].map(|out| rows(&out.join("stones.csv")));
    let mut compared = 0;
    for (id, stone) in plain.iter().filter(|(_, s)| s["status"] == "ok") {
        let other = &aligned[id];
        assert_eq!(other["status"], "ok", "stone {id}");
        for column in ["rel_dx", "rel_dy", "rel_dz"] {
            let [a, b] = [stone, other].map(|s| number(s, column));
            assert!((a - b).abs() < 2e-4, "stone {id}, {column}: {a} and {b} m");
        }
        compared += 1;
    }
    assert!(compared >= 15, "only {compared} stones");
}
