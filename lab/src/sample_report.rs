//! Made-up results of a wall of any number of stones, for the browser tests of the report (`web/tests`).
//!
//! `cargo run -p stonewise-lab -- sample-report STONES DIR [CASE [LANGUAGE]]` writes result files into DIR as
//! `stonewise run` would, with names from inputs that try to be markup, and makes the report and the layers
//! from them. CASE: `unknown` (the default: a moved wall whose datum is unknown), `moved`, `still`,
//! `cannot-tell`, `unconverged`. LANGUAGE: `en` or `de`.

use crate::Outcome;
use crate::words::Words;
use nalgebra::{Matrix3, Matrix6, Point3, Vector3};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use stonewise::export::write_layers;
use stonewise::report::write_report;
use stonewise::results::names::{PairFile, RUN, audit};
use stonewise::results::records::{
    CrsRecord, Datum, DatumState, EpochRecord, EstimatorRecord, GicpRecord, InputRecord, ProjectRecord,
    RegistrationRecord, RunRecord, StepTime, Timestamp,
};
use stonewise::results::{
    Budget, Crop, Cut, PosedPhoto, RowMotion, SectionPoint, Status, StoneOutline, StoneRow, Term, ThinPoint,
    Tracks, crop_side_px, detection_limit_m, most_pictured, track_side_px, write_cameras, write_crops,
    write_outlines, write_sections, write_stones, write_thin_cloud, write_tracks,
};
use stonewise_base::messages::Said;
use stonewise_base::messages::notices::DATUM_STABLE;
use stonewise_core::geometry::FaceFrame;
use stonewise_core::registration::photos::FacePictures;
use stonewise_core::registration::{FaceShift, PhotoShift, StoneEvidence};

/// Size of a stone with its joint, metres.
const PITCH_M: [f64; 2] = [0.42, 0.26];
/// Half of the joint, metres.
const JOINT_M: f64 = 0.012;

pub fn run(words: &Words) -> Outcome {
    let (stones, dir, rest) = match words.as_slice() {
        [stones, dir, rest @ ..] => (stones.parse()?, Path::new(dir), rest),
        _ => return Err("usage: sample-report STONES DIR [CASE [LANGUAGE]]".into()),
    };
    let case = rest.first().map_or("unknown", String::as_str);
    let language = rest.get(1).map_or("en", String::as_str);
    let wall = Wall {
        moves: !matches!(case, "still" | "cannot-tell"),
        ..Wall::new(stones)
    };
    write_stones(dir, 1, &(0..stones).map(|i| wall.row(i)).collect::<Vec<_>>())?;
    write_outlines(dir, &(0..stones).map(|i| wall.outline(i)).collect::<Vec<_>>())?;
    std::fs::write(dir.join(PairFile::M3c2Csv.place(1)), wall.core_points())?;
    wall.write_evidence(dir, stones)?;
    write_records(dir, case, language)?;
    write_report(dir)?;
    write_layers(dir)?;
    Ok(())
}

/// A battered wall in running bond, three times as long as high, that settles to the right and bulges in its
/// middle.
struct Wall {
    columns: usize,
    corner: Point3<f64>,
    frame: FaceFrame,
    length_m: f64,
    height_m: f64,
    /// Whether it moves beyond noise.
    moves: bool,
}

impl Wall {
    fn new(stones: usize) -> Self {
        let courses = ((stones as f64 * PITCH_M[0] / PITCH_M[1] / 3.0).sqrt().round() as usize).max(1);
        let columns = stones.div_ceil(courses);
        Self {
            columns,
            corner: Point3::new(451_000.0, 5_601_000.0, 310.0),
            frame: FaceFrame::from_normal(&Vector3::new(0.6, -0.75, 0.2)),
            length_m: columns as f64 * PITCH_M[0],
            height_m: courses as f64 * PITCH_M[1],
            moves: true,
        }
    }

    /// (along, up) of the middle of a stone.
    fn place(&self, i: usize) -> [f64; 2] {
        let (column, course) = (i % self.columns, i / self.columns);
        let shift = if course % 2 == 1 { 0.5 } else { 0.0 };
        [
            (column as f64 + shift + 0.5) * PITCH_M[0],
            (course as f64 + 0.5) * PITCH_M[1],
        ]
    }

