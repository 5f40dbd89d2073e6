//! Keeps the modules of the project in their order: a module uses only those below it, and no files use each
//! other in a circle.

/// Modules from the bottom up; those on one line do not use each other.
const LAYERS: [&[&str]; 5] = [
    &["dated_csv"],
    &["conditions", "edits", "init", "instruments", "sources"],
    &["project_type"],
    &["check", "project_file", "project_parameters", "split"],
    &["scans", "schema"],
];

#[test]
fn modules_use_only_those_below_them_and_never_in_a_circle() {
    stonewise_testing::assert_layers(env!("CARGO_MANIFEST_DIR"), &LAYERS);
}
