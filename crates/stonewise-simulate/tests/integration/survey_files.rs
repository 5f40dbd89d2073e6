//! A simulated survey on disk, read back with the readers that real surveys go through.

use nalgebra::Point3;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use stonewise_core::progress::{Progress, Silent};
use stonewise_io::cameras::read_cameras;
use stonewise_io::cloud::{CloudError, PointChunk, read_cloud};
use stonewise_io::masks::MaskSource;
use stonewise_simulate::{
    MaskFiles, PhotoParams, SceneParams, SimulateError, SurveyParams, TlsParams, UavParams, WallMotion,
    WallParams, write_survey,
};
use stonewise_testing::on_threads;

fn tiny() -> SurveyParams {
    SurveyParams {
        name: "A \"tiny\" wall".to_owned(),
        scene: SceneParams {
            wall: WallParams::sized([1.2, 0.9]),
            motions: vec![
                WallMotion::Translation {
                    d_m: [0.0, 0.01, 0.0],
                },
                WallMotion::Loose {
                    share: 0.0,
                    at_least: 1,
                    shift_m: [0.01, 0.02],
                    rotation_rad: 0.02,
                },
            ],
            tls: Some(TlsParams {
                spacing_m: 0.012,
                ..TlsParams::default()
            }),
            uav: Some(UavParams {
                spacing_m: 0.02,
                ..UavParams::default()
            }),
            ..SceneParams::default()
        },
        photos: PhotoParams {
            columns: 2,
            rows: 1,
            width: 240,
            height: 180,
            focal_px: 400.0,
            distance_m: 4.0,
            last_unaligned: true,
            ..PhotoParams::default()
        },
        ..SurveyParams::default()
    }
}

#[allow(clippy::unwrap_used, reason = "a test may fail here")]
fn files(folder: &Path, found: &mut BTreeMap<String, Vec<u8>>, root: &Path) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, found, root);
        } else {
            let name = path.strip_prefix(root).unwrap().to_string_lossy().into_owned();
            found.insert(name, fs::read(&path).unwrap());
        }
    }
}

#[test]
fn a_survey_reads_back_and_is_the_same_for_the_same_parameters() {
    let folder = tempfile::tempdir().unwrap();
    let params = tiny();
    let summary = write_survey(folder.path(), &params, &Silent).unwrap();
    assert_eq!(summary.photos, 4);
    assert!(summary.project_uav.is_some());

    let count = |name: &str| {
        let mut points = 0;
        read_cloud(
            &folder.path().join(name),
            10_000,
            |chunk: &PointChunk| -> Result<(), CloudError> {
                points += chunk.len();
                Ok(())
            },
        )
        .unwrap();
        points
    };
    let clouds = [
        "epoch1/cloud_tls.laz",
        "epoch1/cloud_uav.laz",
        "epoch2/cloud_tls.laz",
        "epoch2/cloud_uav.laz",
    ];
    assert_eq!(clouds.iter().map(|c| count(c)).sum::<usize>(), summary.points);
    assert_eq!(
        count("truth/epoch2_cloud_uav_truth.laz"),
        count("epoch2/cloud_uav.laz")
    );

    // One of two photos is unaligned; the truth contains both.
    let delivered = read_cameras(&folder.path().join("epoch1/cameras_metashape.xml")).unwrap();
    let exact = read_cameras(&folder.path().join("truth/cameras_epoch1/colmap")).unwrap();
    assert_eq!((delivered.views.len(), exact.views.len()), (1, 2));

    let masks = MaskSource::open(&folder.path().join("masks/epoch1.json")).unwrap();
    let truth = MaskSource::open(&folder.path().join("truth/masks/epoch1_coco.json")).unwrap();
    let name = "IMG_1001.jpg";
    let found = masks.labels_for(name, 240, 180).unwrap().unwrap();
    let known = truth.labels_for(name, 240, 180).unwrap().unwrap();
    assert!(known.instances.len() > 8);
    assert_eq!(found.instances.len(), known.instances.len());
    let drawn = found.labels.data().iter().zip(known.labels.data());
    assert!(drawn.clone().all(|(f, k)| (*f == 0) == (*k == 0)));
    assert!(known.instances.iter().all(|i| i.stone_ref.is_some()));
    assert!(found.instances.iter().all(|i| i.stone_ref.is_none()));

    let table = fs::read_to_string(&summary.truth).unwrap();
    let header = "stone_id,cx,cy,cz,u,v,area_m2,width,height,dx,dy,dz,rx,ry,rz,loose,bgx,bgy,bgz,edge,nx,ny,nz,\
                  n_tls_1,n_tls_2,n_uav_1,n_uav_2,n_img_1,n_img_2,vis_tls,vis_uav";
    assert_eq!(table.lines().next(), Some(header));
    assert_eq!(table.lines().count(), summary.stones + 1);

    let kept: SurveyParams =
        toml::from_str(&fs::read_to_string(folder.path().join("simulation.toml")).unwrap()).unwrap();
    assert_eq!(kept, params);

    let (mut first, mut second) = (BTreeMap::new(), BTreeMap::new());
    files(folder.path(), &mut first, folder.path());
    let again = tempfile::tempdir().unwrap();
    on_threads(1, || write_survey(again.path(), &params, &Silent)).unwrap();
    files(again.path(), &mut second, again.path());
    assert_eq!(
        first.keys().collect::<Vec<_>>(),
        second.keys().collect::<Vec<_>>()
    );
    for (name, bytes) in &first {
        assert!(second[name] == *bytes, "{name} differs");
    }
}

