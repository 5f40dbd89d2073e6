//! The modules of every crate in their order: a module uses only those below it, and no files use each other
//! in a circle.

use crate::module_graph::assert_layers;
use std::path::Path;

/// Modules from the bottom up; those on one line do not use each other.
type Layers = &'static [&'static [&'static str]];

const CORE: Layers = &[
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

const IO: Layers = &[
    &["text", "xml"],
    &["atomic", "crs", "exif", "folder", "photo_name", "wall"],
    &["image_io"],
    &["cameras", "cloud", "dxf", "mesh_ply", "table"],
    &["layers", "masks", "network"],
];

const SEGMENT: Layers = &[
    &[
        "detection",
        "engine",
        "jpeg",
        "relief",
        "sample",
        "seed",
        "segmentation",
    ],
    &["evaluation", "model"],
    &["built_in"],
    &["stone_finder"],
    &["tiling"],
    &["augment"],
    &["train"],
    &["dataset"],
];

const SIMULATE: Layers = &[&["world"], &["files"]];

const FIGURE: Layers = &[
    &["colour", "text"],
    &["axis", "page"],
    &["axes", "colour_bar"],
    &["plot", "scale"],
];

const BASE: Layers = &[
    &["language", "processor", "thresholds"],
    &["error", "messages", "report_params"],
    &["stable"],
    &["settings"],
    &["address_space", "files", "part", "warnings"],
    &["parameters", "profile"],
];

const RESULTS: Layers = &[
    &["budget", "calendar", "names"],
    &[
        "change_points",
        "facade",
        "records",
        "squares",
        "statistics",
        "stone_row",
    ],
    &["columns", "evidence", "outlines", "scale", "zone_place"],
    &["courses", "neighbours", "stone_table"],
    &["result_set"],
    &["comparison", "fixed_datum", "joints"],
    &["export"],
];

const REPORT: Layers = &[
    &["browser", "texts"],
    &["draw", "verdict"],
    &["summary"],
    &["page", "tables"],
    &["pdf", "report_file"],
];

const PROJECT: Layers = &[
    &["dated_csv"],
    &["conditions", "edits", "init", "instruments", "sources"],
    &["networks"],
    &["project_type"],
    &["distances", "origin"],
    &["check", "project_file", "project_parameters", "split"],
    &["scans", "schema"],
];

const STONEWISE: Layers = &[
    &["kept", "truth", "watched"],
    &["storage"],
    &["segmentation"],
    &["output"],
    &["pipeline"],
    &["adapt", "experiment", "verify"],
];

const STUDIO: Layers = &[
    &[
        "elsewhere",
        "http",
        "journal",
        "place",
        "project_text",
        "remarks",
        "teaching",
        "wall",
        "work",
    ],
    &["assets", "epochs", "guard", "sightings", "stable"],
    &["api"],
    &["studio"],
];

const CLI: Layers = &[
    &["args", "counted", "gone", "note", "stdout", "steps"],
    &["renamed", "screen"],
    &["printer"],
    &["commands"],
];

const PY: Layers = &[
    &["clouds", "error"],
    &["arrays", "attended"],
    &["command", "view"],
    &["adjust", "detector", "fixed", "m3c2", "transfer", "units"],
];

#[test]
fn modules_use_only_those_below_them_and_never_in_a_circle() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for (name, layers) in [
        ("stonewise-core", CORE),
        ("stonewise-io", IO),
        ("stonewise-segment", SEGMENT),
        ("stonewise-simulate", SIMULATE),
        ("stonewise-figure", FIGURE),
        ("stonewise-base", BASE),
        ("stonewise-results", RESULTS),
        ("stonewise-report", REPORT),
        ("stonewise-project", PROJECT),
        ("stonewise", STONEWISE),
        ("stonewise-studio", STUDIO),
        ("stonewise-cli", CLI),
        ("stonewise-py", PY),
    ] {
        assert_layers(&crates.join(name), layers);
    }
}
