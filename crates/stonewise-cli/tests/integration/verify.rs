//! `verify`: what it finds where files, tables, inputs or the program are not those of the run.

use crate::support::{contents, copy_of, copy_tree, program as program_file, run, stonewise, tiny_survey};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use stonewise_io::table::{Column, Table, read_parquet, write_parquet};

/// Exit code, answer of the whole, and the findings that do not hold as `kind subject`.
fn verify(results: &Path, project: Option<&Path>) -> (i32, String, Vec<String>) {
    let mut command = stonewise();
    command.arg("verify").arg(results).arg("--json");
    let output = command.args(project).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(!text.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    let said: Value = serde_json::from_str(&text).unwrap();
    let word = |value: &Value| value.as_str().unwrap().to_owned();
    let findings = said["findings"].as_array().unwrap().iter();
    let failed = findings
        .filter(|f| f["answer"] != "holds")
        .map(|f| format!("{} {}", word(&f["kind"]), word(&f["subject"])))
        .collect();
    (output.status.code().unwrap(), word(&said["answer"]), failed)
}

/// Makes the list of digests that a forger would make.
fn digest_anew(results: &Path) {
    let list = fs::read_to_string(results.join("data/digests.b3")).unwrap();
    let names = list.lines().map(|line| line.split_once("  ").unwrap().1);
    let line = |name| {
        let bytes = fs::read(results.join(name)).unwrap();
        format!("{}  {name}\n", blake3::hash(&bytes).to_hex())
    };
    let anew: String = names.map(line).collect();
    fs::write(results.join("data/digests.b3"), anew).unwrap();
}

/// A survey with a known motion and its results.
fn finished() -> (tempfile::TempDir, PathBuf, PathBuf) {
    let dir = copy_of(tiny_survey());
    let project = dir.path().join("stonewise.toml");
    let text = fs::read_to_string(&project).unwrap();
    let at = text.rfind("[[epochs]]").unwrap() + "[[epochs]]\n".len();
    let motion = "motion = { kind = \"translation\", d = [0.0, 0.01, 0.0] }\n";
    fs::write(&project, format!("{}{motion}{}", &text[..at], &text[at..])).unwrap();
    let out = dir.path().join("results");
    let (code, text) = run(dir.path(), &out, &[]);
    assert!(code == 0 || code == 3, "{text}");
    (dir, project, out)
}

#[test]
fn results_are_held_against_their_run_and_every_change_is_found() {
    let (dir, project, out) = finished();
    assert_eq!(verify(&out, Some(&project)), (0, "holds".to_owned(), Vec::new()));

    // A bit of every result file.
    let but = ["work", "data/digests.b3"];
    let files = contents(&out, &but);
    assert!(files.iter().any(|(f, _)| f.ends_with("evaluation.json")) && files.len() > 20);
    for (file, bytes) in &files {
        let mut spoilt = bytes.clone();
        let middle = spoilt.len() / 2;
        spoilt[middle] ^= 4;
        fs::write(out.join(file), &spoilt).unwrap();
    }
    let (code, answer, failed) = verify(&out, None);
    assert_eq!((code, answer.as_str()), (1, "fails"));
    for (file, bytes) in &files {
        let named = format!("files {}", file.display());
        assert!(failed.contains(&named), "{}: {failed:?}", file.display());
        fs::write(out.join(file), bytes).unwrap();
    }

    // A forger who also makes new digests: one value of one table.
    let forged = |file: &str, change: &dyn Fn(&Path)| {
        let bytes = fs::read(out.join(file)).unwrap();
        let list = fs::read(out.join("data/digests.b3")).unwrap();
        change(&out.join(file));
        digest_anew(&out);
        let (code, _, failed) = verify(&out, None);
        fs::write(out.join(file), bytes).unwrap();
        fs::write(out.join("data/digests.b3"), list).unwrap();
        assert_eq!(code, 1, "{file}");
        failed
    };
    let replace = |from: &'static str, to: &'static str| {
        move |path: &Path| {
            let text = fs::read_to_string(path).unwrap();
            assert!(text.contains(from), "{from}");
            fs::write(path, text.replacen(from, to, 1)).unwrap();
        }
    };
    assert_eq!(
        forged("stones.csv", &replace(",ok,", ",failed_points,")),
        ["tables stones.csv"]
    );
    for (file, key, forgery) in [
        ("verdict.json", "\"moved\": ", "\"moved\": 7"),
        ("data/evaluation.json", "\"rmse_m\": ", "\"rmse_m\": 1"),
    ] {
        // The report is made from both.
        let failed = forged(file, &replace(key, forgery));
        assert!(failed.contains(&format!("tables {file}")), "{file}: {failed:?}");
    }
    let failed = forged("data/stones.parquet", &|path| moved_by_a_millimetre(path));
    for file in ["stones.csv", "data/evaluation.json", "report.html", "stones.gpkg"] {
        assert!(failed.contains(&format!("tables {file}")), "{file}: {failed:?}");
    }

    // A report in other words: wrong of this program, and open of another.
    let names = ["run.json", "report.html", "data/digests.b3"];
    let before = names.map(|name| fs::read(out.join(name)).unwrap());
    replace("</title>", " </title>")(&out.join("report.html"));
    digest_anew(&out);
    let report = vec!["tables report.html".to_owned()];
    assert_eq!(verify(&out, None), (1, "fails".to_owned(), report.clone()));
    let record: Value = serde_json::from_slice(&before[0]).unwrap();
    let program = record["program"].as_str().unwrap();
    assert_eq!(
        program,
        blake3::hash(&fs::read(program_file()).unwrap()).to_hex().as_str()
    );
    let record = String::from_utf8(before[0].clone()).unwrap();
    fs::write(out.join("run.json"), record.replace(program, &"0".repeat(64))).unwrap();
    digest_anew(&out);
    assert_eq!(verify(&out, None), (3, "open".to_owned(), report));
    for (name, bytes) in names.iter().zip(before) {
        fs::write(out.join(name), bytes).unwrap();
    }

    // Something that the run did not make, and a list that is lost.
    fs::write(out.join("data/stones_2.csv"), "stone_id\n").unwrap();
    assert_eq!(
        verify(&out, None),
        (3, "open".to_owned(), vec!["files data/stones_2.csv".to_owned()])
    );
    fs::remove_file(out.join("data/stones_2.csv")).unwrap();
    fs::rename(out.join("data/digests.b3"), dir.path().join("digests.b3")).unwrap();
    assert_eq!(
        verify(&out, None),
        (3, "open".to_owned(), vec!["files data/digests.b3".to_owned()])
    );
    fs::rename(dir.path().join("digests.b3"), out.join("data/digests.b3")).unwrap();

    // An input that was changed: another motion is another parameter of the epoch, other masks another input.
    let masks = contents(dir.path(), &["results"])
        .into_iter()
        .find(|(file, _)| file.extension().is_some_and(|e| e == "json") && file.starts_with("masks"));
    if let Some((masks, bytes)) = masks {
        let mut text = String::from_utf8(bytes).unwrap();
        text.push('\n');
        fs::write(dir.path().join(masks), text).unwrap();
        let (code, _, failed) = verify(&out, Some(&project));
        assert!(
            code == 1 && failed.iter().any(|f| f.starts_with("inputs masks of ")),
            "{failed:?}"
        );
    }

    // The report written again is still the run's; so is a copy elsewhere.
    stonewise()
        .args(["report", "--quiet"])
        .arg(&out)
        .assert()
        .success();
    let copy = dir.path().join("copy");
    copy_tree(&out, &copy);
    assert_eq!(verify(&copy, None), (0, "holds".to_owned(), Vec::new()));
}

/// Moves the first measured stone of a table.
fn moved_by_a_millimetre(path: &Path) {
    let table = read_parquet(path).unwrap();
    let mut forged = Table::new();
    for (name, column) in table.columns() {
        let (unit, meaning) = table.description(name).unwrap_or_default();
        let column: Column = match name {
            "dx" | "d_out" => {
                let mut cells = table.optional::<f64>(name).unwrap();
                *cells.iter_mut().flatten().next().unwrap() += 1e-3;
                cells.into()
            }
            _ => column.clone(),
        };
        forged.push(name, unit, meaning, column).unwrap();
    }
    write_parquet(path, &forged).unwrap();
}
