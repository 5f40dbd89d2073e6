//! What a run may do to files that are there: inputs, other people's, those of earlier and of broken-off
//! runs.

use crate::support::{contents, copy_of, outcome, run, stonewise, tiny_results, tiny_survey};
use std::fs::{self, File};
use std::path::Path;

/// What a run writes that may differ between two runs: times, with the digests of the files that hold them, and what
/// only resuming needs.
const NOT_COMPARED: [&str; 3] = ["run.json", "data/digests.b3", "work"];

/// Results of a run. The report and all else but `run.json` depend on the inputs alone, except for times in
/// the report.
fn results(out: &Path) -> Vec<(std::path::PathBuf, Vec<u8>)> {
    let mut all = contents(out, &NOT_COMPARED);
    all.retain(|(name, _)| name != Path::new("report.html"));
    all
}

#[test]
fn inputs_are_never_written_over() {
    let survey = copy_of(tiny_survey());
    let before = contents(survey.path(), &[]);
    for extra in [&[][..], &["--force"]] {
        let (code, log) = run(survey.path(), survey.path(), extra);
        assert_eq!(code, 2, "{log}");
        assert!(
            log.contains("written over the input") && log.contains("cloud_tls.laz"),
            "{log}"
        );
    }
    let inside = survey.path().join("epoch1/images/results");
    let (code, log) = run(survey.path(), &inside, &[]);
    assert!(code == 2 && log.contains("inside the folder of inputs"), "{log}");
    assert!(contents(survey.path(), &[]) == before, "something was written");
}

#[test]
fn a_results_folder_that_cannot_be_made_is_said() {
    let survey = copy_of(tiny_survey());
    let below_a_file = survey.path().join("stonewise.toml/results");
    let (code, log) = run(survey.path(), &below_a_file, &[]);
    assert_eq!(code, 1, "{log}");
    assert!(
        log.contains("creating the results folder failed") && log.contains("stonewise.toml/results"),
        "{log}"
    );
}

#[test]
fn an_experiment_writes_nothing_before_its_projects_are_read_and_never_over_their_inputs() {
    let survey = copy_of(tiny_survey());
    let experiment = |project: &Path, out: &Path| {
        let mut command = stonewise();
        command
            .args(["test", "experiment", "paper", "--force", "--out"])
            .arg(out);
        outcome(command.arg(project))
    };
    let (project, out) = (survey.path().join("stonewise.toml"), survey.path().join("paper"));
    fs::write(survey.path().join("wrong.toml"), "[[epochs]]\nname = \"A\"\n").unwrap();
    let (code, log) = experiment(&survey.path().join("wrong.toml"), &out);
    assert!(code == 2 && log.contains("missing field"), "{log}");
    assert!(!out.exists());

    let before = contents(survey.path(), &[]);
    let (code, log) = experiment(&project, &survey.path().join("epoch1/images/paper"));
    assert!(code == 2 && log.contains("inside the folder of inputs"), "{log}");
    assert!(contents(survey.path(), &[]) == before, "something was written");
}

#[test]
fn other_peoples_folders_are_refused_and_their_files_stay() {
    let out = tempfile::tempdir().unwrap();
    fs::write(out.path().join("stones.csv"), "mine").unwrap();
    fs::write(out.path().join("notes.txt"), "mine").unwrap();
    let before = contents(out.path(), &[]);
    let (code, log) = run(tiny_survey(), out.path(), &[]);
    assert_eq!(code, 2, "{log}");
    assert!(log.contains("not empty") && log.contains("--force"), "{log}");
    assert!(contents(out.path(), &[]) == before);

    let (code, log) = run(tiny_survey(), out.path(), &["--force"]);
    assert_eq!(code, 0, "{log}");
    assert_eq!(fs::read(out.path().join("notes.txt")).unwrap(), b"mine");
    assert!(
        fs::read(out.path().join("stones.csv"))
            .unwrap()
            .starts_with(b"stone_id")
    );

    // From now on the folder is this project's, and no other's.
    let other = copy_of(tiny_survey());
    let (code, log) = run(other.path(), out.path(), &[]);
    assert!(
        code == 2 && log.contains("something else (project \"Tiny wall\""),
        "{log}"
    );
    assert_eq!(run(tiny_survey(), out.path(), &[]).0, 0);
    assert_eq!(fs::read(out.path().join("notes.txt")).unwrap(), b"mine");

    // Without the marker in work/, run.json tells whose the folder is.
    fs::remove_dir_all(out.path().join("work")).unwrap();
    assert_eq!(run(tiny_survey(), out.path(), &[]).0, 0);
}

