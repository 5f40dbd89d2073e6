//! `split` of a project with corrections by hand: its halves have them, too.

use crate::support::stones::{SIGNED, inner, nearest, number, place, rows};
use crate::support::{SURVEY, outcome, run, simulated, stonewise};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use stonewise_io::cameras::read_cameras;
use stonewise_io::layers::read_polygons;

type Rows = BTreeMap<u32, BTreeMap<String, String>>;

/// Places closer than this are the same stone, metres.
const SAME_M: f64 = 0.02;

fn split(survey: &Path, out: &Path) -> (i32, String) {
    let mut command = stonewise();
    command.args(["test", "split"]).arg(survey.join("stonewise.toml"));
    outcome(command.args(["--seed", "2", "--out"]).arg(out))
}

/// The centroid of a stone in the first epoch.
fn centroid(row: &BTreeMap<String, String>) -> nalgebra::Point3<f64> {
    nalgebra::Point3::new(number(row, "x"), number(row, "y"), number(row, "z"))
}

/// Writes a file of edits; `facade`: the unrolled wall on which they were drawn.
fn write_edits(path: &Path, edits: &[String], facade: Option<&str>) {
    let facade = facade.map_or(String::new(), |f| format!("\"facade\": {f},\n"));
    let text = format!(
        "{{\"format\": 1,\n{facade}\"edits\": [\n{}\n]}}\n",
        edits.join(",\n")
    );
    fs::write(path, text).unwrap();
}

/// A merge, a split and a deletion on the wall, and a deletion in a photo of the first epoch.
fn edits_of(before: &Rows, survey: &Path, results: &Path) -> Vec<String> {
    let candidates = inner(before);
    let merged = candidates[0];
    let partner = nearest(before, merged, &[]);
    let gone = nearest(before, *candidates.last().unwrap(), &[merged, partner]);
    let widest = candidates
        .iter()
        .filter(|id| ![merged, partner, gone].contains(id))
        .max_by(|a, b| number(&before[*a], "area_m2").total_cmp(&number(&before[*b], "area_m2")));
    let cut = *widest.unwrap();
    let shown = nearest(before, cut, &[merged, partner, gone]);
    let cameras = read_cameras(&survey.join("epoch1/cameras_metashape.xml")).unwrap();
    let seen = cameras.views.iter().find_map(|v| {
        let pixel = v.project(&centroid(&before[&shown]))?.pixel;
        v.is_inside(pixel).then(|| (v.name.clone(), pixel))
    });
    let (photo, pixel) = seen.unwrap();
    // From border to border of its outline, through its middle.
    let layer = read_polygons(&results.join("stones.gpkg"), "stones_facade").unwrap();
    let outline = layer.iter().find(|f| f.attributes["stone_id"] == cut.to_string());
    let heights = outline.unwrap().polygons[0][0].iter().map(|p| p[1]);
    let low = heights.clone().fold(f64::INFINITY, f64::min) - 0.01;
    let high = heights.fold(f64::NEG_INFINITY, f64::max) + 0.01;
    let [x, _] = place(&before[&cut]);
    let spot = |id: u32| format!("{:?}", place(&before[&id]));
    vec![
        format!(
            "{{\"do\": \"merge\", \"at\": [{}, {}], {SIGNED}}}",
            spot(merged),
            spot(partner)
        ),
        format!("{{\"do\": \"split\", \"line\": [[{x}, {low}], [{x}, {high}]], {SIGNED}}}"),
        format!("{{\"do\": \"delete\", \"at\": [{}], {SIGNED}}}", spot(gone)),
        format!("{{\"do\": \"delete\", \"photo\": \"{photo}\", \"at\": [{pixel:?}], {SIGNED}}}"),
    ]
}

#[test]
fn halves_have_the_stones_of_the_edited_epoch() {
    // Four photos an epoch, so that each half has two.
    let (_dir, survey) = simulated(&SURVEY.replace("columns = 2", "columns = 4"));
    let survey = survey.as_path();
    let results = survey.join("results");
    assert_eq!(run(survey, &results, &[]).0, 0);
    let found = rows(&results.join("stones.csv"));
    let mut edits = edits_of(&found, survey, &results);
    edits.push(format!(
        "{{\"do\": \"delete\", \"epochs\": [\"epoch 2\"], \"at\": [[-3.0, 0.5]], {SIGNED}}}"
    ));
    let (file, project) = (survey.join("edits.json"), survey.join("stonewise.toml"));
    write_edits(&file, &edits[..4], None);
    let text = fs::read_to_string(&project).unwrap() + "\n[edits]\nfile = \"edits.json\"\n";
    fs::write(&project, text).unwrap();
    let (code, log) = run(survey, &results, &[]);
    assert_eq!(code, 0, "{log}");
    let whole = rows(&results.join("stones.csv"));
    assert_eq!(found.len(), whole.len() + 2, "a merge, a split, two deletions");

    // With half of the points, another stone may be the leftmost one: the file must have `facade`.
    let halves = survey.join("halves");
    let (code, log) = split(survey, &halves);
    assert_eq!(code, 2, "{log}");
    assert!(
        log.contains("edits.json:3: edit 1 is in metres") && log.contains("facade.json"),
        "{log}"
    );
    let facade = fs::read_to_string(results.join("data/facade.json")).unwrap();
    write_edits(&file, &edits, Some(&facade));
    let (code, log) = split(survey, &halves);
    assert_eq!(code, 0, "{log}");
    let carried: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(halves.join("edits.json")).unwrap()).unwrap();
    let carried = carried["edits"].as_array().unwrap();
    assert_eq!(carried.len(), 4, "that of the other epoch stays behind");
    let (photo, half) = (
        carried[3]["photo"].as_str().unwrap(),
        carried[3]["epoch"].as_str().unwrap(),
    );
    let folder = halves.join(half.replace(' ', "")).join("images");
    let has = |name: &str| {
        fs::read_dir(&folder)
            .unwrap()
            .any(|e| e.unwrap().path().file_stem() == Path::new(name).file_stem())
    };
    assert!(has(photo), "{photo} is not in {half}");

    let (code, log) = run(&halves, &halves.join("results"), &[]);
    assert_eq!(code, 0, "{log}");
    let both = rows(&halves.join("results/stones.csv"));
    // Half of the photos show some stones too badly to be found, but none that the edits took away.
    assert!(both.len() + 3 >= whole.len(), "{} of {}", both.len(), whole.len());
    for row in both.values() {
        let near = |other: &&BTreeMap<String, String>| (centroid(other) - centroid(row)).norm() < SAME_M;
        let same: Vec<_> = whole.values().filter(near).collect();
        let [stone] = same[..] else {
            panic!("{} stones at {row:?}", same.len())
        };
        let points = number(row, "points_1") + number(row, "points_2");
        let share = points / number(stone, "points_1");
        assert!((0.85..1.15).contains(&share), "{share} of the points of {row:?}");
        assert_eq!(row["edited"], stone["edited"]);
    }
    let edited = |stones: &Rows| stones.values().filter(|r| !r["edited"].is_empty()).count();
    assert_eq!((edited(&both), edited(&whole)), (3, 3), "one merged, two parts");

    // A photo of the other epoch is in neither half.
    edits.push(edits[3].replace("\"photo\"", "\"epoch\": \"epoch 2\", \"photo\""));
    write_edits(&file, &edits, Some(&facade));
    let (code, log) = split(survey, &halves);
    assert_eq!(code, 3, "{log}");
    assert!(
        log.contains("left out: edits.json, edit 6 (line ") && log.contains("epoch \"epoch 2\""),
        "{log}"
    );
}
