//! A run in units, in any order, with units that are killed or done twice: the same bytes as `run`.

use crate::support::{Dice, contents, copy_of, outcome, run, stonewise, survey};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use std::time::Duration;
use tempfile::TempDir;

/// Result files with their bytes, but for those that hold times, and what is stonewise's own.
fn results(out: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    contents(out, &["work", "run.json", "data/digests.b3", "report.html"])
        .into_iter()
        .collect()
}

/// The small survey cut into several tiles; the detector has to find the stones of the second epoch.
fn tiled() -> &'static Path {
    static SURVEY: OnceLock<TempDir> = OnceLock::new();
    let survey = SURVEY.get_or_init(|| {
        let survey = copy_of(survey());
        let project = survey.path().join("stonewise.toml");
        let text = fs::read_to_string(&project).unwrap();
        let last_masks = text.rfind("\nmasks").unwrap();
        let (before, masks) = text.split_at(last_masks + 1);
        let after = masks.split_once('\n').unwrap().1;
        fs::write(&project, format!("{before}{after}\n[ingest]\nsize_m = 0.5\n")).unwrap();
        survey
    });
    survey.path()
}

/// What `run` makes of it.
fn reference() -> &'static BTreeMap<PathBuf, Vec<u8>> {
    static RESULTS: OnceLock<BTreeMap<PathBuf, Vec<u8>>> = OnceLock::new();
    RESULTS.get_or_init(|| {
        let out = tempfile::tempdir().unwrap();
        let (code, log) = run(tiled(), out.path(), &[]);
        assert!([0, 3].contains(&code), "{log}");
        results(out.path())
    })
}

fn plan_command(survey: &Path, out: &Path) -> assert_cmd::Command {
    let mut command = stonewise();
    command.args(["run", "--plan"]).arg(survey.join("stonewise.toml"));
    command.arg("--out").arg(out);
    command
}

/// Plans a survey.
fn plan(survey: &Path, out: &Path) -> Value {
    let output = plan_command(survey, out).output().unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    serde_json::from_slice(&output.stdout).unwrap()
}

fn strings(list: &Value) -> BTreeSet<String> {
    let all = list.as_array().unwrap().iter();
    all.map(|s| s.as_str().unwrap().to_owned()).collect()
}

fn needs(plan: &Value) -> BTreeMap<String, BTreeSet<String>> {
    let units = plan["units"].as_array().unwrap().iter();
    units
        .map(|u| (u["id"].as_str().unwrap().to_owned(), strings(&u["needs"])))
        .collect()
}

fn unit(out: &Path, id: &str) -> (i32, String) {
    outcome(
        stonewise()
            .args(["run", "--unit", id, "--threads", "1", "--out"])
            .arg(out),
    )
}

/// Begins a unit and kills it after a while.
fn kill(out: &Path, id: &str, after: Duration) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_stonewise"))
        .args(["run", "--unit", id, "--out"])
        .arg(out)
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    std::thread::sleep(after);
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn units_in_any_order_killed_and_repeated_give_the_bytes_of_a_run() {
    let out = tempfile::tempdir().unwrap();
    let planned = plan(tiled(), out.path());
    assert_eq!(planned["version"], 2);
    let needs = needs(&planned);
    let photos = planned["units"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|u| u["photo"].is_number());
    let photos: Vec<&str> = photos.map(|u| u["id"].as_str().unwrap()).collect();
    assert_eq!(photos, ["segment-2.00000", "segment-2.00001"]);
    let of_photos = |id: &&String| id.contains('.');
    assert_eq!(needs.keys().filter(of_photos).count(), 2, "{:?}", needs.keys());
    let mut dice = Dice(5);
    let mut done: BTreeSet<String> = BTreeSet::new();
    while done.len() < needs.len() {
        let open = needs.iter().filter(|(id, _)| !done.contains(*id));
        let (ready, early): (Vec<_>, Vec<_>) = open.partition(|(_, needs)| needs.is_subset(&done));
        if dice.below(6) == 0 && !early.is_empty() {
            let (id, needs) = early[dice.below(early.len())];
            let (code, log) = unit(out.path(), id);
            let missing: Vec<&str> = needs.difference(&done).map(String::as_str).collect();
            assert_eq!(code, 1, "{id}: {log}");
            let said = missing.iter().all(|first| log.contains(first));
            assert!(said && log.contains(&format!("unit {id} needs")), "{log}");
        }
        let id = ready[dice.below(ready.len())].0.clone();
        if dice.below(3) == 0 {
            kill(out.path(), &id, Duration::from_millis(dice.below(400) as u64));
        }
        let (code, log) = unit(out.path(), &id);
        // The last one ends as a run does.
        assert!(code == 0 || (code == 3 && id == "report"), "{id}: {log}");
        let note = out.path().join("work/units").join(format!("{id}.json"));
        assert!(note.exists(), "{id} left no output");
        if dice.below(4) == 0 {
            let (code, log) = unit(out.path(), &id);
            assert!(code == 0 && log.contains("was done"), "{log}");
        }
        done.insert(id);
    }
    let (found, expected) = (results(out.path()), reference());
    let differ = |name: &&PathBuf| found.get(*name) != expected.get(*name);
    let differing: Vec<&PathBuf> = found.keys().chain(expected.keys()).filter(differ).collect();
    assert!(
        differing.is_empty(),
        "other bytes than those of a run: {differing:?}"
    );
    let record: Value = serde_json::from_slice(&fs::read(out.path().join("run.json")).unwrap()).unwrap();
    for step in record["steps"].as_array().unwrap() {
        let (wall, processor) = (&step["seconds"], &step["processor_seconds"]);
        assert!(
            wall.is_f64() && (processor.is_f64() || cfg!(not(target_os = "linux"))),
            "{step}"
        );
    }
    let again = plan(tiled(), out.path());
    assert!(
        again["units"]
            .as_array()
            .unwrap()
            .iter()
            .all(|u| u["done"] == true)
    );
    assert!(
        results(out.path()) == *reference(),
        "a plan of what is done changed it"
    );
}

