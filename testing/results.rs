//! Made-up results for the tests of several crates.
#![allow(dead_code, reason = "each crate uses a part")]

use nalgebra::{Matrix3, Matrix6, Point3, Vector3, Vector6};
use stonewise_base::settings::Settings;
use stonewise_core::registration::VarianceComponents;
use stonewise_core::registration::observers::SensorClass;
use stonewise_results::StoneOutline;
use stonewise_results::records::{
    AdjustmentRecord, CheckRecord, Datum, DatumState, EpochRecord, EstimatorRecord, InputRecord,
    ObserversRecord, ProjectRecord, RegistrationRecord, RunRecord,
};
use stonewise_results::{Budget, RowMotion, Status, StoneRow, write_outlines, write_stones};

/// A folder with the result files of these rows.
pub fn folder(rows: &[StoneRow]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_stones(folder.path(), 1, rows).unwrap();
    write_outlines(folder.path(), &outlines()).unwrap();
    folder
}

/// The record of a run of a project with these epochs.
pub fn run_record(project: &str, epochs: &[&str]) -> RunRecord {
    let input = |path: &str| InputRecord {
        path: path.into(),
        bytes: 123_456,
        blake3: "0".repeat(64),
        written: None,
    };
    let epoch = |name: &&str| EpochRecord {
        name: (*name).to_owned(),
        date: Some("2026-04-30".to_owned()),
        conditions: [("temperature_c".to_owned(), 9.5)].into(),
        clouds: vec![input("survey/cloud.laz")],
        cameras: Some(input("survey/cameras.xml")),
        masks: None,
        images: Some("survey/photos".into()),
        motion: None,
        points: 1_000_000,
        photo_count: 12,
        photos: Vec::new(),
        stones: 24,
    };
    RunRecord {
        version: "0.0.0".to_owned(),
        program: "0".repeat(64),
        processor: "x86_64, AVX2 and FMA".to_owned(),
        finished_at: "2026-04-30T12:00:00.000Z".parse().unwrap(),
        project: ProjectRecord {
            name: project.to_owned(),
            file: "survey/stonewise.toml".into(),
        },
        crs: None,
        datum: epochs
            .iter()
            .skip(1)
            .map(|e| ((*e).to_owned(), DatumState::Stable))
            .collect(),
        verdict: None,
        epochs: epochs.iter().map(epoch).collect(),
        part: None,
        edits: None,
        conditions: None,
        instruments: Vec::new(),
        parameters: Settings::default(),
        steps: Vec::new(),
        warnings: Vec::new(),
    }
}

/// An adjustment that did not settle, with stable areas that show an error of (1.2, 0, -3) mm.
pub fn registration_record() -> RegistrationRecord {
    let centre = Point3::new(100.0, 201.0, 50.0);
    let covariance = Matrix6::from_diagonal(&Vector6::new(1e-6, 4e-6, 1e-6, 1.0, 1.0, 1.0));
    let observers = ObserversRecord {
        sensor: SensorClass::Terrestrial,
        assumed_shared_error_m: 3e-4,
        components: None,
        assumed_merged_error_m: None,
        stretch: None,
        significance: 12.0,
        compared_stones: [20, 21],
        stable_cells: 40,
        error: [0.0012, 0.0, -0.003, 0.0, 0.0, 0.0],
    };
    let adjustment = AdjustmentRecord {
        converged: false,
        iterations: 32,
        noise_m: [Some(0.001), None],
        roughness_m: Some(0.002),
        surface_cell_m: Some(0.004),
        correlation_factor: Some(1.5),
        variance_components: VarianceComponents {
            drift: [5e-3, 1e-2],
            strain: [3e-3, 1e-2],
            own_m: 5e-4,
            error_m: 5e-4,
            own_rad: 2e-3,
            appearance_m: None,
        },
        common_motion_m: [0.001, 0.0, -0.002],
        common_motion_covariance_m2: [[1e-6, 0.0, 0.0], [0.0, 1e-6, 0.0], [0.0, 0.0, 1e-6]],
        loose: 1,
        breaks: Vec::new(),
        photos: None,
    };
    RegistrationRecord {
        estimator: EstimatorRecord::Adjustment(Box::new(adjustment)),
        datum: Datum::known(
            DatumState::Stable,
            &centre,
            &covariance,
            "the stable areas show a registration error of 3.2 mm".to_owned(),
        ),
        observers: Some(observers),
        deformation: None,
        checks: vec![CheckRecord {
            name: "insensitive".to_owned(),
            what: "smallest motion that would be detected, against what the points allow".to_owned(),
            epoch: "2025".to_owned(),
            statistic: 1.25,
            limit: 100.0,
            at_least: false,
            source: "chosen".to_owned(),
            passed: true,
            remedy: None,
        }],
        influence: Vec::new(),
    }
}

