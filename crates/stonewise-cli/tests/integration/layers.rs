//! Keeps the modules of the command line in their order: a module uses only those below it, and no files use
//! each other in a circle.

/// Modules from the bottom up; those on one line do not use each other.
const LAYERS: [&[&str]; 4] = [
    &["args", "counted", "note", "stdout", "steps"],
    &["screen"],
    &["printer"],
    &["commands"],
];

#[test]
fn modules_use_only_those_below_them_and_never_in_a_circle() {
    stonewise_testing::assert_layers(env!("CARGO_MANIFEST_DIR"), &LAYERS);
}
