//! Projects and edits through the API, and a server that is killed while a person edits.

use crate::support::{PROJECT, Tested};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

fn edit(along: f64) -> Value {
    json!({ "do": "delete", "at": [[along, 1.0]], "who": "A. Keller", "when": "", "why": "door" })
}

fn changes(way: &Value, value: &Value) -> Value {
    json!({ "changes": [{ "way": way, "value": value }] })
}

/// A file of edits with its unrolled wall, so that no results are needed.
fn with_wall(folder: &Path) {
    let wall = json!({
        "origin": [0.0, 0.0, 0.0], "out": [0.0, -1.0, 0.0], "up_per_height": 1.0, "start": [0.0, 0.0],
        "stretches": [[0.0, 0.0, 0.0]]
    });
    let file = json!({ "format": 1, "facade": wall, "edits": [] });
    fs::write(folder.join("edits.json"), file.to_string()).unwrap();
}

fn places(edits: &Value) -> Vec<f64> {
    let all = edits["edits"].as_array().unwrap();
    all.iter().map(|e| e["at"][0][0].as_f64().unwrap()).collect()
}

#[test]
fn a_form_keeps_comments_and_says_what_is_wrong_where() {
    let studio = Tested::new();
    let path = studio.path("stonewise.toml");
    let done = studio.send(
        "PATCH",
        "/api/v1/project",
        &changes(&json!(["epochs", 1, "date"]), &json!("2025-05-02")),
    );
    assert_eq!(done.status, 200, "{}", done.body);
    assert_eq!(done.json()["epochs"][1]["date"], "2025-05-02");
    let expected = PROJECT.replace("[\"b.xyz\"]\n", "[\"b.xyz\"]\ndate = 2025-05-02\n");
    assert_eq!(fs::read_to_string(&path).unwrap(), expected);
    for (way, value) in [
        (json!(["match", "max_ratio"]), json!(-1)),
        (json!(["epochs", 0, "clouds"]), json!(["gone.xyz"])),
        (json!(["project", "nam"]), json!("x")),
        (json!(["epochs", 0, "date"]), json!("2026-01-01")),
    ] {
        let refused = studio.send("PATCH", "/api/v1/project", &changes(&way, &value));
        assert_eq!(refused.status, 422, "{way}: {}", refused.body);
        assert!(refused.json()["message"].as_str().unwrap().len() > 5);
    }
    let wrong = studio.send(
        "PATCH",
        "/api/v1/project",
        &changes(&json!(["match", "max_ratio"]), &json!(-1)),
    );
    assert_eq!(wrong.json()["way"], json!(["match", "max_ratio"]));
    assert_eq!(fs::read_to_string(&path).unwrap(), expected);
}

#[test]
fn a_folder_without_a_project_is_offered_the_one_that_init_writes() {
    let dir = crate::support::survey();
    fs::remove_file(dir.path().join("stonewise.toml")).unwrap();
    let studio = Tested::of(dir, false);
    let before = studio.get("/api/v1/project").json();
    let text = before["proposal"]["text"].as_str().unwrap().to_owned();
    assert!(!studio.path("stonewise.toml").exists());
    let after = studio.send("POST", "/api/v1/project", &json!({}));
    assert_eq!(after.status, 200, "{}", after.body);
    assert_eq!(fs::read_to_string(studio.path("stonewise.toml")).unwrap(), text);
    assert_eq!(after.json()["epochs"].as_array().unwrap().len(), 2);
}

#[test]
fn results_whose_project_is_gone_have_no_edits() {
    let dir = crate::support::survey();
    fs::remove_file(dir.path().join("stonewise.toml")).unwrap();
    fs::create_dir(dir.path().join("data")).unwrap();
    for file in ["run.json", "data/stones.parquet"] {
        fs::write(dir.path().join(file), "{}").unwrap();
    }
    let studio = Tested::of(dir, false);
    assert_eq!(studio.get("/api/v1/state").json()["has_project"], false);
    let shown = studio.get("/api/v1/edits");
    assert_eq!(shown.status, 200, "{}", shown.body);
    assert!(places(&shown.json()).is_empty());
    let add = json!({ "id": "a", "edits": [edit(1.0)] });
    assert_eq!(studio.send("POST", "/api/v1/edits", &add).status, 404);
}