#[test]
fn a_survey_of_another_seed_is_not_replaced() {
    let dir = tempfile::tempdir().unwrap();
    let params = dir.path().join("params.toml");
    fs::write(&params, "epochs = 1\n[scene.wall]\nwidth_m = 1.2\nheight_m = 0.8\n[scene.tls]\nspacing_m = 0.02\n[photos]\ncolumns = 1\nrows = 1\nwidth = 300\nheight = 200\n").unwrap();
    let survey = dir.path().join("survey");
    let simulate = |seed: &str, extra: &[&str]| {
        let mut command = stonewise();
        command
            .args(["test", "simulate", "--quiet", "--seed", seed, "--params"])
            .arg(&params)
            .arg("--out")
            .arg(&survey);
        outcome(command.args(extra))
    };
    assert_eq!(simulate("1", &[]).0, 0);
    let before = contents(&survey, &[]);
    let (code, log) = simulate("2", &[]);
    assert!(
        code == 2 && log.contains("the simulated survey of seed 1"),
        "{log}"
    );
    assert!(contents(&survey, &[]) == before);
    assert_eq!(simulate("1", &[]).0, 0);
    assert_eq!(simulate("2", &["--force"]).0, 0);
}

#[test]
fn wrong_parameters_of_a_simulation_are_named_in_a_line_and_leave_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let (params, survey) = (dir.path().join("params.toml"), dir.path().join("survey"));
    for (text, message) in [
        ("name = \"x\"\nfoo = 1\n", "params.toml:2: unknown field `foo`"),
        (
            "[scene.wall]\nwidth_m = -4\n",
            "scene.wall.width_m = -4 is not possible",
        ),
    ] {
        fs::write(&params, text).unwrap();
        let mut command = stonewise();
        command.args(["test", "simulate", "--params"]).arg(&params);
        let (code, log) = outcome(command.arg("--out").arg(&survey));
        assert!(
            code == 2 && log.contains(message) && log.contains("params.toml") && log.ends_with("]\n"),
            "{log}"
        );
        assert_eq!(log.lines().count(), 1, "{log}");
        assert!(!survey.exists());
    }
    let mut command = stonewise();
    let missing = dir.path().join("missing.toml");
    command.args(["test", "simulate", "--params"]).arg(&missing);
    let (code, log) = outcome(command.arg("--out").arg(&survey));
    let expected = format!(
        "error: {}: reading failed: no such file or folder [file-access]\n",
        missing.display()
    );
    assert_eq!((code, log), (1, expected));
}

fn without_influence(registration: &[u8]) -> serde_json::Value {
    let mut record: serde_json::Value = serde_json::from_slice(registration).unwrap();
    record["influence"].take();
    record
}

/// A limit on the size of files makes writing fail in the middle of a file, as a full disk does: in a tile, in
/// a table, in the report.
#[cfg(target_os = "linux")]
#[test]
fn writing_that_fails_leaves_no_half_of_a_file() {
    let whole = results(tiny_results());
    let out = tempfile::tempdir().unwrap();
    for (blocks, file) in [(64, "ingest-1"), (400, "m3c2.csv"), (1600, "report.html")] {
        let mut shell = assert_cmd::Command::new("sh");
        shell
            .arg("-c")
            .arg(format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" \"$@\""))
            .arg(crate::support::program())
            .arg("run")
            .arg(tiny_survey().join("stonewise.toml"))
            .arg("--out")
            .arg(out.path());
        let (code, log) = outcome(&mut shell);
        assert_eq!(code, 1, "{log}");
        let error = log.lines().last().unwrap();
        assert!(
            error.contains(file) && error.contains("File too large"),
            "{error}"
        );
        assert!(out.path().join("UNFINISHED.txt").exists(), "{error}");
        for (name, bytes) in results(out.path()) {
            let finished = whole.iter().find(|(n, _)| *n == name);
            // Influences are added to the registration when the verdict is known.
            let is_whole = finished.is_some_and(|(_, whole)| match name.ends_with("registration.json") {
                true => without_influence(whole) == without_influence(&bytes),
                false => *whole == bytes,
            });
            assert!(
                is_whole || name == Path::new("UNFINISHED.txt"),
                "{}",
                name.display()
            );
        }
    }
    assert_eq!(run(tiny_survey(), out.path(), &[]).0, 0);
    assert!(results(out.path()) == whole, "other results after the failures");
}

#[test]
fn two_runs_do_not_share_a_folder() {
    let out = copy_of(tiny_results());
    let lock = File::create(out.path().join("work/lock")).unwrap();
    lock.lock().unwrap();
    let (code, log) = run(tiny_survey(), out.path(), &[]);
    assert!(
        code == 1 && log.contains("another run works in this folder"),
        "{log}"
    );
    drop(lock);
    assert_eq!(run(tiny_survey(), out.path(), &[]).0, 0);
}