    fn world(&self, [along, up]: [f64; 2]) -> Point3<f64> {
        self.corner + self.frame.along * along + self.frame.up * up
    }

    /// Displacement as (along, up, out).
    fn motion(&self, [along, up]: [f64; 2], i: usize) -> Vector3<f64> {
        if !self.moves {
            return Vector3::new(noise(i, 1), noise(i, 2), noise(i, 3));
        }
        let (x, y) = (along / self.length_m - 0.5, up / self.height_m - 0.5);
        let bulge = 0.03 * (-(x * x * 30.0 + y * y * 8.0)).exp();
        let loose = if i % 97 == 40 { 0.012 } else { 0.0 };
        Vector3::new(
            0.004 + loose + noise(i, 1),
            -0.012 * (x + 0.5) + noise(i, 2),
            bulge + noise(i, 3),
        )
    }

    fn is_loose(&self, i: usize) -> bool {
        self.moves && i % 97 == 40
    }

    fn row(&self, i: usize) -> StoneRow {
        let place = self.place(i);
        let status = Status::ALL[if i % 23 == 7 { 1 + i % 8 } else { 0 }];
        let matched = !status.word().starts_with("unmatched");
        StoneRow {
            stone_id: i as u32 + 1,
            centroid: self.world(place),
            along_m: place[0],
            up_m: place[1],
            area_m2: (PITCH_M[0] - 2.0 * JOINT_M) * (PITCH_M[1] - 2.0 * JOINT_M),
            points_1: 3000 + (i % 500) as u32,
            points_2: matched.then_some(2900),
            photos: 3 + (i % 5) as u32,
            confidence: 0.85 + 0.1 * (i % 10) as f64 / 10.0,
            matched_id: matched.then_some(i as u32 + 1),
            body_id: matched.then_some(1),
            status,
            zone_id: 0,
            motion: (status == Status::Ok).then(|| self.row_motion(place, i)),
            edited: None,
            carried_from: None,
        }
    }

    fn row_motion(&self, place: [f64; 2], i: usize) -> RowMotion {
        let face = self.motion(place, i);
        let world_from_face = self.frame.face_from_world().transpose();
        let displacement = world_from_face * face;
        let sigma = Vector3::new(0.0009, 0.0006, 0.0004);
        let covariance: Matrix3<f64> = world_from_face
            * Matrix3::from_diagonal(&sigma.component_mul(&sigma))
            * world_from_face.transpose();
        let limit = detection_limit_m(&displacement, &covariance);
        RowMotion {
            displacement,
            face,
            rotation: world_from_face * Vector3::new(0.0004, noise(i, 4), 0.001),
            covariance,
            face_sd: sigma,
            rotation_covariance: Matrix3::identity() * 1e-8,
            relative: world_from_face
                * Vector3::new(if self.is_loose(i) { 0.012 } else { noise(i, 5) }, 0.0, 0.0),
            relative_covariance: covariance,
            detection_limit_m: limit,
            significant: displacement.norm() > limit,
            loose: self.is_loose(i),
            deformation: [None; 3],
            deformation_sd: [None; 3],
            p_loose: Some(if self.is_loose(i) { 0.99 } else { 0.01 }),
            observability: 0.6,
            budget: Budget::from_sds([(Term::Stone, sigma * 0.6), (Term::Registration, sigma * 0.8)]),
        }
    }

    fn outline(&self, i: usize) -> StoneOutline {
        let [along, up] = self.place(i);
        let (w, h) = (PITCH_M[0] / 2.0 - JOINT_M, PITCH_M[1] / 2.0 - JOINT_M);
        let ring = (0..16).map(|k| {
            let angle = f64::from(k) / 16.0 * std::f64::consts::TAU;
            // A superellipse: a square with rounded, slightly rough corners.
            let round = |v: f64| v.signum() * v.abs().powf(0.35);
            let rough = 1.0 + noise(16 * i + k as usize, 6) * 40.0;
            self.world([
                along + w * round(angle.cos()) * rough.min(1.02),
                up + h * round(angle.sin()) * rough.min(1.02),
            ])
        });
        StoneOutline {
            stone_id: i as u32 + 1,
            normal: self.frame.out,
            ring: ring.collect(),
        }
    }

