//! What belongs to an installed command: completions, man pages, a look at the machine.

use crate::support::{program, stonewise};
use std::collections::BTreeSet;
use std::fs;
use std::process::{Command, Stdio};

/// The commands that `--help` lists.
fn listed() -> BTreeSet<String> {
    let help = stonewise().arg("--help").output().unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    let commands = help.split("Options:").next().unwrap();
    let names = commands.lines().filter(|l| l.starts_with("  "));
    names
        .filter_map(|l| l.split_whitespace().next())
        .map(str::to_owned)
        .collect()
}

#[test]
fn a_reader_that_closes_the_output_early_is_no_error() {
    let mut command = Command::new(program());
    command
        .args(["self", "schema"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
}

#[test]
fn completions_are_scripts_that_bash_accepts_and_that_name_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let output = stonewise()
        .args(["self", "completions", "bash"])
        .output()
        .unwrap();
    assert!(output.status.success());
    let script = folder.path().join("stonewise.bash");
    fs::write(&script, &output.stdout).unwrap();
    let script = script.to_str().unwrap();
    // A word begun as `stonewise des` is completed by bash itself.
    let ask = format!(
        "source {script} && COMP_WORDS=(stonewise des) COMP_CWORD=1 && _stonewise stonewise des stonewise && echo ${{COMPREPLY[@]}}"
    );
    let Ok(answer) = Command::new("bash").args(["-c", &ask]).output() else {
        eprintln!("skipped: no bash");
        return;
    };
    assert_eq!(
        String::from_utf8_lossy(&answer.stdout).trim(),
        "design",
        "{answer:?}"
    );
    let text = String::from_utf8(output.stdout).unwrap();
    for command in listed() {
        assert!(text.contains(&format!("stonewise,{command})")), "{command}");
    }
}

#[test]
fn every_command_has_a_man_page_and_none_is_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let man = || {
        let mut command = stonewise();
        command.args(["self", "man", "--out"]).arg(folder.path());
        command
    };
    assert!(man().output().unwrap().status.success());
    let pages = fs::read_dir(folder.path()).unwrap();
    let pages: BTreeSet<String> = pages
        .map(|page| page.unwrap().file_name().into_string().unwrap())
        .collect();
    let expected = listed().into_iter().map(|c| format!("stonewise-{c}.1"));
    assert_eq!(pages, expected.chain(["stonewise.1".to_owned()]).collect());

    let kept = folder.path().join("stonewise-run.1");
    fs::write(&kept, "notes of mine").unwrap();
    let refused = man().output().unwrap();
    assert_eq!(refused.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("--force"));
    assert_eq!(fs::read_to_string(&kept).unwrap(), "notes of mine");
    assert!(man().arg("--force").output().unwrap().status.success());
    assert!(fs::read_to_string(&kept).unwrap().contains("\\-\\-exit\\-on"));
}

#[test]
fn the_version_is_one_line_and_its_details_name_the_weights() {
    let said = |words: &[&str]| {
        let output = stonewise().args(words).output().unwrap();
        assert!(output.status.success(), "{words:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let line = format!("stonewise {}\n", env!("CARGO_PKG_VERSION"));
    assert_eq!(said(&["--version"]), line);
    let details = said(&["--version", "--verbose"]);
    assert!(details.starts_with(&line), "{details}");
    assert_eq!(said(&["--verbose", "--version"]), details);
    let parts = ["1", "2"].map(|n| fs::read(format!("../stonewise-weights-{n}/weights.part")).unwrap());
    let digest = blake3::hash(&parts.concat()).to_hex();
    assert!(details.contains(digest.as_str()), "{details}");
}

#[test]
fn doctor_says_what_an_empty_environment_lacks() {
    let nothing = tempfile::tempdir().unwrap();
    let mut command = stonewise();
    command
        .args(["self", "doctor"])
        .env_clear()
        .env("PATH", nothing.path());
    let found = command.output().unwrap();
    assert!(found.status.success());
    let text = String::from_utf8(found.stdout).unwrap();
    for line in ["none is installed", "no python3 on the path", "none set"] {
        assert!(text.contains(line), "{text}");
    }
}
