//! The command on a small simulated survey: results, resuming, threads, and every way an input can be bad.

use crate::support::{copy_of, run, stonewise, survey, survey_results, tiny_survey};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use stonewise_io::table::read_parquet;

/// Cells of a column of stones.csv.
fn column(out: &Path, name: &str) -> Vec<String> {
    let text = fs::read_to_string(out.join("stones.csv")).unwrap();
    let mut lines = text.lines();
    let at = lines.next().unwrap().split(',').position(|c| c == name).unwrap();
    lines.map(|l| l.split(',').nth(at).unwrap().to_owned()).collect()
}

#[test]
fn a_run_writes_every_result_and_resumes_to_the_same_bytes_with_any_number_of_threads() {
    let out = copy_of(survey_results());
    let files = [
        "stones.csv",
        "data/stones.parquet",
        "data/epoch1/cloud_tls.laz",
        "data/epoch2/cloud_tls.laz",
        "data/m3c2.laz",
        "data/m3c2.csv",
        "data/m3c2.csv-metadata.json",
        "report.html",
        "run.json",
        "data/audit_epoch1.csv",
        "data/audit_epoch1.csv-metadata.json",
        "data/stones.laz",
        "data/stones.vtp",
        "stones.gpkg",
        "data/evidence/crops_1_000.jpg",
        "data/evidence/sections_2.parquet",
        "data/evidence/cloud_2.parquet",
        "data/evidence/tracks_2.parquet",
        "data/evidence/track_shifts_2.parquet",
        "data/evidence/tracks_2_000.jpg",
    ];
    for file in files {
        assert!(out.path().join(file).exists(), "{file} is missing");
    }
    let ok = column(out.path(), "status").iter().filter(|s| *s == "ok").count();
    assert!(ok >= 15, "only {ok} stones were measured");

    let stones = fs::read(out.path().join("stones.csv")).unwrap();
    let cloud = fs::read(out.path().join("data/epoch1/cloud_tls.laz")).unwrap();
    fs::remove_file(out.path().join("data/epoch1/cloud_tls.laz")).unwrap();
    fs::remove_dir_all(out.path().join("work/register-2")).unwrap();
    assert_eq!(run(survey(), out.path(), &["--threads", "1"]).0, 0);
    assert_eq!(fs::read(out.path().join("stones.csv")).unwrap(), stones);
    assert_eq!(
        fs::read(out.path().join("data/epoch1/cloud_tls.laz")).unwrap(),
        cloud
    );
    let run_json: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(out.path().join("run.json")).unwrap()).unwrap();
    let step = |name: &str| {
        run_json["steps"]
            .as_array()
            .unwrap()
            .iter()
            .find(|s| s["step"] == name)
            .unwrap()
            .clone()
    };
    assert_eq!(step("label-1")["resumed"], true);
    assert_eq!(step("register-2")["resumed"], false);

    let alone = tempfile::tempdir().unwrap();
    assert_eq!(run(survey(), alone.path(), &["--threads", "1"]).0, 0);
    assert_eq!(
        fs::read(alone.path().join("stones.csv")).unwrap(),
        stones,
        "threads change the result"
    );

    // The report is made of result files alone: without the work of the run, and without the survey.
    let page = fs::read(alone.path().join("report.html")).unwrap();
    fs::remove_dir_all(alone.path().join("work")).unwrap();
    fs::remove_file(alone.path().join("report.html")).unwrap();
    stonewise().arg("report").arg(alone.path()).assert().success();
    assert!(fs::read(alone.path().join("report.html")).unwrap() == page);
}

/// Middle of each stone's mask in the crops of an epoch, metres along and up from the middle of its window.
fn mask_places(out: &Path, epoch: usize) -> BTreeMap<u32, [f64; 2]> {
    let table =
        |stem: &str| read_parquet(&out.join(format!("data/evidence/{stem}_{epoch}.parquet"))).unwrap();
    let (crops, outlines) = (table("crops"), table("crop_outlines"));
    let side: f64 = crops.metadata("side_px").unwrap().parse().unwrap();
    let ids = crops.required::<u32>("stone_id").unwrap();
    let half: BTreeMap<u32, f64> = ids
        .iter()
        .copied()
        .zip(crops.required("half_m").unwrap().iter().copied())
        .collect();
    let mut boxes: BTreeMap<u32, [f32; 4]> = BTreeMap::new();
    let (x, y) = (
        outlines.required::<f32>("x_px").unwrap(),
        outlines.required::<f32>("y_px").unwrap(),
    );
    for (i, id) in outlines.required::<u32>("stone_id").unwrap().iter().enumerate() {
        let b = boxes.entry(*id).or_insert([x[i], y[i], x[i], y[i]]);
        *b = [b[0].min(x[i]), b[1].min(y[i]), b[2].max(x[i]), b[3].max(y[i])];
    }
    let place = |(id, b): (u32, [f32; 4])| {
        let metres = |low: f32, high: f32| (f64::from(low + high) / 2.0 / side - 0.5) * 2.0 * half[&id];
        (id, [metres(b[0], b[2]), -metres(b[1], b[3])])
    };
    boxes.into_iter().map(place).collect()
}