    /// Crops, sections, clouds and cameras of both epochs.
    fn write_evidence(&self, dir: &Path, stones: usize) -> stonewise::Result<()> {
        let side = crop_side_px(stones, 160.0);
        let points = (400_000 / stones.max(1)).clamp(40, 160);
        let mut sections = Vec::new();

        for i in 0..stones {
            let d = self.motion(self.place(i), i);
            for (later, cut) in [
                (false, Cut::Level),
                (false, Cut::Upright),
                (true, Cut::Level),
                (true, Cut::Upright),
            ] {
                sections.extend((0..points).map(|k| {
                    let place =
                        (k as f64 / points as f64 - 0.5) * if cut == Cut::Level { 0.38 } else { 0.22 };
                    let relief = 0.006 * (place * 40.0 + i as f64).sin() + noise(i * 1000 + k, 8);
                    let moved = if later {
                        [d[usize::from(cut == Cut::Upright)], d.z]
                    } else {
                        [0.0; 2]
                    };
                    SectionPoint {
                        stone_id: i as u32 + 1,
                        is_later: later,
                        cut,
                        place_m: (place + moved[0]) as f32,
                        out_m: (relief + moved[1]) as f32,
                    }
                }));
            }
        }

        write_sections(dir, 2, &sections)?;
        write_tracks(dir, 2, &self.tracks(stones))?;
        for epoch in [1, 2] {
            let (crops, tiles): (Vec<Crop>, Vec<_>) = (0..stones).map(|i| self.crop(i, epoch, side)).unzip();
            write_crops(dir, epoch, side, &crops, &tiles)?;
            write_thin_cloud(dir, epoch, &self.thin_cloud(epoch))?;
            write_cameras(dir, epoch, &self.cameras())?;
        }

        Ok(())
    }

    /// What photos show of every stone but each eleventh; pictures of as many as a run would show.
    fn tracks(&self, stones: usize) -> Tracks {
        let side = track_side_px(stones);
        let shift = |at: [f64; 2], sd: f64| FaceShift {
            shift_m: at,
            covariance_m2: [sd * sd, 0.3 * sd * sd, 1.5 * sd * sd],
        };

        let evidence = |i: usize| {
            let d = self.motion(self.place(i), i);
            let photo = |k: usize| {
                let epoch = k / 6;
                let at = |axis: usize| d[axis] * epoch as f64 + 2.0 * noise(i * 12 + k, 12 + axis as u64);
                PhotoShift {
                    photo: k,
                    epoch,
                    shift: shift([at(0), at(1)], 0.0004),
                    weight: if k == 9 { 0.2 } else { 1.0 },
                }
            };
            StoneEvidence {
                place: [0.01, -0.01],
                clouds: Some(shift([d.x + noise(i, 14), d.y + noise(i, 15)], 0.003)),
                photos: Some(shift([d.x, d.y], 0.0006)),
                both: Some(shift([d.x, d.y], 0.0005)),
                shifts: (0..12).map(photo).collect(),
                pictures: (i < most_pictured(side)).then(|| pictures(i, side as usize)),
            }
        };

        Tracks {
            photos: (0..12).map(|k| format!("<script>{k}.jpg")).collect(),
            stones: (0..stones)
                .filter(|i| i % 11 != 3 && i % 23 != 7)
                .map(|i| (i as u32 + 1, evidence(i)))
                .collect(),
        }
    }

    /// A grey stone in dark joints, a little lighter in the second epoch.
    fn crop(&self, i: usize, epoch: usize, side: u32) -> (Crop, Vec<[u8; 3]>) {
        let s = f64::from(side);
        let (w, h) = (0.8 * s, 0.48 * s);
        let [left, top] = [(s - w) / 2.0, (s - h) / 2.0];
        let inside = |x: f64, y: f64| (left..left + w).contains(&x) && (top..top + h).contains(&y);
        let tile = (0..side * side).map(|k| {
            let (x, y) = (f64::from(k % side), f64::from(k / side));
            // As rough as a photo of rock: about 0.15 bytes a pixel as JPEG.
            let grain = (noise((k / 4) as usize + i * 7, 9) * 1.6e4) as i32;
            let base = if inside(x, y) {
                130 + 20 * epoch as i32 + (i % 40) as i32
            } else {
                60
            };
            [0, 6, 18].map(|tint| (base - tint + grain).clamp(0, 255) as u8)
        });

        let corner = |x: f64, y: f64| [x as f32, y as f32];
        let ring = vec![
            corner(left, top),
            corner(left + w, top),
            corner(left + w, top + h),
            corner(left, top + h),
        ];
        let crop = Crop {
            stone_id: i as u32 + 1,
            photo: format!("<script>{}.jpg", i % 12),
            half_m: 0.27,
            rings: vec![ring],
        };
        (crop, tile.collect())
    }

