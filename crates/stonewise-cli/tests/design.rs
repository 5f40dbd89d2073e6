//! `design`: what it predicts from the first epoch against what a run of two epochs achieves.
#![allow(clippy::unwrap_used)] // a test that cannot go on must stop

mod support;

use serde_json::Value;
use std::fs;
use stonewise_core::statistics::median;
use stonewise_io::table::read_parquet;
use support::{run, simulated, stonewise};

/// A wall that stands still between two surveys.
const STILL: &str = r#"
name = "Still wall"
[scene]
seed = 11
[scene.wall]
width_m = 2.4
height_m = 1.6
seed = 11
[scene.tls]
spacing_m = 0.007
[photos]
columns = 2
rows = 1
width = 900
height = 700
focal_px = 1100.0
distance_m = 5.0
"#;

#[test]
fn what_is_predicted_from_one_epoch_is_achieved_with_two() {
    let (dir, survey) = simulated(STILL);
    let out = dir.path().join("results");
    let (code, text) = run(&survey, &out, &[]);
    assert!(code == 0 || code == 3, "{text}");
    // The first epoch alone.
    let project = survey.join("stonewise.toml");
    let text = fs::read_to_string(&project).unwrap();
    let second = text.rfind("[[epochs]]").unwrap();
    let rest = text[second + 1..].find("\n[").map_or("", |at| {
        let at = second + 1 + at;
        if text[at..].starts_with("\n[[epochs") {
            ""
        } else {
            &text[at..]
        }
    });
    fs::write(survey.join("first.toml"), format!("{}{rest}", &text[..second])).unwrap();
    let designed = dir.path().join("design");
    let mut command = stonewise();
    command.args(["design", "--quiet"]).arg(survey.join("first.toml"));
    let output = command.arg("--out").arg(&designed).output().unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let design: Value = serde_json::from_slice(&output.stdout).unwrap();
    let achieved = read_parquet(&out.join("stones.parquet")).unwrap();
    for (axis, name) in ["along", "up", "out"].into_iter().enumerate() {
        for (key, column) in [("sd_mm", "sd"), ("sd_deformation_mm", "sd_def")] {
            let cells = achieved.optional::<f64>(&format!("{column}_{name}")).unwrap();
            let sd_mm = 1e3 * median(&mut cells.into_iter().flatten().collect::<Vec<_>>()).unwrap();
            let ratio = design[key][axis].as_f64().unwrap() / sd_mm;
            // Points of the repetition lie where those of the first survey do: in the face less is left to chance.
            let least = if column == "sd_def" && name != "out" {
                0.5
            } else {
                0.8
            };
            assert!((least..1.25).contains(&ratio), "{key} {name}: {ratio}");
        }
        let [now, more] = ["sd_mm", "sd_with_one_more_mm"].map(|key| design[key][axis].as_f64().unwrap());
        assert!(more < now && more > 0.5 * now);
    }
    assert_eq!(
        read_parquet(&designed.join("design.parquet")).unwrap().rows() as u64,
        design["stones"][0]
    );
    assert!(designed.join("design.html").exists());
}
