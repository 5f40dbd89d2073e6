//! Corrections by hand on a small simulated survey: what they change, what they leave alone, and the ways
//! into the file.

use crate::support::stones::{SIGNED, inner, nearest, number, place, rows};
use crate::support::{copy_tree, outcome, run, stonewise, survey, survey_results};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use stonewise_io::cameras::read_cameras;
use stonewise_io::layers::{Geometry, Layer, read_polygons, write_geopackage};
use stonewise_io::table::Table;
use tempfile::TempDir;

/// A copy of the survey, and where its results go: they belong to the project file of the copy.
struct Copy {
    _dir: TempDir,
    survey: PathBuf,
    out: PathBuf,
}

impl Copy {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let (survey, out) = (dir.path().join("survey"), dir.path().join("results"));
        copy_tree(self::survey(), &survey);
        Self {
            _dir: dir,
            survey,
            out,
        }
    }

    /// Names these edits in the project.
    fn edit(&self, edits: &[String]) {
        let text = format!("{{\"format\": 1, \"edits\": [\n{}\n]}}\n", edits.join(",\n"));
        fs::write(self.survey.join("edits.json"), text).unwrap();
        let project = self.survey.join("stonewise.toml");
        let text = fs::read_to_string(&project).unwrap() + "\n[edits]\nfile = \"edits.json\"\n";
        fs::write(&project, text).unwrap();
    }

    fn run(&self) -> (i32, String) {
        run(&self.survey, &self.out, &[])
    }
}

fn step(out: &Path, name: &str) -> serde_json::Value {
    let text = fs::read_to_string(out.join("run.json")).unwrap();
    let run: serde_json::Value = serde_json::from_str(&text).unwrap();
    let steps = run["steps"].as_array().unwrap().clone();
    steps.into_iter().find(|s| s["step"] == name).unwrap()
}

