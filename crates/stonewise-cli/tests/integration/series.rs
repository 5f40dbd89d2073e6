//! A series of four epochs: its tables, its answers and its section in the report.

use crate::support::stones::{number, rows};
use crate::support::{outcome, run, simulated, stonewise};
use nalgebra::{Point3, Vector3};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use stonewise_io::cloud::{CloudError, read_cloud, write_points_laz};
use stonewise_io::table::{Table, read_parquet};

/// The wall and its noise; `seed`: of the noise.
fn params(seed: u64) -> String {
    format!(
        "name = \"Series wall\"\n[scene]\nseed = {seed}\n[scene.wall]\nwidth_m = 1.6\nheight_m = 1.0\nseed = 3\n\
         [scene.tls]\nspacing_m = 0.008\n[photos]\ncolumns = 2\nrows = 1\nwidth = 800\nheight = 600\nfocal_px = 1100.0\n\
         distance_m = 5.0\n"
    )
}

/// Removes the points of the stone nearest to the middle of the wall, and of its joints, from a cloud; returns its
/// place.
fn hide(survey: &Path, cloud: &Path) -> Point3<f64> {
    let truth = rows(&survey.join("truth/stones.csv"));
    let middle = |row: &BTreeMap<String, String>| number(row, "cy").hypot(number(row, "cz") - 0.5);
    let stone = truth
        .values()
        .min_by(|a, b| middle(a).total_cmp(&middle(b)))
        .unwrap();
    let [x, y, z, width, height] = ["cx", "cy", "cz", "width", "height"].map(|name| number(stone, name));
    let middle = Point3::new(x, y, z);
    let half = Vector3::new(1.0, 0.5 * width + 0.02, 0.5 * height + 0.02);
    let mut points: Vec<Point3<f64>> = Vec::new();
    read_cloud(cloud, 1 << 20, |chunk| {
        let is_left = |p: &&Point3<f64>| (0..3).any(|k| (p[k] - middle[k]).abs() > half[k]);
        points.extend(chunk.positions.iter().filter(is_left));
        Ok::<(), CloudError>(())
    })
    .unwrap();
    write_points_laz(cloud, None, &points, &[]).unwrap();
    middle
}

/// Four surveys of one wall that stands still, as one project; the reference is the second, and misses the stone at the
/// place that is returned.
fn project(dir: &Path) -> Point3<f64> {
    let mut text =
        "[project]\nname = \"Series wall\"\nreference = \"2020-04\"\n[conditions]\nfile = \"levels.csv\"\n\
                    [[instruments]]\nfile = \"targets.csv\"\nuse = true\n[registration.photos]\nenabled = false\n"
            .to_owned();
    let dates = ["2019-10-01", "2020-04-01", "2020-10-01", "2021-04-01"];
    for (survey, seed) in [3, 4].into_iter().enumerate() {
        let (_kept, made) = simulated(&params(seed));
        crate::support::copy_tree(&made, &dir.join(format!("s{survey}")));
    }
    for (i, date) in dates.iter().enumerate() {
        let (survey, epoch) = (i / 2, 1 + i % 2);
        let at = format!("s{survey}/epoch{epoch}");
        text += &format!(
            "[[epochs]]\nname = \"{}\"\ndate = {date}\nclouds = [\"{at}/cloud_tls.laz\"]\nimages = \"{at}/images\"\n\
             cameras = \"{at}/cameras_metashape.xml\"\nmasks = \"s{survey}/masks/epoch{epoch}.json\"\n",
            &date[..7]
        );
    }
    for date in &dates[1..3] {
        let epoch = &date[..7];
        text += &format!("[[instruments]]\nnetwork = \"network.csv\"\nepoch = \"{epoch}\"\nuse = true\n");
    }
    fs::write(dir.join("stonewise.toml"), text).unwrap();
    let levels = "date,level_m\n2019-09-30,10\n2019-10-02,12\n2020-04-01,8\n2020-10-01,14\n2021-04-01,9\n";
    fs::write(dir.join("levels.csv"), levels).unwrap();
    // Five targets that stand still; the last has no reading of the newest epoch.
    let mut targets = "name,x,y,z,date,dx,dy,dz,sd_x,sd_y,sd_z\n".to_owned();
    let places = [[-0.6, 0.2], [0.6, 0.2], [0.0, 0.8], [-0.5, 0.7], [0.5, 0.7]];
    for (i, [y, z]) in places.iter().enumerate() {
        for date in &dates[..if i == 4 { 3 } else { 4 }] {
            targets += &format!("T{i},0,{y},{z},{date},0,0,0,0.0003,0.0003,0.0003\n");
        }
    }
    fs::write(dir.join("targets.csv"), targets).unwrap();
    // The reference and the third epoch as a network, with a pillar off the wall.
    let mut network = "name,x,y,z\npillar,50,0,0\n".to_owned();
    for (i, [y, z]) in places.iter().enumerate() {
        network += &format!("N{i},0,{y},{z}\n");
    }
    let covariance = |row: usize| "0 ".repeat(row) + "9e-8\n";
    fs::write(dir.join("network.csv"), network).unwrap();
    fs::write(
        dir.join("network.cov"),
        (0..18).map(covariance).collect::<String>(),
    )
    .unwrap();
    hide(&dir.join("s0"), &dir.join("s0/epoch2/cloud_tls.laz"))
}