/// A folder in which the first units were done.
fn begun(survey: &Path) -> TempDir {
    let out = tempfile::tempdir().unwrap();
    let planned = plan(survey, out.path());
    let has = |id: &&str| {
        planned["units"]
            .as_array()
            .unwrap()
            .iter()
            .any(|unit| unit["id"] == *id)
    };
    // Photos are chosen where there are no masks.
    for id in ["ingest-1", "ingest-2", "choose-1", "choose-2"]
        .into_iter()
        .filter(has)
    {
        let (code, log) = unit(out.path(), id);
        assert_eq!(code, 0, "{log}");
    }
    out
}

#[test]
fn the_same_unit_twice_at_once_and_a_run_afterwards_leave_the_bytes_of_a_run() {
    let out = begun(tiled());
    let units = [0, 1].map(|_| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_stonewise"));
        command
            .args(["run", "--unit", "segment-2.00000", "--out"])
            .arg(out.path());
        command.stderr(Stdio::null()).spawn().unwrap()
    });
    for mut unit in units {
        assert!(unit.wait().unwrap().success());
    }
    let (code, log) = run(tiled(), out.path(), &[]);
    assert!([0, 3].contains(&code), "{log}");
    assert!(results(out.path()) == *reference());
    let (code, log) = unit(out.path(), "segment-2");
    assert!(
        code == 2 && log.contains("stonewise run") && log.contains("--plan"),
        "{log}"
    );
}

#[test]
fn a_plan_holds_for_its_inputs_only_and_keeps_what_is_done() {
    let survey = copy_of(survey());
    let out = begun(survey.path());
    let (code, log) = unit(out.path(), "no-such-unit");
    assert!(code == 2 && log.contains("no-such-unit"), "{log}");

    let planned = plan(survey.path(), out.path());
    let done = planned["units"].as_array().unwrap().iter();
    let done: BTreeSet<&str> = done
        .filter(|u| u["done"] == true)
        .map(|u| u["id"].as_str().unwrap())
        .collect();
    assert_eq!(done, BTreeSet::from(["ingest-1", "ingest-2"]));
    // What is lost is made again by the unit that needs it.
    fs::remove_dir_all(out.path().join("work/ingest-2")).unwrap();
    for id in ["segment-2", "label-2"] {
        let (code, log) = unit(out.path(), id);
        assert_eq!(code, 0, "{log}");
    }
    assert!(out.path().join("work/ingest-2").exists());

    let file = out.path().join("work/plan.json");
    let text = fs::read_to_string(&file).unwrap();
    fs::write(&file, text.replacen("\"version\": 2", "\"version\": 1", 1)).unwrap();
    let (code, log) = unit(out.path(), "ingest-2");
    assert!(
        code == 2 && log.contains("of version 1") && log.contains("run `stonewise run --plan` again"),
        "{log}"
    );
    let (code, log) = outcome(plan_command(survey.path(), out.path()).args(["--batch-points", "20000"]));
    assert!(code == 2 && log.contains("whole step"), "{log}");

    // A machine that adds in other lanes.
    let processor = planned["processor"].as_str().unwrap();
    fs::write(&file, text.replacen(processor, "vax", 1)).unwrap();
    let (code, log) = unit(out.path(), "ingest-2");
    assert!(
        code == 2 && log.contains("\"vax\"") && log.contains("one class"),
        "{log}"
    );
    fs::write(&file, text).unwrap();

    let project = survey.path().join("stonewise.toml");
    let text = fs::read_to_string(&project).unwrap();
    fs::write(&project, format!("{text}\n[match]\nmax_ratio = 0.5\n")).unwrap();
    let (code, log) = unit(out.path(), "ingest-2");
    assert!(
        code == 2 && log.contains("changed") && log.contains("stonewise.toml"),
        "{log}"
    );
    let planned = plan(survey.path(), out.path());
    assert!(
        planned["units"]
            .as_array()
            .unwrap()
            .iter()
            .all(|u| u["done"] == false)
    );
}

/// Photos among the inputs of a plan.
fn photos_of(plan: &Value) -> usize {
    let inputs = plan["inputs"].as_array().unwrap().iter();
    inputs
        .filter(|i| i["path"].as_str().unwrap().ends_with(".jpg"))
        .count()
}

#[test]
fn photos_in_which_stones_are_tracked_are_inputs_of_the_plan_beside_masks() {
    let survey = copy_of(survey());
    let out = tempfile::tempdir().unwrap();
    // Two photos an epoch.
    assert_eq!(photos_of(&plan(survey.path(), out.path())), 4);
    let images = survey.path().join("epoch2/images");
    let photo = fs::read_dir(&images).unwrap().next().unwrap().unwrap().path();
    let mut bytes = fs::read(&photo).unwrap();
    bytes.push(0);
    fs::write(&photo, bytes).unwrap();
    let (code, log) = unit(out.path(), "ingest-1");
    let name = photo.file_name().unwrap().to_string_lossy();
    assert!(
        code == 2 && log.contains(&*name) && log.contains("stonewise run") && log.contains("--plan"),
        "{log}"
    );

    let project = survey.path().join("stonewise.toml");
    let text = fs::read_to_string(&project).unwrap();
    fs::write(
        &project,
        format!("{text}\n[registration.photos]\nenabled = false\n"),
    )
    .unwrap();
    assert_eq!(photos_of(&plan(survey.path(), out.path())), 0);
}