#[test]
fn edits_change_what_they_name_and_leave_the_rest_alone() {
    let before = rows(&survey_results().join("stones.csv"));
    let candidates = inner(&before);
    let merged = candidates[0];
    let partner = nearest(&before, merged, &[]);
    let gone = nearest(&before, *candidates.last().unwrap(), &[merged, partner]);
    let split = *candidates
        .iter()
        .filter(|id| ![merged, partner, gone].contains(id))
        .max_by(|a, b| number(&before[*a], "area_m2").total_cmp(&number(&before[*b], "area_m2")))
        .unwrap();
    let line = |id: u32| {
        // From border to border of its outline, through its middle.
        let layer = read_polygons(&survey_results().join("stones.gpkg"), "stones_facade").unwrap();
        let of = |f: &&stonewise_io::layers::PolygonFeature| f.attributes["stone_id"] == id.to_string();
        let ring = layer.iter().find(of).unwrap().polygons[0][0].clone();
        let [x, _] = place(&before[&id]);
        let low = ring.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min) - 0.01;
        let high = ring.iter().map(|p| p[1]).fold(f64::NEG_INFINITY, f64::max) + 0.01;
        format!("[[{x}, {low}], [{x}, {high}]]")
    };
    let spot = |id: u32| format!("{:?}", place(&before[&id]));
    let edits = [
        format!(
            "{{\"do\": \"merge\", \"at\": [{}, {}], {SIGNED}}}",
            spot(merged),
            spot(partner)
        ),
        format!("{{\"do\": \"split\", \"line\": {}, {SIGNED}}}", line(split)),
        format!("{{\"do\": \"delete\", \"at\": [{}], {SIGNED}}}", spot(gone)),
    ];
    let copy = Copy::new();
    assert_eq!(copy.run().0, 0);
    copy.edit(&edits);
    let (code, text) = copy.run();
    assert_eq!(code, 0, "{text}");
    assert!(text.contains("edits: 3 by hand"), "{text}");
    let (survey, out) = (&copy.survey, &copy.out);
    for kept in [
        "ingest-1",
        "segment-1",
        "label-1",
        "stones-1",
        "label-2",
        "m3c2-2",
    ] {
        assert_eq!(step(out, kept)["resumed"], true, "{kept}");
    }
    assert_eq!(step(out, "register-2")["resumed"], false);

    let after = rows(&out.join("stones.csv"));
    let new: BTreeSet<u32> = after
        .keys()
        .copied()
        .filter(|id| !before.contains_key(id))
        .collect();
    let lost: BTreeSet<u32> = before
        .keys()
        .copied()
        .filter(|id| !after.contains_key(id))
        .collect();
    assert_eq!(lost, BTreeSet::from([merged.max(partner), gone]));
    assert_eq!(new.len(), 1, "{new:?}");
    let whole = merged.min(partner);
    let sum = |column: &str, of: &[u32]| of.iter().map(|id| number(&before[id], column)).sum::<f64>();
    assert_eq!(
        number(&after[&whole], "points_1"),
        sum("points_1", &[merged, partner])
    );
    let part = *new.first().unwrap();
    let parts = number(&after[&split], "points_1") + number(&after[&part], "points_1");
    assert_eq!(parts, sum("points_1", &[split]));
    let [x, _] = place(&before[&split]);
    assert!(
        (place(&after[&split])[0] - x) * (place(&after[&part])[0] - x) < 0.0,
        "one on either side of the line"
    );
    for (id, edit) in [(whole, "1"), (split, "2"), (part, "2")] {
        assert_eq!(after[&id]["edited"], edit);
        // Merged and split alike in both epochs, they are measured.
        assert_eq!(after[&id]["status"], "ok", "stone {id}");
    }
    let touched = [merged, partner, gone, split, part];
    let mut others = 0;
    for (id, row) in after.iter().filter(|s| !touched.contains(s.0)) {
        others += 1;
        let old = &before[id];
        for column in [
            "x",
            "y",
            "z",
            "points_1",
            "points_2",
            "photos",
            "confidence",
            "matched_id",
            "along_m",
            "up_m",
            "status",
        ] {
            assert_eq!(row[column], old[column], "{column} of stone {id}");
        }
        assert_eq!(row["edited"], "");
        if row["status"] == "ok" {
            for (d, sd) in [("d_along", "sd_along"), ("d_up", "sd_up"), ("d_out", "sd_out")] {
                let change = (number(row, d) - number(old, d)).abs();
                assert!(
                    change <= 3.0 * number(old, sd),
                    "{d} of stone {id} changed by {change} m"
                );
            }
        }
    }
    assert!(others >= 10, "{others}");
    let audit = fs::read_to_string(out.join("data/audit_edits.csv")).unwrap();
    assert_eq!(audit.lines().count(), 1 + 3 * 2, "{audit}");
    let row = format!(
        "1,merge,A. Keller,2026-11-20,seen on site,\"edits.json, edit 1 (line 2)\",facade,epoch 1,{} {},{whole},",
        whole,
        merged.max(partner)
    );
    assert!(audit.contains(&row), "{row}\n{audit}");
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(
        page.contains("Edits by hand") && page.contains("A. Keller"),
        "the report names the edits"
    );

    // Another reason is no other edit: nothing is done again but the audit.
    let file = survey.join("edits.json");
    fs::write(
        &file,
        fs::read_to_string(&file)
            .unwrap()
            .replace("seen on site", "seen twice"),
    )
    .unwrap();
    let stones = fs::read(out.join("stones.csv")).unwrap();
    assert_eq!(copy.run().0, 0);
    assert_eq!(step(out, "register-2")["resumed"], true);
    assert!(
        fs::read_to_string(out.join("data/audit_edits.csv"))
            .unwrap()
            .contains("seen twice")
    );
    assert_eq!(fs::read(out.join("stones.csv")).unwrap(), stones);

    // Without the edits everything is as it was.
    let project = survey.join("stonewise.toml");
    let text = fs::read_to_string(&project).unwrap();
    fs::write(&project, text.split("\n[edits]").next().unwrap()).unwrap();
    assert_eq!(copy.run().0, 0);
    for file in [
        "stones.csv",
        "data/stones.parquet",
        "stones.gpkg",
        "data/outlines.json",
        "data/epoch1/cloud_tls.laz",
    ] {
        assert!(
            fs::read(out.join(file)).unwrap() == fs::read(survey_results().join(file)).unwrap(),
            "{file}"
        );
    }
    assert!(!out.join("data/audit_edits.csv").exists() && !out.join("data/facade.json").exists());
}

