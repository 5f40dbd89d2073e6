//! Keeps the modules of the results in their order: a module uses only those below it, and no files use each
//! other in a circle.

/// Modules from the bottom up; those on one line do not use each other.
const LAYERS: [&[&str]; 7] = [
    &["calendar", "names"],
    &[
        "change_points",
        "facade",
        "records",
        "squares",
        "statistics",
        "stone_row",
    ],
    &["columns", "evidence", "outlines", "scale", "zone_place"],
    &["neighbours", "stone_table", "velocities"],
    &["result_set"],
    &["comparison", "joints"],
    &["export"],
];

#[test]
fn modules_use_only_those_below_them_and_never_in_a_circle() {
    stonewise_testing::assert_layers(env!("CARGO_MANIFEST_DIR"), &LAYERS);
}
