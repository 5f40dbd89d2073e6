//! The verdict of a run: in verdict.json, run.json, the log, the report and the exit code.

use crate::support::{copy_of, outcome, run, stonewise, survey};
use serde_json::Value;
use std::fs;
use std::path::Path;

fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// The survey with more lines at the end of its project file, which is within the table of the second epoch.
fn survey_with(lines: &str) -> tempfile::TempDir {
    let dir = copy_of(survey());
    let path = dir.path().join("stonewise.toml");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, format!("{text}\n{lines}")).unwrap();
    dir
}

/// Changes the project file of a survey.
fn edit(survey: &Path, from: &str, to: &str) {
    let path = survey.join("stonewise.toml");
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{text}");
    fs::write(&path, text.replace(from, to)).unwrap();
}

/// Every step has a line with its place, in order, and no line is said twice.
fn check_progress(log: &str) {
    let lines: Vec<&str> = log.lines().filter(|l| l.starts_with('[')).collect();
    let texts: Vec<&str> = lines
        .iter()
        .filter_map(|l| Some(l.split_once(" s] ")?.1))
        .collect();
    assert_eq!(texts.len(), lines.len(), "{log}");
    let mut places = Vec::new();
    for (i, text) in texts.iter().enumerate() {
        assert!(!texts[..i].contains(text), "said twice: {text}");
        let (place, of) = text.split(' ').next().unwrap().split_once('/').unwrap();
        places.push((place.parse::<usize>().unwrap(), of.parse::<usize>().unwrap()));
    }
    assert!(places.is_sorted(), "{places:?}");
    let all = places.last().unwrap().1;
    let named: std::collections::BTreeSet<usize> = places.iter().map(|p| p.0).collect();
    assert!(named.into_iter().eq(1..=all), "{log}");
    assert_eq!(all, 6);
}

#[test]
fn the_same_verdict_stands_everywhere_and_decides_the_exit_code() {
    // The simulated wall stands still; its points are moved by 5.4 cm.
    let lines = "motion = { kind = \"translation\", d = [0.0, 0.02, 0.05] }\n\
        [report]\noperator = \"Ruhr <River> Authority\"\n[thresholds]\nattention_mm = 5.0\nalarm_mm = 10.0\n";
    let dir = survey_with(lines);
    let out = tempfile::tempdir().unwrap();
    let (code, log) = run(dir.path(), out.path(), &["--exit-on", "alarm"]);
    assert_eq!(code, 4, "{log}");
    let verdict = json(&out.path().join("verdict.json"));
    let sentence = verdict["sentence"].as_str().unwrap();
    assert!(
        sentence.starts_with("Alarm: ") && sentence.contains("beyond the alarm threshold of 10 mm"),
        "{sentence}"
    );
    // The last thing that a person reads.
    assert_eq!(log.trim_end().lines().last(), Some(sentence), "{log}");
    check_progress(&log);
    let record = json(&out.path().join("run.json"));
    assert_eq!(
        (&record["verdict"]["sentence"], &record["verdict"]["state"]),
        (&verdict["sentence"], &verdict["state"])
    );
    assert_eq!(record["parameters"]["thresholds"]["alarm_mm"], 10.0);
    let page = fs::read_to_string(out.path().join("report.html")).unwrap();
    let page = page.replace('\u{a0}', " ");
    assert!(page.contains(sentence) && page.contains("Ruhr &lt;River&gt; Authority"));
    let epoch = &verdict["epochs"][0];
    let stones = fs::read_to_string(out.path().join("stones.csv")).unwrap();
    assert_eq!(
        epoch["stones"].as_array().unwrap().len(),
        stones.lines().count() - 1
    );
    let largest = epoch["wall"]["largest"]["length_mm"].as_f64().unwrap();
    assert!((largest - 53.9).abs() < 3.0, "{largest}");
    // Nobody asked for an exit code; then the thresholds are out of reach.
    assert_eq!(run(dir.path(), out.path(), &[]).0, 0);
    edit(
        dir.path(),
        "attention_mm = 5.0\nalarm_mm = 10.0",
        "attention_mm = 9000.0",
    );
    let (code, log) = run(dir.path(), out.path(), &["--exit-on", "attention"]);
    assert!(code == 0 && log.contains("Fine: none of the "), "{code} {log}");
    check_refusals(out.path());
    check_pdf(out.path());
}

/// Prints the report with this browser; the usual one where none is named.
fn print(results: &Path, pdf: &Path, browser: Option<&Path>, extra: &[&str]) -> (i32, String) {
    let mut command = stonewise();
    command
        .arg("report")
        .arg(results)
        .arg("--pdf")
        .arg(pdf)
        .args(extra);
    if let Some(browser) = browser {
        command.env("STONEWISE_BROWSER", browser);
    }
    outcome(&mut command)
}