/// A wall of 6 x 4 stones that looks along x: one moved by 2 cm, one loose, some without a motion.
pub fn rows() -> Vec<StoneRow> {
    (1..=24).map(row).collect()
}

/// Their outlines: rectangles of 40 x 25 cm.
pub fn outlines() -> Vec<StoneOutline> {
    let corner = |c: Point3<f64>, y: f64, z: f64| c + Vector3::new(0.0, 0.19 * y, 0.115 * z);
    let outline = |r: StoneRow| StoneOutline {
        stone_id: r.stone_id,
        normal: Vector3::x(),
        ring: [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(y, z)| corner(r.centroid, y, z))
            .to_vec(),
    };
    rows().into_iter().map(outline).collect()
}

fn row(stone_id: u32) -> StoneRow {
    let (column, course) = (f64::from((stone_id - 1) % 6), f64::from((stone_id - 1) / 6));
    let status = match stone_id {
        3 => Status::UnmatchedLost,
        4 => Status::UnmatchedAmbiguous,
        10 => Status::FailedPoints,
        17 => Status::Unobservable,
        _ => Status::Ok,
    };
    let matched = !matches!(status, Status::UnmatchedLost | Status::UnmatchedAmbiguous);
    StoneRow {
        stone_id,
        centroid: Point3::new(100.0, 200.0 + 0.4 * column, 50.0 + 0.25 * course),
        along_m: 0.4 * column,
        up_m: 0.25 * course,
        area_m2: 0.0874,
        points_1: 2000 + stone_id,
        points_2: matched.then_some(1900),
        photos: 5,
        confidence: 0.875,
        matched_id: matched.then_some(100 + stone_id),
        body_id: matched.then_some(1),
        status,
        zone_id: u32::from(stone_id == 8),
        motion: (status == Status::Ok).then(|| motion(stone_id)),
        edited: None,
        carried_from: None,
    }
}

fn motion(stone_id: u32) -> RowMotion {
    let displacement = match stone_id {
        8 => Vector3::new(0.003, 0.02, -0.001),
        15 => Vector3::new(0.02, 0.0, 0.004),
        _ => Vector3::new(0.0003, -0.0002, 0.0001 * f64::from(stone_id % 5)),
    };
    let covariance = Matrix3::identity() * 0.000_5_f64.powi(2);
    RowMotion {
        displacement,
        face: Vector3::new(displacement.y, displacement.z, displacement.x),
        rotation: Vector3::new(0.001, 0.0, 0.0),
        covariance,
        face_sd: Vector3::repeat(0.000_5),
        rotation_covariance: Matrix3::new(4.0, 1.0, 2.0, 1.0, 5.0, 3.0, 2.0, 3.0, 6.0) * 1e-8,
        relative: displacement,
        relative_covariance: covariance * 2.0,
        detection_limit_m: 0.000_5 * 2.795_483,
        significant: displacement.norm() > 0.000_5 * 2.795_483,
        loose: stone_id == 15,
        p_loose: (stone_id != 16).then_some(if stone_id == 15 { 0.99 } else { 0.02 }),
        deformation: (stone_id != 16)
            .then_some(displacement)
            .map_or([None; 3], |d| [Some(d.x), Some(d.y), Some(d.z)]),
        deformation_sd: if stone_id == 16 {
            [None; 3]
        } else {
            [Some(0.000_3); 3]
        },
        observability: 0.7,
        budget: Budget::default(),
    }
}