#[test]
fn a_stone_is_deleted_in_a_photo_and_drawn_anew_and_an_edit_without_effect_is_named() {
    let before = rows(&survey_results().join("stones.csv"));
    let gone = inner(&before)[2];
    let cameras = read_cameras(&survey().join("epoch2/cameras_metashape.xml")).unwrap();
    let centroid = nalgebra::Point3::new(
        number(&before[&gone], "x"),
        number(&before[&gone], "y"),
        number(&before[&gone], "z"),
    );
    let seen = cameras.views.iter().find_map(|v| {
        let pixel = v.project(&centroid)?.pixel;
        v.is_inside(pixel).then(|| (v.name.clone(), pixel))
    });
    let (photo, pixel) = seen.unwrap();
    let [x, y] = place(&before[&gone]);
    let half = 0.05;
    let edits = [
        format!(
            "{{\"do\": \"delete\", \"photo\": \"{photo}\", \"epoch\": \"epoch 2\", \"at\": [{pixel:?}], {SIGNED}}}"
        ),
        format!(
            "{{\"do\": \"add\", \"outline\": [[{}, {}], [{}, {}], [{}, {}], [{}, {}]], {SIGNED}}}",
            x - half,
            y - half,
            x + half,
            y - half,
            x + half,
            y + half,
            x - half,
            y + half
        ),
        format!("{{\"do\": \"delete\", \"at\": [[-3.0, 0.5]], {SIGNED}}}"),
        format!("{{\"do\": \"delete\", \"photo\": \"nowhere.jpg\", \"at\": [[3.0, 0.5]], {SIGNED}}}"),
    ];
    let copy = Copy::new();
    copy.edit(&edits);
    let (code, text) = copy.run();
    assert_eq!(code, 3, "{text}");
    assert!(
        text.contains(
            "skipped: edits.json, edit 3 (line 4): delete has no effect; epoch 1: no stone at (-3.00, 0.50) m"
        ),
        "{text}"
    );
    assert!(
        text.contains("edit 4 (line 5)") && text.contains("no photo of the epoch is named \"nowhere.jpg\""),
        "{text}"
    );
    let after = rows(&copy.out.join("stones.csv"));
    assert!(!after.contains_key(&gone));
    let added = after.values().find(|r| r["edited"] == "2").unwrap();
    let [a, u] = place(added);
    assert!(
        (a - x).hypot(u - y) < 0.02,
        "the new stone lies where it was drawn"
    );
    assert_eq!(
        (added["photos"].as_str(), number(added, "confidence")),
        ("0", 0.0)
    );
    assert!(!added["points_2"].is_empty(), "it is drawn in both epochs");
}

#[test]
fn the_detector_outlines_the_stone_in_a_box() {
    let before = rows(&survey_results().join("stones.csv"));
    let features = read_polygons(&survey_results().join("stones.gpkg"), "stones_facade").unwrap();
    // A bench and a railing hide parts of the lowest course.
    let is_whole = |id: &u32| place(&before[id])[1] > 0.3;
    let gone: Vec<u32> = inner(&before).into_iter().filter(is_whole).step_by(4).collect();
    let mut edits = Vec::new();
    for id in &gone {
        let of = |f: &&stonewise_io::layers::PolygonFeature| f.attributes["stone_id"] == id.to_string();
        let ring = &features.iter().find(of).unwrap().polygons[0][0];
        let side = |axis: usize| {
            let values = ring.iter().map(|p| p[axis]);
            let [low, high] = [values.clone().reduce(f64::min), values.reduce(f64::max)].map(Option::unwrap);
            [low - 0.05 * (high - low), high + 0.05 * (high - low)]
        };
        let ([x0, x1], [y0, y1]) = (side(0), side(1));
        edits.push(format!(
            "{{\"do\": \"delete\", \"at\": [{:?}], {SIGNED}}}",
            place(&before[id])
        ));
        edits.push(format!(
            "{{\"do\": \"add\", \"box\": [[{x0}, {y1}], [{x1}, {y0}]], {SIGNED}}}"
        ));
    }
    let copy = Copy::new();
    copy.edit(&edits);
    let (code, text) = copy.run();
    assert_eq!(code, 0, "{text}");
    let after = rows(&copy.out.join("stones.csv"));
    for (id, edit) in gone.iter().zip((2..).step_by(2)) {
        assert!(!after.contains_key(id));
        let added = after.values().find(|r| r["edited"] == edit.to_string()).unwrap();
        let ([a, u], [x, y]) = (place(added), place(&before[id]));
        let share = number(added, "points_1") / number(&before[id], "points_1");
        println!(
            "stone {id}: {:.3} m off, {share:.2} of its points",
            (a - x).hypot(u - y)
        );
        assert!(
            (a - x).hypot(u - y) < 0.03 && (0.75..1.15).contains(&share),
            "stone {id}: {share}"
        );
        assert_eq!(added["status"], "ok", "stone {id}");
    }
}