/// Flips one bit in the middle of a file.
fn flip(path: &Path) {
    let mut bytes = fs::read(path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 4;
    fs::write(path, bytes).unwrap();
}

#[test]
fn damaged_work_is_done_again_and_said() {
    let out = copy_of(tiny_results());
    let sound = results(out.path());
    let work = out.path().join("work");
    // The one version of a step.
    let folder = |step: &str| {
        let mut versions = fs::read_dir(work.join(step)).unwrap().map(|e| e.unwrap().path());
        let only = versions.next().unwrap();
        assert!(versions.next().is_none(), "{step}");
        only
    };
    let first_in = |step: &str, end: &str| {
        let mut files: Vec<_> = fs::read_dir(folder(step))
            .unwrap()
            .map(|e| e.unwrap().path())
            .collect();
        files.retain(|p| p.to_string_lossy().ends_with(end));
        files.sort();
        files.into_iter().next().unwrap()
    };
    flip(&first_in("ingest-1", ".parquet"));
    flip(&first_in("label-2", ".parquet"));
    flip(&folder("stones-1").join("stones.json"));
    fs::remove_file(first_in("segment-2", ".png")).unwrap();
    let motions_file = folder("register-2").join("motions.json");
    let motions = fs::read(&motions_file).unwrap();
    fs::write(motions_file, &motions[..motions.len() / 2]).unwrap();
    fs::write(folder("m3c2-2").join("done"), "").unwrap();
    flip(&out.path().join("data/epoch1/cloud_tls.laz"));
    let partial = folder("label-1").join(".7_0_0.parquet.123.partial");
    fs::write(&partial, "half").unwrap();

    let (code, log) = run(tiny_survey(), out.path(), &[]);
    assert_eq!(code, 0, "{log}");
    for step in [
        "ingest-1",
        "label-2",
        "stones-1",
        "segment-2",
        "register-2",
        "m3c2-2",
        "clouds-1",
    ] {
        assert!(
            log.contains(&format!("step {step} was done again: ")),
            "{step}: {log}"
        );
    }
    assert!(
        log.contains("was changed or damaged")
            && log.contains("is missing")
            && log.contains("bytes instead of")
    );
    assert!(!log.contains("step match-2 was done again"), "{log}");
    assert!(results(out.path()) == sound, "results differ");
    assert!(!partial.exists());
    let (_, log) = run(tiny_survey(), out.path(), &[]);
    assert!(!log.contains("done again"), "{log}");
}

#[test]
fn results_of_an_earlier_run_do_not_pass_for_those_of_a_failed_one() {
    let survey = copy_of(tiny_survey());
    let out = tempfile::tempdir().unwrap();
    assert_eq!(run(survey.path(), out.path(), &[]).0, 0);
    let sound = results(out.path());
    let stones = fs::read(out.path().join("stones.csv")).unwrap();
    let masks = survey.path().join("masks/epoch2.json");
    let intact = fs::read(&masks).unwrap();
    fs::write(&masks, "{").unwrap();

    let (code, log) = run(survey.path(), out.path(), &[]);
    assert_eq!(code, 1, "{log}");
    assert!(
        log.contains("the results of the last finished run lie in"),
        "{log}"
    );
    for gone in [
        "stones.csv",
        "report.html",
        "data/epoch1/cloud_tls.laz",
        "run.json",
    ] {
        assert!(!out.path().join(gone).exists(), "{gone} looks current");
        assert!(out.path().join("previous").join(gone).exists(), "{gone} is lost");
    }
    assert!(fs::read(out.path().join("previous/stones.csv")).unwrap() == stones);
    // Every file that a run leaves is known as a result.
    let left = contents(out.path(), &["work", "previous", "UNFINISHED.txt"]);
    let names: Vec<_> = left.iter().map(|(name, _)| name).collect();
    assert!(names.is_empty(), "not known as results: {names:?}");
    assert!(
        fs::read_to_string(out.path().join("UNFINISHED.txt"))
            .unwrap()
            .contains("has not finished")
    );

    fs::write(&masks, intact).unwrap();
    assert_eq!(run(survey.path(), out.path(), &[]).0, 0);
    assert!(!out.path().join("previous").exists() && !out.path().join("UNFINISHED.txt").exists());
    assert!(results(out.path()) == sound, "results differ");
}

#[test]
fn impossible_tiles_and_twin_epochs_are_wrong_usage() {
    let survey = copy_of(tiny_survey());
    let project = survey.path().join("stonewise.toml");
    let text = fs::read_to_string(&project).unwrap();
    let out = survey.path().join("out");
    for size in ["1e5", "0.05"] {
        fs::write(&project, format!("{text}\n[ingest]\nsize_m = {size}\n")).unwrap();
        let (code, log) = run(survey.path(), &out, &[]);
        assert!(
            code == 2 && log.contains("is not possible: it must be 0.5 to 100"),
            "{log}"
        );
    }
    let mut names = text.lines().filter(|l| l.starts_with("name = ")).skip(1);
    let (first, second) = (names.next().unwrap(), names.next().unwrap());
    fs::write(&project, text.replace(second, first)).unwrap();
    let (code, log) = run(survey.path(), &out, &[]);
    assert!(code == 2 && log.contains("two epochs are named"), "{log}");
    assert!(!out.exists());
}

#[test]
fn a_training_with_an_impossible_value_makes_no_folder() {
    let dir = tempfile::tempdir().unwrap();
    let (config, out) = (dir.path().join("training.toml"), dir.path().join("trained"));
    fs::write(&config, "[training]\nbatch = 0\n").unwrap();
    let mut command = stonewise();
    command
        .args(["detector", "train", "--rendered", "--config"])
        .arg(&config);
    let (code, log) = outcome(command.arg("--out").arg(&out));
    assert!(code == 2 && log.contains("training.toml"), "{code}: {log}");
    assert!(!out.exists());
}
