//! Files with which CloudCompare and PDAL repeat a comparison along normals.

use crate::error::Result;
use crate::files::{write_readable_json, write_text};
use crate::results::names::PairFile;
use nalgebra::{Point3, Vector3};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use stonewise_core::change::{ChangeField, M3c2Params, params_to_cloudcompare};

/// CloudCompare's parameters.
pub const CLOUDCOMPARE_PARAMS: &str = "m3c2_cloudcompare.txt";
/// The commands, for a shell.
pub const CLOUDCOMPARE_COMMANDS: &str = "m3c2_cloudcompare.sh";
/// PDAL's pipeline.
pub const PDAL_PIPELINE: &str = "m3c2_pdal.json";

/// Writes the recipes beside `m3c2.laz`, whose points are the core points of all of them: for CloudCompare always, for
/// PDAL unless `robust` is set, which PDAL does not have; then a pipeline of an earlier comparison is removed.
pub fn write_m3c2_recipes(
    dir: &Path,
    clouds: [&[PathBuf]; 2],
    params: &M3c2Params,
    field: &ChangeField,
) -> Result<()> {
    let absolute = |cloud: &PathBuf| std::path::absolute(cloud).map_err(crate::Error::io("finding", cloud));
    let [first, later] = clouds.map(|clouds| clouds.iter().map(absolute).collect::<Result<Vec<_>>>());
    let (first, later) = (first?, later?);
    let clouds = [first.as_slice(), later.as_slice()];
    // How many normals more lie on one side of each axis than on the other.
    let sides: Vector3<f64> = field.points.iter().map(|p| p.normal.map(f64::signum)).sum();
    write_text(
        &dir.join(CLOUDCOMPARE_PARAMS),
        &params_to_cloudcompare(params, &sides),
    )?;
    let middle = field.points.first().map_or(Point3::origin(), |p| p.position);
    write_text(
        &dir.join(CLOUDCOMPARE_COMMANDS),
        &cloudcompare_commands(clouds, &middle),
    )?;
    let pipeline = dir.join(PDAL_PIPELINE);
    if params.robust {
        let removed = std::fs::remove_file(&pipeline);
        return match removed {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                Err(crate::Error::io("removing the pipeline", &pipeline)(e))
            }
            _ => Ok(()),
        };
    }
    write_readable_json(&pipeline, &pdal_pipeline(clouds, params, &sides))
}

/// Both epochs are brought to one shift, so that CloudCompare's single precision holds them, and merged if there are
/// several clouds; then they are compared.
fn cloudcompare_commands(clouds: [&[PathBuf]; 2], near: &Point3<f64>) -> String {
    let shift = near.map(|v| -(v / 100.0).round() * 100.0);
    let shift = format!("-GLOBAL_SHIFT {} {} {}", shift.x, shift.y, shift.z);
    let mut text = String::from(
        "#!/bin/sh\n# Repeats m3c2.laz: the same core points and parameters. CloudCompare needs its plugins for M3C2 and LAS.\n\
         # The distances go to m3c2_epoch1_M3C2.asc.\nset -e\ncd \"$(dirname \"$0\")\"\n",
    );
    let open = |path: &Path| format!(" -O {shift} {}", quoted(path));
    for (epoch, clouds) in clouds.into_iter().enumerate() {
        let merge = if clouds.len() > 1 { " -MERGE_CLOUDS" } else { "" };
        let opened: String = clouds.iter().map(|c| open(c)).collect();
        let name = format!("m3c2_epoch{}.bin", epoch + 1);
        text += &format!(
            "CloudCompare -SILENT -AUTO_SAVE OFF -C_EXPORT_FMT BIN{opened}{merge} -SAVE_CLOUDS FILE {name}\n"
        );
    }
    let core = open(Path::new(PairFile::M3c2Laz.name(1).as_str()));
    text += &format!(
        "CloudCompare -SILENT -NO_TIMESTAMP -C_EXPORT_FMT ASC -PREC 6 -ADD_HEADER -O m3c2_epoch1.bin -O m3c2_epoch2.bin{core} \
         -M3C2 {CLOUDCOMPARE_PARAMS}\n"
    );
    text
}

/// A path as one word of a shell.
fn quoted(path: &Path) -> String {
    format!("'{}'", path.to_string_lossy().replace('\'', r"'\''"))
}