/// Columns of a CSV file of numbers, by name.
#[allow(clippy::unwrap_used, reason = "a test may fail here")]
fn columns(path: &Path) -> BTreeMap<String, Vec<f64>> {
    let text = fs::read_to_string(path).unwrap();
    let (header, rows) = text.split_once('\n').unwrap();
    let rows: Vec<Vec<&str>> = rows.lines().map(|l| l.split(',').collect()).collect();
    let column = |i: usize| rows.iter().map(|r| r[i].parse().unwrap()).collect();
    header
        .split(',')
        .enumerate()
        .map(|(i, name)| (name.to_owned(), column(i)))
        .collect()
}

#[test]
fn stones_project_through_the_camera_files_onto_their_masks() {
    let folder = tempfile::tempdir().unwrap();
    let summary = write_survey(folder.path(), &tiny(), &Silent).unwrap();
    let stones = columns(&summary.truth);
    let (mut right, mut all) = (0, 0);
    for epoch in [1, 2] {
        let cameras = |name: &str| {
            let path = folder.path().join(format!("truth/cameras_epoch{epoch}/{name}"));
            read_cameras(&path).unwrap().views
        };
        let masks = folder.path().join(format!("truth/masks/epoch{epoch}_coco.json"));
        let masks = MaskSource::open(&masks).unwrap();
        for (metashape, colmap) in cameras("cameras_metashape.xml").iter().zip(cameras("colmap")) {
            let name = format!("{}.jpg", metashape.name);
            let known = masks.labels_for(&name, 240, 180).unwrap().unwrap();
            for (i, id) in stones["stone_id"].iter().enumerate() {
                let moved = |c: &str, d: &str| stones[c][i] + f64::from(epoch - 1) * stones[d][i];
                let centroid = Point3::new(moved("cx", "dx"), moved("cy", "dy"), moved("cz", "dz"));
                let Some(seen) = metashape.project(&centroid) else {
                    continue;
                };
                let other = colmap.project(&centroid).unwrap();
                let apart = [0, 1].map(|k| (seen.pixel[k] - other.pixel[k]).abs());
                assert!(apart[0].max(apart[1]) < 1e-4, "{name}: {apart:?} px");
                let label = known.labels.at(seen.pixel).copied().unwrap_or(0);
                let Some(mask) = known.instances.iter().find(|m| m.id == label) else {
                    continue;
                };
                all += 1;
                right += usize::from(mask.stone_ref == Some(*id as u64));
            }
        }
    }
    // The others lie behind the annex or the shrubs.
    assert!(all > 40 && right * 100 >= all * 95, "{right} of {all}");
}

/// Stops the work after some units.
struct StopAfter(AtomicU64, u64);