    fn thin_cloud(&self, epoch: usize) -> Vec<ThinPoint> {
        let point = |k: usize| {
            let place = [
                (noise(k, 10) * 1e3 + 0.5) * self.length_m,
                (noise(k, 11) * 1e3 + 0.5) * self.height_m,
            ];
            let moved = self.motion(place, 1) * if epoch == 2 { 1.0 } else { 0.0 };
            let shade = (150.0 + 40.0 * (place[0] * 3.0).sin()) as u8;
            ThinPoint {
                position: self.world(place) + self.frame.face_from_world().transpose() * moved,
                colour: [shade, shade, shade - 12],
                stone: 0,
            }
        };
        (0..220_000).map(point).collect()
    }

    fn cameras(&self) -> Vec<PosedPhoto> {
        let camera = |k: usize| PosedPhoto {
            name: format!("<b>{k}.jpg"),
            centre: self.world([self.length_m * (k as f64 + 0.5) / 12.0, self.height_m / 2.0])
                + self.frame.out * 8.0,
            axis: -self.frame.out,
            right: self.frame.along * 0.5,
            down: -self.frame.up * 0.35,
        };
        (0..12).map(camera).collect()
    }

    /// `m3c2.csv`, a core point every 10 cm.
    fn core_points(&self) -> String {
        let mut csv = String::from("x,y,z,NormalX,NormalY,NormalZ,m3c2_distance,m3c2_uncertainty\n");
        let n = self.frame.out;
        for course in 0..(self.height_m / 0.1) as usize {
            for column in 0..(self.length_m / 0.1) as usize {
                let place = [column as f64 * 0.1, course as f64 * 0.1];
                let p = self.world(place);
                let d = self.motion(place, 1).z + noise(course * 1000 + column, 7);
                let _ = writeln!(csv, "{},{},{},{},{},{},{d},0.0015", p.x, p.y, p.z, n.x, n.y, n.z);
            }
        }
        csv
    }
}

