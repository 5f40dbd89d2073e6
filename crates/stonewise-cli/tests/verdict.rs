//! The verdict of a run: in verdict.json, run.json, the log, the report and the exit code.
#![allow(clippy::unwrap_used)] // a test that cannot go on must stop

mod support;

use serde_json::Value;
use std::fs;
use std::path::Path;
use support::{copy_of, run, survey};

fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// The survey with more lines at the end of its project file and a second epoch that is the first, moved by 3 cm.
fn moved_survey(lines: &str) -> tempfile::TempDir {
    let dir = copy_of(survey());
    let path = dir.path().join("stonewise.toml");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, format!("{text}\n{lines}")).unwrap();
    dir
}

#[test]
fn the_same_verdict_stands_everywhere_and_decides_the_exit_code() {
    // The simulated wall moved by centimetres: beyond 0.1 mm, and far below 10 m. Its registration is stated to be exact.
    let lines = "[report]\noperator = \"Ruhr <River> Authority\"\nreference_number = \"T-17\"\n[thresholds]\nattention_mm = 0.1\nalarm_mm = 0.2\n";
    let dir = moved_survey(lines);
    let out = tempfile::tempdir().unwrap();
    let (code, log) = run(dir.path(), out.path(), &["--exit-on", "alarm"]);
    let verdict = json(&out.path().join("verdict.json"));
    assert_eq!((code, &verdict["state"]), (4, &Value::from("alarm")), "{log}\n{}", verdict["sentence"]);
    let sentence = verdict["sentence"].as_str().unwrap();
    assert!(sentence.starts_with("Alarm: "), "{sentence}");
    assert!(log.contains(sentence), "{log}");
    let record = json(&out.path().join("run.json"));
    assert_eq!(record["verdict"]["sentence"], verdict["sentence"]);
    assert_eq!(record["parameters"]["thresholds"]["alarm_mm"], 0.2);
    let page = fs::read_to_string(out.path().join("report/index.html")).unwrap();
    assert!(page.contains(sentence) && page.contains("Ruhr &lt;River&gt; Authority"));
    let epoch = &verdict["epochs"][0];
    let stones = fs::read_to_string(out.path().join("stones.csv")).unwrap();
    assert_eq!(epoch["stones"].as_array().unwrap().len(), stones.lines().count() - 1);
    assert_eq!(epoch["wall"]["state"], "alarm");

    // The same results without the wish for an exit code; and with thresholds that nothing reaches.
    assert_eq!(run(dir.path(), out.path(), &[]).0, 0);
    let path = dir.path().join("stonewise.toml");
    let text = fs::read_to_string(&path).unwrap();
    let text = text.replace("attention_mm = 0.1\nalarm_mm = 0.2", "attention_mm = 9000.0");
    fs::write(&path, &text).unwrap();
    // Nothing is known about the registration: a common motion of any size would not show.
    let (code, log) = run(dir.path(), out.path(), &["--exit-on", "attention"]);
    assert_eq!(code, 3, "{log}");
    assert!(log.contains("Cannot tell: the registration error between the surveys is unknown"), "{log}");
    fs::write(&path, format!("{text}\n[registration]\nepoch_error_m = 0.001\n")).unwrap();
    let (code, log) = run(dir.path(), out.path(), &["--exit-on", "attention"]);
    assert!(code == 0 && log.contains("Fine: none of the "), "{code} {log}");
}

#[test]
fn impossible_thresholds_and_logos_are_named_with_their_line() {
    for (lines, words) in [
        ("[thresholds]\nattention_mm = 10.0\nalarm_mm = 5.0", "attention_mm = 10 in [thresholds] must be below alarm_mm = 5"),
        ("[thresholds]\nalarm_mm = -1.0", "alarm_mm = -1 in [thresholds] is not possible"),
        ("[thresholds]\nalarm = 1.0", "unknown field `alarm`"),
        ("[report]\nlogo = \"none.png\"", "no such file or folder"),
        ("[report]\nlogo = \"stonewise.toml\"", "is neither .png nor .jpg"),
        ("[report]\nlanguage = \"fr\"", "unknown variant `fr`"),
    ] {
        let dir = moved_survey(lines);
        let out = tempfile::tempdir().unwrap();
        let (code, log) = run(dir.path(), out.path(), &[]);
        assert_eq!(code, 2, "{log}");
        assert!(log.contains(words) && log.contains("stonewise.toml:"), "{log}");
    }
}