/// Readers of both epochs, merged where there are several, the core points, the filter and a table of its results.
fn pdal_pipeline(clouds: [&[PathBuf]; 2], params: &M3c2Params, sides: &Vector3<f64>) -> Value {
    let mut stages = Vec::new();
    for (epoch, clouds) in clouds.into_iter().enumerate() {
        let tags: Vec<String> = (1..=clouds.len())
            .map(|k| format!("epoch{}_{k}", epoch + 1))
            .collect();
        for (cloud, tag) in clouds.iter().zip(&tags) {
            stages.push(json!({ "filename": cloud.to_string_lossy(), "tag": tag }));
        }
        stages.push(json!({ "type": "filters.merge", "inputs": tags, "tag": format!("epoch{}", epoch + 1) }));
    }
    stages.push(json!({ "type": "readers.las", "filename": PairFile::M3c2Laz.name(1), "tag": "core" }));
    stages.push(json!({
        "type": "filters.m3c2",
        "inputs": ["epoch1", "epoch2", "core"],
        "normal_radius": params.normal_radius_m,
        "cyl_radius": params.cylinder_radius_m,
        "cyl_halflen": params.max_depth_m,
        "reg_error": params.registration_error_m,
        "min_points": params.min_points.max(1),
        "orientation": if sides.z < 0.0 { "down" } else { "up" },
    }));
    stages.push(json!({
        "type": "writers.text",
        "filename": "m3c2_pdal.csv",
        "order": "X:4,Y:4,Z:4,m3c2_distance:7,m3c2_uncertainty:7,m3c2_significant:0,m3c2_std_dev1:7,m3c2_std_dev2:7,\
            m3c2_count1:0,m3c2_count2:0",
        "keep_unspecified": false,
    }));
    json!({ "pipeline": stages })
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_core::change::{ChangePoint, params_from_cloudcompare};

    fn field() -> ChangeField {
        ChangeField {
            points: vec![ChangePoint {
                position: Point3::new(354_321.0, 5_612_345.0, 312.0),
                normal: Vector3::new(0.98, 0.0, 0.2),
                distance_m: None,
                detection_limit_m: None,
                spread_m: [None; 2],
                counts: [0; 2],
            }],
        }
    }

    #[test]
    fn both_programs_get_the_clouds_and_parameters_of_the_comparison() {
        let folder = tempfile::tempdir().unwrap();
        let params = M3c2Params {
            normal_radius_m: 0.3,
            cylinder_radius_m: 0.06,
            min_points: 7,
            ddof: 0,
            registration_error_m: 0.002,
            ..M3c2Params::default()
        };
        let first = [PathBuf::from("/s/it's one.laz"), PathBuf::from("/s/two.laz")];
        let second = [PathBuf::from("/s/later.laz")];
        write_m3c2_recipes(folder.path(), [&first, &second], &params, &field()).unwrap();
        let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();

        assert_eq!(
            params_from_cloudcompare(&read(CLOUDCOMPARE_PARAMS)),
            Ok(params.clone())
        );
        let commands = read(CLOUDCOMPARE_COMMANDS);
        let lines: Vec<&str> = { commands.lines() }
            .filter(|l| l.starts_with("CloudCompare"))
            .collect();
        assert_eq!(lines.len(), 3);
        let shift = "-GLOBAL_SHIFT -354300 -5612300 -300";
        assert!(lines[0].contains(&format!(
            "-O {shift} '/s/it'\\''s one.laz' -O {shift} '/s/two.laz' -MERGE_CLOUDS"
        )));
        assert!(!lines[1].contains("MERGE") && lines[1].ends_with("m3c2_epoch2.bin"));
        assert!(lines[2].ends_with(&format!("-O {shift} 'm3c2.laz' -M3C2 m3c2_cloudcompare.txt")));

        let pipeline: Value = serde_json::from_str(&read(PDAL_PIPELINE)).unwrap();
        let stages = pipeline["pipeline"].as_array().unwrap();
        let filter = stages.iter().find(|s| s["type"] == "filters.m3c2").unwrap();
        assert_eq!(
            (&filter["normal_radius"], &filter["cyl_radius"]),
            (&json!(0.3), &json!(0.06))
        );
        assert_eq!(
            (&filter["min_points"], &filter["orientation"]),
            (&json!(7), &json!("up"))
        );
        // Every input is the tag of a stage before the one that names it.
        let mut tags = Vec::new();
        for stage in stages {
            for input in stage["inputs"].as_array().into_iter().flatten() {
                assert!(tags.contains(&input), "{input}");
            }
            tags.extend(stage.get("tag"));
        }

        let robust = M3c2Params {
            robust: true,
            ..params
        };
        write_m3c2_recipes(folder.path(), [&first, &second], &robust, &field()).unwrap();
        assert!(!folder.path().join(PDAL_PIPELINE).exists());
    }
}
