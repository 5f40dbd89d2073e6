//! A stone that the photos of one epoch do not show, or show divided, is measured all the same, where its cloud
//! shows it.

use nalgebra::{Point3, Vector3};
use std::fs;
use std::path::{Path, PathBuf};
use stonewise::results::{Status, StoneRow, read_stones};
use stonewise::{OutputFolder, Project, Until, run};
use stonewise_core::geometry::View;
use stonewise_core::progress::Silent;
use stonewise_core::raster::RgbImage;
use stonewise_io::cameras::read_cameras;
use stonewise_io::image_io::{read_rgb, write_jpeg};
use stonewise_simulate::{
    PhotoParams, SceneParams, SurveyParams, TlsParams, WallMotion, WallParams, write_survey,
};

/// How the wall moved, metres.
const MOTION: [f64; 3] = [0.012, 0.02, -0.01];
/// Where a line divides stones, metres along the wall.
const LINE_Y_M: f64 = -0.3;

/// A wall of 1.6 x 0.9 m with masks in the first epoch alone; `spoil` changes the photos of the second, given
/// their number.
fn survey(folder: &Path, spoil: impl Fn(usize, &View, &mut RgbImage)) -> PathBuf {
    let params = SurveyParams {
        scene: SceneParams {
            wall: WallParams::sized([1.6, 0.9]),
            motions: vec![WallMotion::Translation { d_m: MOTION }],
            tls: Some(TlsParams {
                spacing_m: 0.008,
                ..TlsParams::default()
            }),
            uav: None,
            ..SceneParams::default()
        },
        photos: PhotoParams {
            columns: 3,
            rows: 1,
            width: 400,
            height: 240,
            focal_px: 700.0,
            distance_m: 4.0,
            last_unaligned: false,
            ..PhotoParams::default()
        },
        ..SurveyParams::default()
    };
    let project = write_survey(folder, &params, &Silent).unwrap().project;
    let cameras = read_cameras(&folder.join("epoch2/cameras_metashape.xml")).unwrap();
    for (number, view) in cameras.views.iter().enumerate() {
        let path = folder.join("epoch2/images").join(format!("{}.jpg", view.name));
        let mut photo = read_rgb(&path).unwrap();
        spoil(number, view, &mut photo);
        write_jpeg(&path, &photo, 92).unwrap();
    }
    let text = fs::read_to_string(&project).unwrap();
    let mut seen = 0;
    let is_kept = |line: &&str| {
        seen += usize::from(line.starts_with("masks"));
        !line.starts_with("masks") || seen == 1
    };
    let kept: Vec<&str> = text.lines().filter(is_kept).collect();
    fs::write(&project, kept.join("\n")).unwrap();
    project
}

/// Stones of the first epoch after a run, with or without carrying.
fn stones(project: &Path, out: &Path, is_enabled: bool) -> Vec<StoneRow> {
    let text = fs::read_to_string(project).unwrap();
    let other = project.with_file_name("carry.toml");
    fs::write(&other, format!("{text}\n[carry]\nenabled = {is_enabled}\n")).unwrap();
    let project = Project::read(&other).unwrap();
    let folder = OutputFolder::of_project(out, &project, false).unwrap();
    run(&project, &folder, Until::Registered, &Silent).unwrap();
    read_stones(&out.join("data/stones.parquet")).unwrap()
}

/// Blackens what lies to the right of the middle; the wall stands around the origin, its right half at
/// positive y.
fn right_half_is_dark(_: usize, view: &View, photo: &mut RgbImage) {
    let width = photo.width() as usize;
    let middle = view.project(&Point3::new(0.0, 0.0, 0.45)).unwrap();
    let from = middle.pixel[0].clamp(0.0, width as f64) as usize;
    for row in photo.data_mut().chunks_mut(width) {
        row[from..].fill([0; 3]);
    }
}

/// Draws a black line up the wall in two of the three photos.
fn a_line_divides_the_wall(number: usize, view: &View, photo: &mut RgbImage) {
    if number == 2 {
        return;
    }
    let width = photo.width() as usize;
    for k in 0..2000 {
        let place = Point3::new(0.0, LINE_Y_M, f64::from(k) * 0.5e-3);
        let at = view.project(&place).unwrap().pixel;
        let (x, y) = (at[0] as usize, at[1] as usize);
        if let Some(row) = photo.data_mut().chunks_mut(width).nth(y) {
            row[x - 3..x + 4].fill([0; 3]);
        }
    }
}

