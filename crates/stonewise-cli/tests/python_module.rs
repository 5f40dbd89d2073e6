//! The Python module lies apart from the workspace: what both must agree on.

#![allow(clippy::unwrap_used)] // a test that cannot go on must stop

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

const FIX: &str =
    "copy Cargo.lock to crates/stonewise-py and run `cargo update --workspace` there, see CONTRIBUTING.md";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn read(path: &str) -> toml::Table {
    fs::read_to_string(root().join(path)).unwrap().parse().unwrap()
}

/// Versions of every package of a lock file, and the names of its dependencies.
fn packages(lock: &str) -> BTreeMap<String, (BTreeSet<String>, BTreeSet<String>)> {
    let mut found: BTreeMap<String, (BTreeSet<String>, BTreeSet<String>)> = BTreeMap::new();
    for package in read(lock)["package"].as_array().unwrap() {
        let entry = found
            .entry(package["name"].as_str().unwrap().to_owned())
            .or_default();
        entry.0.insert(package["version"].as_str().unwrap().to_owned());
        let dependencies = package
            .get("dependencies")
            .and_then(|d| d.as_array())
            .into_iter()
            .flatten();
        let name = |d: &toml::Value| d.as_str().unwrap().split(' ').next().unwrap().to_owned();
        entry.1.extend(dependencies.map(name));
    }
    found
}

#[test]
fn shared_dependencies_have_the_same_versions() {
    let (ours, theirs) = (packages("Cargo.lock"), packages("crates/stonewise-py/Cargo.lock"));
    for (name, (versions, _)) in &theirs {
        if let Some((known, _)) = ours.get(name) {
            assert!(
                versions.is_subset(known),
                "{name} {versions:?} against {known:?}: {FIX}"
            );
        }
    }
    let crates = theirs
        .keys()
        .filter(|n| n.starts_with("stonewise") && *n != "stonewise-py");
    let crates: Vec<&String> = crates.collect();
    assert_eq!(crates.len(), 5);
    for name in crates {
        let manifest = read(&format!("crates/{name}/Cargo.toml"));
        for (dependency, value) in manifest["dependencies"].as_table().unwrap() {
            let is_optional = value.get("optional").and_then(toml::Value::as_bool) == Some(true);
            assert!(
                is_optional || theirs[name].1.contains(dependency),
                "{name} needs {dependency}: {FIX}"
            );
        }
    }
}

#[test]
fn the_module_is_built_as_the_command_is() {
    let (ours, theirs) = (read("Cargo.toml"), read("crates/stonewise-py/Cargo.toml"));
    assert_eq!(ours["profile"], theirs["profile"]);
    for key in ["version", "edition", "rust-version", "license"] {
        assert_eq!(ours["workspace"]["package"][key], theirs["package"][key], "{key}");
    }
}