#[test]
fn the_layer_of_the_geopackage_comes_back_as_edits() {
    let before = rows(&survey_results().join("stones.csv"));
    let features = read_polygons(&survey_results().join("stones.gpkg"), "stones_facade").unwrap();
    let candidates = inner(&before);
    let (merged, gone) = (candidates[0], *candidates.last().unwrap());
    let partner = nearest(&before, merged, &[gone]);
    let split = nearest(
        &before,
        candidates[candidates.len() / 2],
        &[merged, partner, gone],
    );
    let bounds = |id: u32| {
        let of = |f: &&stonewise_io::layers::PolygonFeature| f.attributes["stone_id"] == id.to_string();
        let ring = &features.iter().find(of).unwrap().polygons[0][0];
        let fold =
            |axis: usize, pick: fn(f64, f64) -> f64| ring.iter().map(|p| p[axis]).reduce(pick).unwrap();
        [
            fold(0, f64::min),
            fold(1, f64::min),
            fold(0, f64::max),
            fold(1, f64::max),
        ]
    };
    let boxed = |[x0, y0, x1, y1]: [f64; 4]| vec![[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
    let (mut ids, mut rings, mut status) = (Vec::new(), Vec::new(), Vec::new());
    let mut push = |id: Option<u32>, ring: Vec<[f64; 2]>, word: &str| {
        ids.push(id);
        rings.push(
            ring.into_iter()
                .map(|[x, y]| nalgebra::Point3::new(x, y, 0.0))
                .collect::<Vec<_>>(),
        );
        status.push(word.to_owned());
    };
    for feature in &features {
        let id: u32 = feature.attributes["stone_id"].parse().unwrap();
        let ring = feature.polygons[0][0].clone();
        if id == merged {
            let (a, b) = (bounds(merged), bounds(partner));
            push(
                Some(id),
                boxed([a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])]),
                "ok",
            );
        } else if id == split {
            let [x0, y0, x1, y1] = bounds(split);
            let middle = 0.4 * x0 + 0.6 * x1;
            push(Some(id), boxed([x0, y0, middle, y1]), "ok");
            push(Some(id), boxed([middle, y0, x1, y1]), "ok");
        } else if id != partner && id != gone {
            push(Some(id), ring, "ok");
        }
    }
    push(None, boxed([-2.0, -2.0, -1.5, -1.5]), "ok");
    push(None, boxed([-4.0, -2.0, -3.5, -1.5]), "ignore");
    let mut attributes = Table::new();
    attributes.push("stone_id", "", "stone_id", ids).unwrap();
    attributes.push("status", "", "status", status).unwrap();
    let layer = Layer {
        name: "stones_facade".into(),
        title: "Stones".into(),
        description: String::new(),
        geometry: Geometry::Polygon,
        crs: None,
        attributes,
        vertices: rings,
        styles: Vec::new(),
    };
    let dir = tempfile::tempdir().unwrap();
    let edited = dir.path().join("edited.gpkg");
    write_geopackage(&edited, &[layer], "2026-11-20T00:00:00.000Z").unwrap();
    let file = dir.path().join("edits.json");
    let import = |source: &Path, more: &[&str]| {
        let mut command = stonewise();
        command
            .args(["edits", "import"])
            .arg(source)
            .arg("--out")
            .arg(&file);
        command
            .args(["--who", "A. Keller", "--why", "drawn in QGIS", "--results"])
            .arg(survey_results());
        outcome(command.args(more))
    };
    let (code, text) = import(&edited, &[]);
    assert_eq!(code, 0, "{text}");
    let json: serde_json::Value = serde_json::from_str(&fs::read_to_string(&file).unwrap()).unwrap();
    let words: Vec<&str> = json["edits"]
        .as_array()
        .unwrap()
        .iter()
        .map(|e| e["do"].as_str().unwrap())
        .collect();
    assert_eq!(words, ["merge", "delete", "split", "add", "ignore"], "{json:#}");
    assert_eq!(json["edits"][2]["outline"].as_array().unwrap().len(), 4);
    assert!(json["facade"]["stretches"].is_array());
    assert_eq!(import(&edited, &[]).0, 1, "a file that is there is not replaced");
    let (code, text) = import(&survey_results().join("stones.gpkg"), &["--append"]);
    assert!(code == 0 && text.contains("nothing was edited"), "{text}");
    let listed = stonewise().args(["edits", "check"]).arg(&file).output().unwrap();
    assert_eq!(String::from_utf8_lossy(&listed.stdout).lines().count(), 6);

    // The run makes of it what was drawn; nothing lies where the last two are.
    let copy = Copy::new();
    copy.edit(&[]);
    fs::copy(&file, copy.survey.join("edits.json")).unwrap();
    let (code, text) = copy.run();
    assert_eq!(code, 3, "{text}");
    assert!(
        text.contains("edit 4 (line") && text.contains("edit 5 (line"),
        "{text}"
    );
    let after = rows(&copy.out.join("stones.csv"));
    assert!(!after.contains_key(&gone) && !after.contains_key(&merged.max(partner)));
    assert_eq!(after[&merged.min(partner)]["edited"], "1");
    assert_eq!(after.values().filter(|r| r["edited"] == "3").count(), 2);
}