#[test]
fn a_stone_that_one_epoch_shows_divided_is_one() {
    let folder = tempfile::tempdir().unwrap();
    let project = survey(&folder.path().join("survey"), a_line_divides_the_wall);
    let out = folder.path().join("out");
    let measured = |is_enabled: bool| -> Vec<StoneRow> {
        let near = |s: &StoneRow| (s.centroid.y - LINE_Y_M).abs() < 0.1 && s.status == Status::Ok;
        let found = stones(&project, &out, is_enabled);
        found.into_iter().filter(near).collect()
    };
    let (divided, joined) = (measured(false), measured(true));
    let audit = fs::read_to_string(out.join("data/audit_epoch2.csv")).unwrap();
    assert!(audit.contains("joined_parts"), "{audit}");
    // A part that is not joined has no partner, or leaves the rest of the stone out.
    let points = |stones: &[StoneRow], id: u32| {
        let stone = stones.iter().find(|s| s.stone_id == id);
        stone.and_then(|s| s.points_2).unwrap_or_default()
    };
    let is_whole = |s: &StoneRow| 2 * points(&joined, s.stone_id) > 3 * points(&divided, s.stone_id);
    assert!(joined.iter().any(is_whole), "{joined:?} {divided:?}");
    for stone in joined {
        let error = (stone.motion.unwrap().displacement - Vector3::from(MOTION)).norm();
        assert!(error < 0.002, "stone {}: {error}", stone.stone_id);
    }
}

#[test]
fn a_stone_that_the_second_of_three_epochs_shows_whole_is_one_in_all() {
    let folder = tempfile::tempdir().unwrap();
    let project = survey(&folder.path().join("survey"), a_line_divides_the_wall);
    let text = fs::read_to_string(&project).unwrap();
    let mut tables = text.split("[[epochs]]");
    let [head, whole, divided] = [(); 3].map(|()| tables.next().unwrap());
    let again = divided.replacen("name = \"", "name = \"again ", 1);
    let epochs = [head, divided, whole, &again].join("\n[[epochs]]");
    fs::write(&project, epochs).unwrap();
    let out = folder.path().join("out");
    stones(&project, &out, true);
    let joined_in = |epoch: usize| -> Vec<String> {
        let audit = fs::read_to_string(out.join(format!("data/audit_epoch{epoch}.csv"))).unwrap();
        let lines = audit.lines().filter(|l| l.starts_with("joined_parts"));
        lines.map(str::to_owned).collect()
    };
    assert!(!joined_in(1).is_empty());
    assert_eq!(joined_in(1), joined_in(3));
}

#[test]
fn stones_in_the_dark_are_measured_by_their_surface() {
    let folder = tempfile::tempdir().unwrap();
    let project = survey(&folder.path().join("survey"), right_half_is_dark);
    let out = folder.path().join("out");
    let lost = stones(&project, &out, false);
    // Relief alone shows the detector some of the stones in the dark.
    let missed = |s: &&StoneRow| s.centroid.y > 0.15 && s.motion.is_none();
    let missed: Vec<u32> = lost.iter().filter(missed).map(|s| s.stone_id).collect();
    assert!(
        lost.iter().all(|s| s.carried_from.is_none()) && missed.len() >= 3,
        "{missed:?}"
    );
    assert!(!out.join("data/audit_carried.csv").exists());

    let found = stones(&project, &out, true);
    let carried: Vec<&StoneRow> = found.iter().filter(|s| s.carried_from.is_some()).collect();
    let measured: Vec<_> = carried.iter().filter(|s| s.status == Status::Ok).collect();
    let mut well_measured = 0;
    for stone in measured {
        let motion = stone.motion.as_ref().unwrap();
        let error = motion.displacement - Vector3::from(MOTION);
        // Few points reach some of them, at the foot of the wall: their deviations say so.
        let variances = motion.covariance.diagonal();
        let is_within = (0..3).all(|axis| error[axis].abs() < 3.0 * variances[axis].sqrt());
        assert!(is_within, "stone {}: {error:?} {variances:?}", stone.stone_id);
        let is_close = error.norm() < 0.002;
        well_measured += usize::from(is_close && missed.contains(&stone.stone_id));
        assert_eq!(stone.carried_from, Some(1));
    }
    let sought = missed.len();
    assert!(3 * well_measured > 2 * sought, "{well_measured} of {sought}");
    let audit = fs::read_to_string(out.join("data/audit_carried.csv")).unwrap();
    let listed = audit
        .lines()
        .skip(1)
        .filter(|line| line.ends_with("\"\"") || line.ends_with(','));
    assert_eq!(listed.count(), carried.len(), "{audit}");
}
