//! Surveys without photos: two scans and one command.

use crate::support::stones::{number, rows};
use crate::support::{copy_of, outcome, stonewise, survey, tiny_survey};
use serde_json::Value;
use std::fs;
use std::path::Path;

fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// The scans of the simulated wall, which have no colours and no intensities, give stones and their motions.
#[test]
fn two_scans_alone_are_run_and_scored_against_the_truth() {
    let out = tempfile::tempdir().unwrap();
    let results = out.path().join("results");
    let scans = ["epoch1", "epoch2"].map(|e| survey().join(e).join("cloud_tls.laz"));
    let run = || {
        let mut command = stonewise();
        command.arg("run").args(&scans).arg("--out").arg(&results);
        outcome(&mut command)
    };
    let (code, log) = run();
    assert_eq!(code, 0, "{log}");
    assert!(log.contains("views of the cloud's relief"), "{log}");
    let record = json(&results.join("run.json"));
    let epoch = &record["epochs"][0];
    assert!(epoch["cameras"].is_null() && epoch["images"].is_null(), "{epoch}");
    assert!(
        epoch["photo_count"].as_u64() >= Some(5) && epoch["stones"].as_u64() > Some(5),
        "{epoch}"
    );
    let report = fs::read_to_string(results.join("report.html")).unwrap();
    assert!(report.contains("views of the cloud"));

    let truth = survey().join("truth/stones.csv");
    let (_, _) = outcome(
        stonewise()
            .arg("evaluate")
            .arg(&results)
            .arg("--truth")
            .arg(truth),
    );
    let scores = json(&results.join("data/evaluation_truth.json"));
    let motions = &scores["external"]["motions"];
    assert!(motions["estimated"].as_u64() > Some(5), "{motions}");
    let error = &motions["errors_without_datum"]["norm_3d"]["median_m"];
    assert!(error.as_f64().unwrap() < 0.001, "{error}");

    // The same command takes everything over.
    let stones = fs::read(results.join("stones.csv")).unwrap();
    let (_, log) = run();
    assert_eq!(fs::read(results.join("stones.csv")).unwrap(), stones, "{log}");
    let record = json(&results.join("run.json"));
    let views = record["steps"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|s| s["step"] == "views-1");
    assert!(views.map(|s| s["resumed"].clone()).all(|r| r == true), "{log}");
}

#[test]
fn views_beside_photos_show_stones_and_track_none() {
    let survey = copy_of(tiny_survey());
    let epoch = |number: u8| {
        format!(
            "[[epochs]]\nname = \"{number}\"\nclouds = [\"epoch{number}/cloud_tls.laz\"]\n\
             images = \"epoch{number}/images\"\ncameras = \"epoch{number}/cameras_metashape.xml\"\n"
        )
    };
    let project = survey.path().join("beside.toml");
    let lines = format!(
        "{}{}[views]\nbeside_photos = true\n[project]\nname = \"Both\"\n",
        epoch(1),
        epoch(2)
    );
    fs::write(&project, lines).unwrap();
    let results = survey.path().join("results");
    let (code, log) = outcome(stonewise().arg("run").arg(&project).arg("--out").arg(&results));
    assert!(code == 0 || code == 3, "{code}: {log}");

    let record = json(&results.join("run.json"));
    assert_eq!(record["epochs"][0]["photo_count"], 2);
    let audit = fs::read_to_string(results.join("data/audit_epoch1.csv")).unwrap();
    assert!(audit.contains("view_001.png"), "{audit}");
    let stones = rows(&results.join("stones.csv"));
    let shown = stones.values().map(|row| number(row, "photos"));
    assert!(shown.fold(0.0, f64::max) > 2.0, "{stones:?}");
    let registration = json(&results.join("data/registration.json"));
    let tracked = registration["photos"]["poses_px"].as_array().unwrap();
    assert!(
        !tracked.is_empty() && !registration["photos"].to_string().contains("view_"),
        "{registration}"
    );
}

/// Where views have too many pixels, pixels grow until the stones of a first look are 10 pixels across. The bounds are
/// wide because the first look also finds parts of stones and of the hut.
#[test]
fn pixels_of_views_fit_the_stones() {
    let out = tempfile::tempdir().unwrap();
    let project = out.path().join("stonewise.toml");
    let scan = |epoch: u8| survey().join(format!("epoch{epoch}/cloud_tls.laz"));
    let lines = format!(
        "[project]\nname = \"Large\"\n[views]\nmegapixels = 0.05\nstone_px = 10.0\n\
         [[epochs]]\nname = \"1\"\nclouds = [{:?}]\n[[epochs]]\nname = \"2\"\nclouds = [{:?}]\n",
        scan(1),
        scan(2)
    );
    fs::write(&project, lines).unwrap();
    let results = out.path().join("results");
    let (code, log) = outcome(
        stonewise()
            .args(["detector", "segment"])
            .arg(&project)
            .arg("--out")
            .arg(&results),
    );
    assert_eq!(code, 0, "{log}");
    let step = fs::read_dir(results.join("work/views-1"))
        .unwrap()
        .next()
        .unwrap()
        .unwrap();
    let cameras = fs::read_to_string(step.path().join("cameras.xml")).unwrap();
    let focal_px = cameras
        .split("<f>")
        .skip(1)
        .map(|f| f.split('<').next().unwrap().parse::<f64>().unwrap());
    // Seen from 12 m where nothing hides the wall.
    let pixel_m = 12.0 / focal_px.fold(0.0, f64::max);

    let truth = rows(&survey().join("truth/stones.csv"));
    let seen = truth.values().filter(|row| number(row, "vis_tls") > 0.35);
    let mut sizes_m: Vec<f64> = seen.map(|row| number(row, "area_m2").sqrt()).collect();
    sizes_m.sort_by(f64::total_cmp);
    let across_px = sizes_m[sizes_m.len() / 4] / pixel_m;
    assert!(
        (7.0..20.0).contains(&across_px),
        "{across_px} pixels of {pixel_m} m"
    );
    // 0.6 times the distance between points.
    assert!(pixel_m > 2.0 * 0.6 * 0.008, "{pixel_m}");
}

#[test]
fn one_scan_is_wrong_usage_and_other_scans_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let scans = ["a.xyz", "b.xyz", "c.xyz"].map(|name| dir.path().join(name));
    for scan in &scans {
        fs::write(scan, "0 0 0\n").unwrap();
    }
    let out = dir.path().join("results");
    let (code, log) = outcome(stonewise().arg("run").arg(&scans[0]).arg("--out").arg(&out));
    assert!(
        code == 2 && log.contains("a single scan shows no motion"),
        "{log}"
    );
    fs::create_dir(&out).unwrap();
    fs::write(
        out.join("stonewise.toml"),
        "[project]\nname = \"x\"\n[[epochs]]\nname = \"a\"\nclouds = [\"../a.xyz\"]\n[[epochs]]\nname = \"c\"\nclouds = [\"../c.xyz\"]\n",
    )
    .unwrap();
    let (code, log) = outcome(stonewise().arg("run").args(&scans[..2]).arg("--out").arg(&out));
    assert!(code != 0 && log.contains("the project of other scans"), "{log}");
}