/// The rows of the stone that the reference misses: measured from the first epoch on, beside the others in the same
/// tables.
fn check_hidden(series: &Table, trends: &Table, place: &Point3<f64>) {
    let since = series.required::<String>("since").unwrap();
    let (epochs, states) = (
        series.required::<String>("epoch").unwrap(),
        series.required::<String>("state").unwrap(),
    );
    let stones = series.required::<u32>("stone_id").unwrap();
    let [x, y, z] = ["x", "y", "z"].map(|name| series.required::<f64>(name).unwrap());
    let is_there = |i: &usize| (Point3::new(x[*i], y[*i], z[*i]) - place).norm() < 0.1;
    let found: Vec<usize> = (0..since.len())
        .filter(|i| since[*i] == "2019-10" && is_there(i))
        .collect();
    let of_rows: Vec<(&str, &str)> = found
        .iter()
        .map(|&i| (epochs[i].as_str(), states[i].as_str()))
        .collect();
    assert_eq!(of_rows, [("2020-10", "seen"), ("2021-04", "seen")]);
    let [dx, dy, dz] = ["dx", "dy", "dz"].map(|name| reals(series, name));
    let motion = |i: usize| Some(Vector3::new(dx[i]?, dy[i]?, dz[i]?));
    assert!(found.iter().all(|&i| motion(i).unwrap().norm() < 3e-3));
    let (own, before) = (reals(series, "cov_xx"), reals(series, "cov_prev_xx"));
    // The epoch before the third is the reference, which misses it.
    assert!(before[found[0]].is_none() && before[found[1]].unwrap() < 2.0 * own[found[1]].unwrap());
    let trended = trends.required::<u32>("stone_id").unwrap();
    let row = trended.iter().position(|id| *id == stones[found[0]]).unwrap();
    assert_eq!(trends.optional::<u32>("epochs").unwrap()[row], Some(3));
    assert!(reals(trends, "v_out")[row].unwrap().abs() < 2e-3);
}

fn reals(table: &Table, name: &str) -> Vec<Option<f64>> {
    table.optional::<f64>(name).unwrap()
}