/// A browser that fails or is not there leaves everything as it was.
fn check_refusals(results: &Path) {
    let folder = tempfile::tempdir().unwrap();
    let pdf = folder.path().join("report.pdf");
    let (code, log) = print(results, &pdf, Some(&folder.path().join("none")), &[]);
    assert!(
        code == 1 && log.contains("give the program of Chromium, Chrome or Edge"),
        "{log}"
    );
    fs::write(&pdf, "mine").unwrap();
    let (code, log) = print(results, &pdf, None, &[]);
    assert!(
        code == 2 && log.contains("was not made by `stonewise report`"),
        "{log}"
    );
    // A program that ends well and prints nothing.
    let (code, log) = print(results, &pdf, Some(Path::new("/bin/true")), &["--force"]);
    assert!(
        cfg!(not(unix)) || (code == 1 && log.contains("printed no PDF")),
        "{log}"
    );
    assert_eq!(fs::read(&pdf).unwrap(), b"mine");
    assert_eq!(
        fs::read_dir(folder.path()).unwrap().count(),
        1,
        "something was left"
    );
    let (code, log) = print(results, &folder.path().join("no/report.pdf"), None, &[]);
    assert!(code == 2 && log.contains("does not exist"), "{log}");
}

/// The PDF is whole, is printed again over itself, and is shorter without its appendix.
fn check_pdf(results: &Path) {
    let folder = tempfile::tempdir().unwrap();
    let pdf = folder.path().join("report.pdf");
    let (code, log) = print(results, &pdf, None, &[]);
    if log.contains("none is installed") {
        assert_eq!(code, 1);
        println!("skipped: no browser prints PDF here");
        return;
    }
    let pages = |path: &Path| {
        let bytes = fs::read(path).unwrap();
        assert!(bytes.starts_with(b"%PDF-"));
        // Every page is an object of its own (ISO 32000-1, 7.7.3.3).
        let is_page = |w: &[u8]| w.starts_with(b"/Type /Page") && !w.ends_with(b"s");
        bytes.windows(12).filter(|w| is_page(w)).count()
    };
    assert_eq!(code, 0, "{log}");
    let all = pages(&pdf);
    let (code, log) = print(results, &pdf, None, &["--no-appendix"]);
    assert_eq!(code, 0, "{log}");
    assert!(pages(&pdf) >= 3 && pages(&pdf) < all, "{} of {all}", pages(&pdf));
    assert_eq!(
        fs::read_dir(folder.path()).unwrap().count(),
        1,
        "something was left"
    );
}

#[test]
fn where_nothing_is_known_about_the_registration_the_results_cannot_tell() {
    let dir = survey_with("[thresholds]\nattention_mm = 5.0\n");
    edit(dir.path(), "name = \"epoch", "sources = \"none\"\nname = \"epoch");
    let out = tempfile::tempdir().unwrap();
    let (code, log) = run(dir.path(), out.path(), &["--exit-on", "alarm"]);
    assert_eq!(code, 3, "{log}");
    let sentence = "Cannot tell: the registration error between the surveys is unknown, so a motion of the wall as a whole would not show";
    assert!(log.contains(sentence), "{log}");
    assert_eq!(
        json(&out.path().join("verdict.json"))["epochs"][0]["reasons"][0]["code"],
        "datum_unknown"
    );
    // The same test can be made from the files alone: the common motion is in registration.json.
    let common = &json(&out.path().join("data/registration.json"))["datum"]["common_motion"];
    assert_eq!(common.as_array().unwrap().len(), 6);
    assert_eq!(run(dir.path(), out.path(), &[]).0, 0);
}

#[test]
fn impossible_thresholds_and_logos_are_named_with_their_line() {
    for (lines, words) in [
        (
            "[thresholds]\nattention_mm = 10.0\nalarm_mm = 5.0",
            "thresholds.attention_mm = 10 is not possible: it must be below alarm_mm = 5",
        ),
        (
            "[thresholds]\nalarm_mm = -1.0",
            "thresholds.alarm_mm = -1 is not possible: it must be above 0",
        ),
        ("[thresholds]\nalarm = 1.0", "unknown field `alarm`"),
        ("[report]\nlogo = \"none.png\"", "no such file or folder"),
        ("[report]\nlogo = \"stonewise.toml\"", "is neither .png nor .jpg"),
        ("[report]\nlanguage = \"it\"", "unknown variant `it`"),
        (
            "[report]\nprofile = \"din1970\"",
            "or name a profile of the program: plain, din19700",
        ),
    ] {
        let dir = survey_with(lines);
        let out = tempfile::tempdir().unwrap();
        let (code, log) = run(dir.path(), out.path(), &[]);
        assert_eq!(code, 2, "{log}");
        assert!(log.contains(words) && log.contains("stonewise.toml:"), "{log}");
    }
}
