//! Surveys without photos: two scans and one command.

use crate::support::{outcome, stonewise, survey};
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
        epoch["photos"].as_u64() >= Some(5) && epoch["stones"].as_u64() > Some(5),
        "{epoch}"
    );
    let report = fs::read_to_string(results.join("report/index.html")).unwrap();
    assert!(report.contains("views of the cloud"));

    let truth = survey().join("truth/stones.csv");
    let (_, _) = outcome(
        stonewise()
            .arg("evaluate")
            .arg(&results)
            .arg("--truth")
            .arg(truth),
    );
    let scores = json(&results.join("evaluation_truth.json"));
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
fn one_scan_is_wrong_usage_and_other_scans_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let scans = ["a.xyz", "b.xyz", "c.xyz"].map(|name| dir.path().join(name));
    for scan in &scans {
        fs::write(scan, "0 0 0\n").unwrap();
    }
    let out = dir.path().join("results");
    let (code, log) = outcome(stonewise().arg("run").arg(&scans[0]).arg("--out").arg(&out));
    assert!(
        code != 0 && log.contains("a single scan shows no motion"),
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
