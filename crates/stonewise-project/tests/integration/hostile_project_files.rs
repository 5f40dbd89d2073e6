//! Project files with values that cannot be: each is refused with its line and what is allowed.

use std::fs;
use stonewise_project::Project;

/// A project that is sound, then these lines.
fn error_of(lines: &str) -> String {
    let dir = tempfile::tempdir().unwrap();
    for file in ["cloud.laz", "cameras.xml"] {
        fs::write(dir.path().join(file), "").unwrap();
    }
    let epoch = |name: &str| {
        format!(
            "[[epochs]]\nname = \"{name}\"\nclouds = [\"cloud.laz\"]\nimages = \".\"\ncameras = \"cameras.xml\"\n"
        )
    };
    let head = format!("[project]\nname = \"wall\"\n{}{}", epoch("2024"), epoch("2025"));
    let path = dir.path().join("stonewise.toml");
    fs::write(&path, &head).unwrap();
    Project::read(&path).unwrap();
    fs::write(&path, head + lines).unwrap();
    Project::read(&path).unwrap_err().to_string()
}

/// Number of the line of the project file that carries the mark.
fn marked_line(lines: &str) -> usize {
    12 + lines.lines().position(|line| line.contains("# here")).unwrap() + 1
}

#[test]
fn hostile_values_are_refused_with_their_line() {
    for (lines, words) in [
        (
            "[match]\nmax_ratio = nan # here",
            "match.max_ratio = NaN is not possible: it must be a finite number, above 0",
        ),
        (
            "[match]\nmin_overlap = inf # here",
            "match.min_overlap = inf is not possible: it must be a finite number, 0 to 1",
        ),
        (
            "[registration]\nepoch_error_m = -inf # here",
            "registration.epoch_error_m = -inf",
        ),
        (
            "[registration]\nepoch_error_m = -0.001 # here",
            "it must be 0 to 1",
        ),
        (
            "[registration.observers]\nshared_error_m = nan # here",
            "registration.observers.shared_error_m = NaN",
        ),
        // The same key stands in another table or in a comment before.
        (
            "[registration.observers.stable]\ncell_m = 0.25\n[label]\ncell_m = -0.25 # here",
            "label.cell_m = -0.25",
        ),
        (
            "[registration.gicp]\ntolerance_m = 1e-6\n[registration.adjustment]\ntolerance_m = 0 # here",
            "above 0",
        ),
        (
            "# max_ratio of the paper\n[match]\nmax_ratio = 0 # here",
            "match.max_ratio = 0",
        ),
        ("[ingest]\nsize_m = 1e300 # here", "it must be 0.5 to 100"),
        (
            "[label]\ndepth_memory_mib = 4294967296 # here",
            "invalid value: integer `4294967296`",
        ),
        (
            "[label]\nmin_points = 99999999999999999999 # here",
            "99999999999999999999",
        ),
        (
            "[registration.adjustment]\npatch_cells = -3 # here",
            "invalid value: integer `-3`",
        ),
        (
            "[registration.adjustment]\npatch_cells = 2.5 # here",
            "invalid type: floating point",
        ),
        (
            "[carry]\nmin_same_share = 1.01 # here",
            "carry.min_same_share = 1.01 is not possible: it must be 0 to 1",
        ),
        (
            "[segment]\ntiling = { tile_px = 640, overlap_px = 321 } # here",
            "at most half of tile_px",
        ),
        (
            "[segment.tiling]\nscales = [1.0, 9.0] # here",
            "segment.tiling.scales = 9 is not possible: it must be 0.01 to 4",
        ),
        ("[segment.tiling]\nscales = [] # here", "one number or more"),
        ("[m3c2]\nddof = 2 # here", "m3c2.ddof = 2"),
        (
            "[views]\nside_px = 0 # here",
            "views.side_px = 0 is not possible: it must be above 0",
        ),
        (
            "[registration]\nalign = \"stone\" # here",
            "unknown variant `stone`, expected `none` or `stones`",
        ),
        (
            "[m3c2] # here\nnormal_radius_m = 0.2\nnormal_diameter_m = 0.4",
            "left out where normal_radius_m is given",
        ),
        (
            "[m3c2] # here\nnormal_diameter_m = -1",
            "m3c2.normal_radius_m = -0.5",
        ),
        (
            "[thresholds]\nattention_mm = 10 # here\nalarm_mm = 5",
            "it must be below alarm_mm = 5",
        ),
        (
            "[[thresholds.zones]]\nname = \"a\"\npolygon = [[0, 0], [1, 0], [1, 1]]\nalarm_mm = 3\n[[thresholds.zones]]\n\
             name = \"b\"\npolygon = [[0, 0], [1, 0], [1, 1]]\nalarm_mm = -1 # here",
            "thresholds.zones.1.alarm_mm = -1 is not possible: it must be above 0",
        ),
        (
            "[match]\nmax_ratio = \"much\" # here",
            "invalid type: string \"much\", expected f64",
        ),
        ("[match]\nmutual = 1 # here", "expected a boolean"),
        ("[match]\nmax_ration = 0.5 # here", "unknown field `max_ration`"),
        (
            "[registration.gicp]\nstart = \"centroids\" # here",
            "the iteration starts at no motion",
        ),
        (
            "[registration.gicp]\nplane_radius_m = 0.1 # here",
            "raise plane_neighbours",
        ),
        ("[matching] # here\nmax_ratio = 0.5", "unknown field `matching`"),
        (
            "[registration]\nestimator = \"network\" # here",
            "unknown variant `network`, expected `adjustment` or `gicp`",
        ),
    ] {
        let message = error_of(lines);
        let place = format!("stonewise.toml:{}: ", marked_line(lines));
        assert!(message.contains(&place), "{lines}\n{place}{message}");
        assert!(message.contains(words), "{lines}\n{message}");
    }
}
