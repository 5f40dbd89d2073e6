//! Keeps the modules of core in their order: a module uses only those below it, and no files use
//! each other in a circle.

/// Modules from the bottom up; those on one line do not use each other.
const LAYERS: [&[&str]; 8] = [
    &[
        "id",
        "epoch",
        "statistics",
        "linalg",
        "components",
        "progress",
        "parallel",
        "params",
        "switches",
    ],
    &["geometry"],
    &["raster"],
    &["cloud"],
    &["stone"],
    &["surface"],
    &[
        "transfer",
        "matching",
        "registration",
        "change",
        "views",
        "series",
        "instruments",
    ],
    &["evaluate"],
];

#[test]
fn modules_use_only_those_below_them_and_never_in_a_circle() {
    stonewise_testing::assert_layers(env!("CARGO_MANIFEST_DIR"), &LAYERS);
}