/// A repeatable number between minus and plus half a millimetre.
fn noise(i: usize, salt: u64) -> f64 {
    let mixed = (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ salt.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((mixed >> 11) as f64 / (1u64 << 53) as f64 - 0.5) * 1e-3
}

/// The other files of a run, with hostile names.
fn write_records(dir: &Path, case: &str, language: &str) -> Result<(), Box<dyn std::error::Error>> {
    let epoch = |name: &str| EpochRecord {
        name: name.to_owned(),
        date: None,
        conditions: BTreeMap::new(),
        clouds: vec![input("<i>cloud.laz")],
        cameras: Some(input("cameras.xml")),
        masks: None,
        images: Some("photos".into()),
        motion: None,
        points: 1_000_000,
        photo_count: 12,
        photos: Vec::new(),
        stones: 200,
    };

    let datum = match case {
        "unknown" => Datum::unknown(&Point3::origin(), "unknown"),
        _ => Datum::known(
            DatumState::Stable,
            &Point3::origin(),
            &Matrix6::from_diagonal_element(1e-10),
            DATUM_STABLE.say(&[("error_mm", Said::numbers("0.20".to_owned()))]),
        ),
    };
    let run = RunRecord {
        version: "0.0.0".to_owned(),
        program: String::new(),
        processor: stonewise::processor_class().to_owned(),
        finished_at: Timestamp::EPOCH,
        project: ProjectRecord {
            name: "Sample </title><script>alert(1)</script> wall".to_owned(),
            file: "stonewise.toml".into(),
        },
        crs: Some(CrsRecord {
            epsg: Some(25832),
            name: "ETRS89 / UTM zone 32N".to_owned(),
            wkt: String::new(),
        }),
        datum: [("2026".to_owned(), datum.state)].into(),
        verdict: None,
        epochs: vec![epoch("2025 <b>"), epoch("2026")],
        part: None,
        edits: None,
        conditions: None,
        instruments: Vec::new(),
        parameters: settings(case, language)?,
        steps: vec![StepTime {
            step: "ingest-1".to_owned(),
            seconds: 1.5,
            processor_seconds: Some(2.0),
            resumed: false,
            peak_memory_bytes: Some(1000),
        }],
        warnings: vec![stonewise::Warning {
            step: "segment".to_owned(),
            subject: "<script>.jpg".to_owned(),
            code: None,
            message: "cut off: \"'&".to_owned(),
            translations: Default::default(),
            skipped_input: true,
            doubt: false,
        }],
    };

    let gicp = GicpRecord {
        stones: 200,
        measured: 190,
        loose: 2,
    };
    let estimator = match case {
        "unconverged" => serde_json::from_value(unconverged())?,
        _ => EstimatorRecord::Gicp(gicp),
    };
    let registration = RegistrationRecord {
        estimator,
        datum,
        observers: None,
        deformation: None,
        checks: Vec::new(),
        influence: Vec::new(),
    };

    std::fs::write(dir.join(RUN), serde_json::to_string(&run)?)?;
    std::fs::write(
        dir.join(PairFile::Registration.place(1)),
        serde_json::to_string(&registration)?,
    )?;
    std::fs::write(
        dir.join(audit(1)),
        "event,photo,instance,stones,share,points\nsplit_instance,<script>.jpg,4,1 2,,\n",
    )?;
    Ok(())
}

/// Thresholds of 5 and 10 mm; below the noise where the wall cannot tell; none where the datum is unknown.
fn settings(case: &str, language: &str) -> Result<stonewise::Settings, Box<dyn std::error::Error>> {
    let levels = match case {
        "unknown" => serde_json::json!({}),
        "cannot-tell" => serde_json::json!({ "attention_mm": 1.0 }),
        _ => serde_json::json!({ "attention_mm": 5.0, "alarm_mm": 10.0 }),
    };
    Ok(stonewise::Settings {
        thresholds: serde_json::from_value(levels)?,
        report: serde_json::from_value(serde_json::json!({ "language": language }))?,
        ..stonewise::Settings::default()
    })
}

/// An adjustment that ran out of iterations.
fn unconverged() -> serde_json::Value {
    serde_json::json!({
        "estimator": "adjustment", "converged": false, "iterations": 30, "noise_m": [0.002, 0.002], "roughness_m": null,
        "surface_cell_m": null, "correlation_factor": null, "common_motion_m": [0.0, 0.0, 0.0],
        "common_motion_covariance_m2": [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], "loose": 2, "breaks": [],
        "variance_components": { "drift": [0.0, 0.0], "error_m": 0.0, "own_m": 0.0, "own_rad": 0.0, "strain": [0.0, 0.0] },
        "photos": { "statuses": { "few_photos": 1 }, "sigma_factor": 1.0, "appearance_m": 0.0, "poses_px": [], "stones": [
            { "stone_id": 4, "status": "few_photos", "photos": [1, 3], "correlation": 0.7, "shift_m": null, "sd_m": null }
        ] }
    })
}

fn input(path: &str) -> InputRecord {
    InputRecord {
        path: path.into(),
        bytes: 123_456,
        blake3: String::new(),
        written: None,
    }
}

/// Rough rock in both epochs, with a spot in the second.
fn pictures(i: usize, side_px: usize) -> FacePictures {
    let grey = |epoch: usize| -> Vec<u8> {
        let value = |k: usize| {
            let (x, y) = (
                (k % side_px) as f64 / side_px as f64,
                (k / side_px) as f64 / side_px as f64,
            );
            let spot = if epoch == 1 && (x - 0.6).hypot(y - 0.4) < 0.15 {
                40.0
            } else {
                0.0
            };
            (130.0 + noise(k / 2 + i * 13, 16) * 4e4 + spot).clamp(0.0, 255.0) as u8
        };
        (0..side_px * side_px).map(value).collect()
    };
    let grey = [grey(0), grey(1)];
    let changed = |(a, b): (&u8, &u8)| (128.0 + 0.5 * (f64::from(*b) - f64::from(*a))) as u8;
    FacePictures {
        photos: [1, 8],
        side_px,
        edge_m: 0.4,
        difference: grey[0].iter().zip(&grey[1]).map(changed).collect(),
        grey,
    }
}
