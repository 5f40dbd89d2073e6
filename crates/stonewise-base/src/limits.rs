//! Which values parameters can have.

use crate::settings::Settings;
use toml::Value;

/// Parameters that zero makes useless: sizes, radii, counts, steps.
const POSITIVE: [&str; 22] = [
    "size_m",
    "cell_m",
    "sample_m",
    "splat_spacings",
    "depth_memory_mib",
    "face_radius_m",
    "cell_spacings",
    "min_cell_m",
    "patch_cells",
    "max_step_m",
    "tolerance_m",
    "max_iterations",
    "max_ratio",
    "max_distance_m",
    "plane_neighbours",
    "plane_epsilon",
    "correlation_cell_m",
    "outlier_sigmas",
    "distance_m",
    "megapixels",
    "side_px",
    "spread_rad",
];
/// Parameters that are shares or rates without saying so in their names.
const SHARES: [&str; 4] = ["min_iou", "min_area_ratio", "false_discovery_rate", "min_overlap"];

/// Edges of tiles that can work, metres. Offsets in a tile are single precision: at 100 m they are exact to 3
/// micrometres. Below half a metre a wall of 200 m falls into more than 20,000 files.
const TILE_SIZE_M: [f64; 2] = [0.5, 100.0];

/// The first parameter whose value is impossible: its key, and what it must be.
pub fn impossible(settings: &Settings) -> Option<(String, String)> {
    let (size_m, [least, most]) = (settings.ingest.size_m, TILE_SIZE_M);
    if !(least..=most).contains(&size_m) {
        let message = format!("size_m = {size_m} is not possible: tiles have edges of {least} to {most} m");
        return Some(("size_m".to_owned(), message));
    }
    let all = Value::try_from(settings).ok()?;
    let mut open: Vec<(&str, &Value)> = vec![("", &all)];
    while let Some((key, value)) = open.pop() {
        let number = match value {
            Value::Table(table) => {
                open.extend(table.iter().map(|(k, v)| (k.as_str(), v)));
                continue;
            }
            Value::Integer(number) => *number as f64,
            Value::Float(number) => *number,
            _ => continue,
        };
        let is_share = key.ends_with("_share") || SHARES.contains(&key);
        let wanted = if !number.is_finite() {
            "it must be a finite number"
        } else if POSITIVE.contains(&key) && number <= 0.0 {
            "it must be above 0"
        } else if number < 0.0 {
            "it must not be negative"
        } else if is_share && number > 1.0 {
            "it is a share, 0 to 1"
        } else {
            continue;
        };
        return Some((
            key.to_owned(),
            format!("{key} = {number} is not possible: {wanted}"),
        ));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    #[test]
    fn defaults_are_possible_and_senseless_values_are_named() {
        assert_eq!(impossible(&Settings::default()), None);
        for size_m in [0.0, 0.05, 1e5, f64::NAN] {
            let mut settings = Settings::default();
            settings.ingest.size_m = size_m;
            assert_eq!(impossible(&settings).unwrap().0, "size_m");
        }
        let mut settings = Settings::default();
        settings.label.island_share = 1.5;
        assert!(impossible(&settings).unwrap().1.contains("0 to 1"));
        let mut settings = Settings::default();
        settings.registration.epoch_error_m = Some(-0.001);
        assert_eq!(impossible(&settings).unwrap().0, "epoch_error_m");
        for number in [f64::NAN, f64::INFINITY] {
            settings.registration.epoch_error_m = Some(number);
            assert_eq!(impossible(&settings).unwrap().0, "epoch_error_m");
        }
    }

    #[test]
    fn every_parameter_is_documented() {
        let docs = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/src/project-file.md");
        let text = std::fs::read_to_string(docs).unwrap();
        let settings = serde_json::to_value(Settings::default()).unwrap();
        let mut open = vec![settings];
        let mut keys = 0;
        while let Some(Value::Object(map)) = open.pop() {
            for (key, value) in map {
                if value.is_object() {
                    assert!(
                        text.contains(&format!("{key}]`")),
                        "section {key} is not documented"
                    );
                    open.push(value);
                } else {
                    assert!(
                        text.contains(&format!("| `{key}` | `{value}` |")),
                        "{key} = {value} is not documented so"
                    );
                    keys += 1;
                }
            }
        }
        assert!(keys > 30, "only {keys} parameters found: the search is broken");
    }
}