#[test]
fn a_project_outside_the_opened_results_changes_only_when_told_so() {
    let dir = crate::support::survey();
    let copy = dir.path().join("copy");
    fs::create_dir_all(copy.join("data")).unwrap();
    fs::write(
        copy.join("run.json"),
        json!({ "project": { "file": "../stonewise.toml" } }).to_string(),
    )
    .unwrap();
    fs::write(copy.join("data/stones.parquet"), "").unwrap();
    let studio = Tested::at(dir, "copy", false);
    let state = studio.get("/api/v1/state").json();
    assert_eq!(
        (&state["read_only"], &state["view"], &state["has_project"]),
        (&json!(true), &json!(true), &json!(true))
    );
    let change = changes(&json!(["project", "name"]), &json!("changed"));
    let refused = studio.send("PATCH", "/api/v1/project", &change);
    assert!(
        refused.status == 403 && refused.body.contains("outside the folder"),
        "{}",
        refused.body
    );
    assert!(
        !fs::read_to_string(studio.path("stonewise.toml"))
            .unwrap()
            .contains("changed")
    );
    let state = studio.send("POST", "/api/v1/allow", &json!({})).json();
    assert_eq!(
        (&state["read_only"], &state["view"]),
        (&json!(false), &json!(false))
    );
    assert_eq!(studio.send("PATCH", "/api/v1/project", &change).status, 200);
}

#[test]
fn edits_are_in_the_file_that_the_project_names_before_they_are_answered() {
    let studio = Tested::new();
    with_wall(studio.dir.path());
    let add = |id: &str, along: f64| {
        studio.send(
            "POST",
            "/api/v1/edits",
            &json!({ "id": id, "edits": [edit(along)] }),
        )
    };
    assert_eq!(places(&add("a", 1.0).json()), [1.0]);
    assert_eq!(places(&add("b", 2.0).json()), [1.0, 2.0]);
    // Sent again, because the answer was lost.
    assert_eq!(places(&add("b", 2.0).json()), [1.0, 2.0]);
    let file =
        || serde_json::from_str::<Value>(&fs::read_to_string(studio.path("edits.json")).unwrap()).unwrap();
    assert_eq!(places(&file()), [1.0, 2.0]);
    assert!(file()["edits"][0]["when"].as_str().unwrap().starts_with("20"));
    let undone = studio
        .send("POST", "/api/v1/edits/undo", &json!({ "id": "u" }))
        .json();
    assert_eq!((places(&undone), &undone["can_redo"]), (vec![1.0], &json!(true)));
    assert_eq!(places(&file()), [1.0]);
    let redone = studio
        .send("POST", "/api/v1/edits/redo", &json!({ "id": "r" }))
        .json();
    assert_eq!(places(&redone), [1.0, 2.0]);
    let text = fs::read_to_string(studio.path("stonewise.toml")).unwrap();
    assert!(
        text.starts_with(PROJECT) && text.contains("[edits]\nfile = \"edits.json\""),
        "{text}"
    );
    for wrong in [
        json!({ "do": "merge", "at": [[1.0, 1.0]], "who": "A", "when": "", "why": "x" }),
        json!({ "do": "delete", "at": [[1.0, 1.0]], "who": "", "when": "", "why": "x" }),
        json!({ "do": "delete", "at": [[1.0, 1.0]], "epochs": ["1999"], "who": "A", "when": "", "why": "x" }),
    ] {
        let refused = studio.send("POST", "/api/v1/edits", &json!({ "id": "w", "edits": [wrong] }));
        assert_eq!(refused.status, 422, "{}", refused.body);
    }
    assert_eq!(places(&file()), [1.0, 2.0]);
}