impl Progress for StopAfter {
    fn begin(&self, _what: &str, _total: u64) {}
    fn advance(&self, units: u64) {
        self.0.fetch_add(units, Ordering::Relaxed);
    }
    fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed) >= self.1
    }
}

#[test]
fn an_interrupted_survey_goes_on_where_it_stopped_and_others_projects_stay() {
    let folder = tempfile::tempdir().unwrap();
    let params = SurveyParams {
        masks: MaskFiles::Png,
        ..tiny()
    };
    // The scans of the first epoch and one of its two photos.
    let stopped = write_survey(folder.path(), &params, &StopAfter(AtomicU64::new(0), 2));
    assert!(
        matches!(stopped, Err(SimulateError::Interrupted(_))),
        "{stopped:?}"
    );
    assert!(!folder.path().join("stonewise.toml").exists());
    let finished = ["epoch1/cloud_tls.laz", "epoch1/images/IMG_1001.jpg"];
    let times = || {
        finished.map(|name| {
            let file = fs::metadata(folder.path().join(name)).unwrap();
            file.modified().unwrap()
        })
    };
    let before = times();
    write_survey(folder.path(), &params, &Silent).unwrap();
    assert_eq!(times(), before);
    let at_once = tempfile::tempdir().unwrap();
    write_survey(at_once.path(), &params, &Silent).unwrap();
    let (mut first, mut second) = (BTreeMap::new(), BTreeMap::new());
    files(folder.path(), &mut first, folder.path());
    files(at_once.path(), &mut second, at_once.path());
    assert_eq!(
        first.keys().collect::<Vec<_>>(),
        second.keys().collect::<Vec<_>>()
    );
    let differing: Vec<&String> = first
        .keys()
        .filter(|name| first[*name] != second[*name])
        .collect();
    assert!(differing.is_empty(), "{differing:?}");

    // Other parameters begin anew.
    let stopped = write_survey(folder.path(), &params, &StopAfter(AtomicU64::new(0), 2));
    assert!(stopped.is_err());
    let other = params.clone().seeded(5);
    write_survey(folder.path(), &other, &Silent).unwrap();
    assert_ne!(
        fs::read(folder.path().join(finished[1])).unwrap(),
        first[finished[1]]
    );

    let own = tempfile::tempdir().unwrap();
    fs::write(own.path().join("stonewise.toml"), "mine").unwrap();
    let refused = write_survey(own.path(), &params, &Silent);
    assert!(
        matches!(refused, Err(SimulateError::Occupied { .. })),
        "{refused:?}"
    );
    assert_eq!(
        fs::read_to_string(own.path().join("stonewise.toml")).unwrap(),
        "mine"
    );
}

/// Stops the work once the part of this name has begun.
struct StopIn(&'static str, AtomicBool);

impl Progress for StopIn {
    fn begin(&self, what: &str, _total: u64) {
        self.1.fetch_or(what == self.0, Ordering::Relaxed);
    }
    fn advance(&self, _units: u64) {}
    fn is_cancelled(&self) -> bool {
        self.1.load(Ordering::Relaxed)
    }
}

#[test]
fn a_survey_stops_while_its_masks_are_written_to_one_file() {
    let folder = tempfile::tempdir().unwrap();
    let params = SurveyParams {
        masks: MaskFiles::Coco,
        ..tiny()
    };
    let stop = StopIn("masks of epoch 1", AtomicBool::new(false));
    let stopped = write_survey(folder.path(), &params, &stop);
    assert!(
        matches!(stopped, Err(SimulateError::Interrupted(_))),
        "{stopped:?}"
    );
    let masks = folder.path().join("masks/epoch1.json");
    assert!(stop.is_cancelled() && !masks.exists());
    write_survey(folder.path(), &params, &Silent).unwrap();
    assert!(masks.exists());
}

#[test]
fn impossible_parameters_are_named() {
    let mut params = tiny();
    params.scene.wall.width_m = -1.0;
    let message = params.check().unwrap_err().to_string();
    assert_eq!(
        message,
        "scene.wall.width_m = -1 is not possible: a positive number is needed"
    );
}