/// The photos did not move, the points of the second half did: in its crops, which show where the first
/// half's stones were, every mask must lie farther by the motion.
fn check_crops_show_the_motion(out: &Path) {
    let (first, second) = (mask_places(out, 1), mask_places(out, 2));
    let moved = |axis: usize| {
        let mut all: Vec<f64> = first
            .iter()
            .filter_map(|(id, a)| Some(second.get(id)?[axis] - a[axis]))
            .collect();
        assert!(all.len() >= 10, "{} stones have a mask in both crops", all.len());
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    };
    let (along, up) = (moved(0), moved(1));
    // Boxes of masks of 800 x 600 photos: about a centimetre.
    assert!(
        (along - 0.02).abs() < 0.01 && (up - 0.05).abs() < 0.012,
        "{along} {up}"
    );
}

#[test]
fn a_known_motion_is_found_again_and_scored() {
    let halves = tempfile::tempdir().unwrap();
    stonewise()
        .args(["test", "split"])
        .arg(survey().join("stonewise.toml"))
        .args(["--seed", "5", "--quiet", "--out"])
        .arg(halves.path())
        .assert()
        .success();
    let project = halves.path().join("stonewise.toml");
    let text = fs::read_to_string(&project).unwrap();
    let start = text.find("# motion").unwrap();
    fs::write(&project, format!("{}{}", &text[..start], &text[start + 2..])).unwrap();
    let out = tempfile::tempdir().unwrap();
    let (code, log) = run(halves.path(), out.path(), &[]);
    assert_eq!(code, 0, "{log}");
    check_crops_show_the_motion(out.path());
    let text = fs::read_to_string(out.path().join("data/evaluation.json")).unwrap();
    let evaluation: serde_json::Value = serde_json::from_str(&text).unwrap();
    let errors = &evaluation["stones"]["errors"];
    let stones = errors["in_plane_per_axis"]["rmse_m"].as_f64().unwrap();
    // The points moved by 2 cm and 5 cm. With one photo a half, and over 1 cm between points, a tenth of that
    // is asked.
    assert!(stones < 2e-3, "{stones} m");
    let m3c2 = evaluation["m3c2"]["errors"]["in_plane_per_axis"]["rmse_m"]
        .as_f64()
        .unwrap();
    assert!(
        m3c2 > 0.02,
        "M3C2 cannot see this motion, yet misses it by {m3c2} m only"
    );
}

#[test]
fn wrong_usage_and_wrong_project_files_say_where() {
    stonewise().arg("run").assert().code(2);
    let dir = tempfile::tempdir().unwrap();
    let project = dir.path().join("stonewise.toml");
    let cases = [
        (
            "[project]\nname = \"a\"\n[[epochs]]\nname = \"1\"\ncloud = []\n",
            ":5: ",
            "unknown field `cloud`",
        ),
        ("[project]\nname = \"a\"\nepochs = []\n", ":3: ", "epochs"),
        (
            "[project]\nname = \"a\"\n[[epochs]]\nname = \"1\"\nclouds = [\"x.laz\"]\nimages = \"i\"\ncameras = \"c\"\n\
             [[epochs]]\nname = \"2\"\nclouds = [\"x.laz\"]\nimages = \"i\"\ncameras = \"c\"\n",
            ":5: ",
            "no such file or folder",
        ),
    ];
    for (text, place, message) in cases {
        fs::write(&project, text).unwrap();
        let (code, log) = run(dir.path(), &dir.path().join("out"), &[]);
        assert_eq!(code, 2, "{log}");
        assert!(log.contains(place) && log.contains(message), "{log}");
    }
}

