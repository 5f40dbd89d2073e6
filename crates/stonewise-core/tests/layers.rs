//! Keeps the modules of core in their order: a module uses only those below it, the stages never each other,
//! and no files use each other in a circle.
#![allow(clippy::unwrap_used, clippy::panic)] // a test that cannot read the sources must stop

#[path = "../../../testing/module_graph.rs"]
mod module_graph;

use module_graph::ModuleGraph;
use std::path::Path;

/// Modules from the bottom up; those on one line do not see each other.
const LAYERS: [&[&str]; 8] = [
    &["id", "statistics", "linalg", "progress", "parallel"],
    &["geometry"],
    &["raster"],
    &["cloud"],
    &["stone"],
    &["transfer", "matching", "registration", "change"],
    &["evaluate"],
    &["simulate"],
];

#[test]
fn modules_use_only_those_below_them_and_never_in_a_circle() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let graph = ModuleGraph::read(&src);
    assert!(
        graph.use_count() > 100,
        "only {} uses found: the search is broken",
        graph.use_count()
    );
    graph.assert_layers(&LAYERS);
    graph.assert_no_circle();
}