#[test]
fn polygons_of_a_coco_editor_are_edits_and_mistakes_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let coco = dir.path().join("drawn.json");
    let drawn = r#"{"images": [{"id": 1, "file_name": "IMG_1001.jpg"}],
        "categories": [{"id": 1, "name": "stone"}, {"id": 2, "name": "Merge"}, {"id": 3, "name": "ignore"}],
        "annotations": [
          {"id": 1, "image_id": 1, "category_id": 1, "segmentation": [[0, 0, 9, 0, 9, 9]]},
          {"id": 2, "image_id": 1, "category_id": 2, "segmentation": [[10, 10, 90, 10, 90, 50]], "attributes": {"why": "one block"}},
          {"id": 3, "image_id": 1, "category_id": 3, "segmentation": [[0, 0, 9, 0, 9, 9], [20, 0, 29, 0, 29, 9]]}]}"#;
    fs::write(&coco, drawn).unwrap();
    let file = dir.path().join("edits.json");
    let import = |source: &Path, out: &Path| {
        let mut command = stonewise();
        command
            .args(["edits", "import"])
            .arg(source)
            .args(["--epoch", "epoch 2", "--who", "B", "--why", "plants"]);
        outcome(command.arg("--out").arg(out))
    };
    let (code, text) = import(&coco, &file);
    assert!(
        code == 0 && text.contains("annotations of other categories, which are no edits: 1"),
        "{text}"
    );
    let json: serde_json::Value = serde_json::from_str(&fs::read_to_string(&file).unwrap()).unwrap();
    let edits = json["edits"].as_array().unwrap();
    assert_eq!(edits.len(), 3);
    assert_eq!(
        (edits[0]["do"].as_str(), edits[0]["why"].as_str()),
        (Some("merge"), Some("one block"))
    );
    assert_eq!(
        (edits[2]["why"].as_str(), edits[2]["epoch"].as_str()),
        (Some("plants"), Some("epoch 2"))
    );
    assert!(edits.iter().all(|e| e["photo"] == "IMG_1001.jpg"));
    let bow_tie = drawn.replace("20, 0, 29, 0, 29, 9", "20, 0, 29, 9, 29, 0, 20, 9");
    fs::write(&coco, bow_tie).unwrap();
    let (code, text) = import(&coco, &dir.path().join("other.json"));
    assert!(
        code == 1 && text.contains("edit 3, ignore: its outline crosses itself"),
        "{text}"
    );

    let copy = Copy::new();
    copy.edit(&[format!("{{\"do\": \"delete\", \"at\": [], {SIGNED}}}")]);
    let (code, text) = copy.run();
    assert!(
        code == 2 && text.contains("edits.json:2: edit 1: delete needs"),
        "{text}"
    );
}