#[test]
fn bad_inputs_are_named_and_nothing_half_written_stays() {
    type Spoil = fn(&Path);
    let cases: [(&str, Spoil, i32, &str); 8] = [
        (
            "a truncated cloud",
            |dir| {
                let path = dir.join("epoch2/cloud_tls.laz");
                let bytes = fs::read(&path).unwrap();
                fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
            },
            1,
            "cloud_tls.laz",
        ),
        (
            "a camera file without cameras",
            |dir| {
                fs::write(
                    dir.join("epoch1/cameras_metashape.xml"),
                    "<document><chunk/></document>",
                )
                .unwrap()
            },
            1,
            "cameras_metashape.xml",
        ),
        (
            "an empty photo folder",
            |dir| {
                let images = dir.join("epoch1/images");
                fs::remove_dir_all(&images).unwrap();
                fs::create_dir(&images).unwrap();
            },
            1,
            "images",
        ),
        (
            "a photo without a camera",
            |dir| {
                let images = dir.join("epoch1/images");
                let first = fs::read_dir(&images).unwrap().next().unwrap().unwrap().path();
                fs::copy(first, images.join("stray.jpg")).unwrap();
            },
            3,
            "stray.jpg",
        ),
        (
            "a mask file that is no mask file",
            |dir| {
                let path = dir.join("masks/epoch1.json");
                fs::write(path, "{\"images\": 3}").unwrap();
            },
            1,
            "epoch1.json",
        ),
        (
            "a photo whose head lies about its size",
            |dir| {
                let images = dir.join("epoch1/images");
                let first = fs::read_dir(&images).unwrap().next().unwrap().unwrap().path();
                let lie = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/hostile/lie.jpg");
                fs::copy(lie, first).unwrap();
            },
            3,
            "IMG_1001.jpg: cannot read the image",
        ),
        (
            "points strewn over 2,000 km",
            |dir| {
                let line = |i: u64| {
                    format!(
                        "{} {} {}\n",
                        i * 7919 % 2_000_000,
                        i * 104_729 % 2_000_000,
                        i % 97
                    )
                };
                fs::write(dir.join("far.xyz"), (0..60_000).map(line).collect::<String>()).unwrap();
                let path = dir.join("stonewise.toml");
                let text = fs::read_to_string(&path).unwrap();
                fs::write(&path, text.replace("epoch2/cloud_tls.laz", "far.xyz")).unwrap();
            },
            1,
            "are the coordinates in metres? Cut the cloud to the structure",
        ),
        (
            "epochs that lie apart",
            |dir| {
                fs::write(dir.join("far.xyz"), "1000 1000 0\n1001 1000 0\n1000 1001 0\n").unwrap();
                let path = dir.join("stonewise.toml");
                let text = fs::read_to_string(&path).unwrap();
                fs::write(&path, text.replace("epoch2/cloud_tls.laz", "far.xyz")).unwrap();
            },
            1,
            "do not overlap",
        ),
    ];
    for (what, spoil, expected, named) in cases {
        let survey = copy_of(tiny_survey());
        spoil(survey.path());
        let out = tempfile::tempdir().unwrap();
        let (code, log) = run(survey.path(), out.path(), &[]);
        assert_eq!(code, expected, "{what}: {log}");
        assert!(log.contains(named), "{what}: {log}");
        if expected == 1 {
            assert!(!out.path().join("stones.csv").exists(), "{what} left a result");
        }
        assert!(
            partial_files(out.path()).is_empty(),
            "{what} left {:?}",
            partial_files(out.path())
        );
    }
}

fn partial_files(dir: &Path) -> Vec<PathBuf> {
    let mut found = vec![];
    let mut open = vec![dir.to_path_buf()];
    while let Some(path) = open.pop() {
        for entry in fs::read_dir(path).unwrap().map(|e| e.unwrap().path()) {
            if entry.is_dir() {
                open.push(entry);
            } else if entry.extension().is_some_and(|e| e == "partial") {
                found.push(entry);
            }
        }
    }
    found
}

#[test]
fn init_writes_a_project_that_runs_need_no_change_in() {
    let survey = copy_of(tiny_survey());
    for folder in ["truth", "masks"] {
        fs::remove_dir_all(survey.path().join(folder)).unwrap();
    }
    fs::remove_file(survey.path().join("stonewise.toml")).unwrap();
    stonewise().arg("init").arg(survey.path()).assert().success();
    let text = fs::read_to_string(survey.path().join("stonewise.toml")).unwrap();
    for expected in [
        "epoch1/cloud_tls.laz",
        "images = \"epoch2/images\"",
        "cameras = \"epoch1/cameras_metashape.xml\"",
    ] {
        assert!(text.contains(expected), "{expected} is not in\n{text}");
    }
    stonewise().arg("init").arg(survey.path()).assert().code(2);
    // Without masks a detector is needed.
    let with_model = format!("{text}\n[segment]\nmodel = \"missing.safetensors\"\n");
    fs::write(survey.path().join("stonewise.toml"), with_model).unwrap();
    let out = tempfile::tempdir().unwrap();
    let (code, log) = run(survey.path(), out.path(), &[]);
    assert!(
        code == 2 && log.contains("no such file") && log.contains("missing.safetensors"),
        "{log}"
    );
}

#[test]
fn clouds_alone_can_be_compared() {
    let out = tempfile::tempdir().unwrap();
    let clouds = [1, 2].map(|e| survey().join(format!("epoch{e}/cloud_tls.laz")));
    for command in ["m3c2", "c2c"] {
        stonewise()
            .args(["compare", command])
            .args(&clouds)
            .arg("--out")
            .arg(out.path())
            .assert()
            .success();
        assert!(out.path().join(format!("{command}.laz")).exists());
    }
}
