//! `certify`: the figures of one simulated wall and of a survey of the user's own; ranks of drawn walls.

use crate::support::{stonewise, survey};
use serde_json::Value;
use std::fs;

#[test]
#[ignore = "a minute: .ci/nightly runs it"]
fn a_certificate_has_all_parts_and_goes_on_where_it_stopped() {
    let dir = tempfile::tempdir().unwrap();
    let certify = || {
        let mut command = stonewise();
        command.args([
            "test", "certify", "--quiet", "--walls", "1", "--seed", "3", "--out",
        ]);
        let output = command
            .arg(dir.path().join("certificate"))
            .arg(survey().join("stonewise.toml"))
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        let certificate = fs::read(dir.path().join("certificate/certificate.json")).unwrap_or_default();
        assert!(!certificate.is_empty(), "{text}");
        let certificate: Value = serde_json::from_slice(&certificate).unwrap();
        (output.status.code().unwrap(), certificate)
    };
    let (code, certificate) = certify();
    let figures = certificate["figures"].as_array().unwrap();
    // What is outside is said, too.
    assert_eq!(code, if certificate["holds"] == true { 0 } else { 3 });
    let named = |words: &str| {
        let of = figures
            .iter()
            .find(|f| f["name"].as_str().unwrap().contains(words));
        assert!(of.is_some(), "no figure {words}");
        of.unwrap()
    };
    assert_eq!(
        named("unmoved halves")["holds"],
        true,
        "{}",
        named("unmoved halves")
    );
    assert!(named("translation of")["value"].as_f64().unwrap() > 0.9);
    let (_, again) = certify();
    assert_eq!(again["figures"], certificate["figures"]);
    let page = fs::read_to_string(dir.path().join("certificate/certificate.html")).unwrap();
    assert!(page.contains("Simulated walls") && page.contains("own scans"));
}

#[test]
#[ignore = "a minute: .ci/nightly runs it"]
fn a_calibration_ranks_one_stone_of_each_wall_and_goes_on_where_it_stopped() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("certificate");
    let calibrate = || {
        let mut command = stonewise();
        let words = "test certify --calibration --sensor scanner --walls 2 --seed 4 --quiet --out";
        let output = command.args(words.split(' ')).arg(&out).output().unwrap();
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        fs::read(out.join("calibration.json")).unwrap_or_else(|e| panic!("{e}: {text}"))
    };
    let first = calibrate();
    let calibration: Value = serde_json::from_slice(&first).unwrap();
    let rows = calibration["rows"].as_array().unwrap();
    let counted = |row: &Value| {
        let counts = row["counts"].as_array().unwrap().iter();
        counts.map(|c| c.as_u64().unwrap()).sum::<u64>()
    };
    assert!(
        rows.len() >= 6 && rows.iter().all(|row| counted(row) == 2),
        "{rows:?}"
    );
    // One of the walls is drawn again.
    let wall = fs::read_dir(out.join("work/calibration"))
        .unwrap()
        .next()
        .unwrap();
    fs::remove_dir_all(wall.unwrap().path()).unwrap();
    assert_eq!(calibrate(), first);
}