#[test]
fn a_series_has_its_tables_its_answers_and_its_section() {
    let (dir, out) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let hidden = project(dir.path());
    let (code, log) = run(dir.path(), out.path(), &[]);
    assert!([0, 3].contains(&code), "{log}");

    let series = read_parquet(&out.path().join("data/series.parquet")).unwrap();
    let epochs = series.required::<String>("epoch").unwrap();
    assert_eq!(epochs[0], "2019-10");
    let since = series.required::<String>("since").unwrap();
    let [own, before] = ["cov_xx", "cov_prev_xx"].map(|name| reals(&series, name));
    let of = |epoch: &str| -> Vec<usize> {
        let of_reference = |i: &usize| epochs[*i] == epoch && since[*i] == "2020-04";
        (0..epochs.len()).filter(of_reference).collect()
    };
    // There is nothing before the first epoch; before the third lies the reference; the fourth is free of it.
    assert!(of("2019-10").iter().all(|&i| before[i].is_none()));
    assert!(of("2020-10").iter().all(|&i| before[i] == own[i]));
    let known: Vec<usize> = of("2021-04")
        .into_iter()
        .filter(|&i| before[i].is_some())
        .collect();
    assert!(known.len() > 5);

    let trends = read_parquet(&out.path().join("data/trends.parquet")).unwrap();
    let velocities = reals(&trends, "v_out");
    assert!(velocities.len() > of("2021-04").len());
    check_hidden(&series, &trends, &hidden);
    let known: Vec<f64> = velocities.into_iter().flatten().collect();
    assert!(
        known.len() > 5 && known.iter().all(|v| v.abs() < 2e-3),
        "{known:?}"
    );
    assert!(reals(&trends, "season_cos_out").iter().all(Option::is_none));

    let json = |name: &str| -> Value {
        serde_json::from_str(&fs::read_to_string(out.path().join(name)).unwrap()).unwrap()
    };
    let (found, verdict, record) = (json("data/trends.json"), json("verdict.json"), json("run.json"));
    assert_eq!(
        found["epochs"],
        serde_json::json!(["2019-10", "2020-04", "2020-10", "2021-04"])
    );
    assert_eq!(found["terms"], serde_json::json!(["trend"]));
    let text = "4 epochs are too few for level: it takes 5";
    assert!(
        found["not_separable"]
            .as_array()
            .unwrap()
            .iter()
            .any(|t| t["text"] == text),
        "{found}"
    );
    for answer in ["as_predicted", "as_in_the_past"] {
        assert_eq!(verdict["series"][answer]["answer"], "yes", "{verdict}");
    }
    for answer in ["trend", "anomaly"] {
        assert_eq!(verdict["series"][answer]["answer"], "no", "{verdict}");
    }
    check_instruments(&json("data/instruments.json"), &record);
    let levels: Vec<&Value> = record["epochs"]
        .as_array()
        .unwrap()
        .iter()
        .map(|e| &e["conditions"]["level_m"])
        .collect();
    assert_eq!(levels, [8.0, 11.0, 14.0, 9.0]);
    let sentence = verdict["series"]["sentence"].as_str().unwrap();
    assert!(log.contains(sentence), "{log}");
    let page = fs::read_to_string(out.path().join("report.html")).unwrap();
    let page = page.replace('\u{a0}', " ");
    assert!(page.contains("<section id=\"series\">") && page.contains(sentence) && page.contains(text));
    assert!(page.contains("<section id=\"instruments\">"));
    let yearly = fs::read_to_string(out.path().join("yearly.html")).unwrap();
    assert!(
        yearly.contains("4 Comparison with prediction") && yearly.contains("T4 ("),
        "{yearly}"
    );
    let rows = |name: &str| {
        fs::read_to_string(out.path().join("data/report").join(name))
            .unwrap()
            .lines()
            .count()
    };
    assert_eq!((rows("epochs.csv"), rows("answers.csv")), (5, 5));
}

/// Targets that stand still, as the wall does, agree with it and fix the datum, which is unknown without them.
fn check_instruments(found: &Value, record: &Value) {
    let epochs = found["epochs"].as_array().unwrap();
    assert_eq!(epochs.len(), 3);
    for (epoch, count) in epochs.iter().zip([5, 10, 4]) {
        let compared = epoch["compared"].as_array().unwrap();
        assert_eq!(compared.len(), count);
        assert!(
            compared
                .iter()
                .all(|c| c["agrees"] == true && c["stones"][0].is_u64()),
            "{epoch}"
        );
        assert_eq!(epoch["datum"], "observed");
        assert_eq!(record["datum"][epoch["epoch"].as_str().unwrap()], "instruments");
    }
    assert_eq!(epochs[1]["left_out"][0]["name"], "pillar");
    assert_eq!(epochs[1]["left_out"][0]["code"], "no_stones");
    assert_eq!(epochs[2]["left_out"][0]["name"], "T4");
    assert_eq!(epochs[2]["left_out"][0]["code"], "after_readings");
}

#[test]
fn mistakes_in_the_file_of_conditions_are_named_by_check() {
    let dir = tempfile::tempdir().unwrap();
    let cloud = "x y z\n0 0 0\n";
    fs::write(dir.path().join("a.xyz"), cloud).unwrap();
    fs::write(
        dir.path().join("levels.csv"),
        "date,level_m\n2019-10-01,1\n2019-10-02,1.5m\n",
    )
    .unwrap();
    let text = "[project]\nname = \"Wall\"\n[conditions]\nfile = \"levels.csv\"\n[[epochs]]\nname = \"a\"\nclouds = [\"a.xyz\"]\n\
                [[epochs]]\nname = \"b\"\nclouds = [\"a.xyz\"]\n";
    fs::write(dir.path().join("stonewise.toml"), text).unwrap();
    let (code, said) = outcome(stonewise().arg("check").arg(dir.path().join("stonewise.toml")));
    assert_eq!(code, 2, "{said}");
    let message = "levels.csv:3: level_m: \"1.5m\" is no number: leave the cell empty where there is none";
    assert!(said.contains(message), "{said}");
}
