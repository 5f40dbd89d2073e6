//! Parameters that a caller gives beside the project file, by the names that the file has for them.

use crate::error::{Error, Result};
use crate::limits::impossible;
use crate::settings::{RENAMED, Settings};
use serde_json::{Map, Value};

impl Settings {
    /// The settings with other parameters, by the names of the tables in the project file.
    ///
    /// # Errors
    /// No such parameter, a value of the wrong kind, an impossible value.
    pub fn with_parameters(&self, parameters: &Map<String, Value>) -> Result<Self> {
        let mut all = serde_json::to_value(self).map_err(|e| Error::Parameters(e.to_string()))?;
        for (table, value) in parameters {
            let table = todays_name(table);
            let mut changed = all.clone();
            merge_into(&mut changed, table, "", value);
            // One table at a time, so that the message can name it.
            let read: std::result::Result<Self, _> = serde_json::from_value(changed.clone());
            if let Err(error) = read {
                return Err(Error::Parameters(format!("{table}: {error}")));
            }
            all = changed;
        }
        let settings: Self = serde_json::from_value(all).map_err(|e| Error::Parameters(e.to_string()))?;
        if let Some((_, message)) = impossible(&settings) {
            return Err(Error::Parameters(message));
        }
        if let Some((key, what)) = settings.segment.tiling.impossible() {
            return Err(Error::Parameters(format!("segment.tiling: {key} {what}")));
        }
        Ok(settings)
    }
}

/// Puts a value into a table: over what is there, key by key where both are tables.
fn merge_into(table: &mut Value, key: &str, path: &str, value: &Value) {
    let Value::Object(map) = table else {
        return;
    };
    let path = match path {
        "" => key.to_owned(),
        path => format!("{path}.{key}"),
    };
    // A diameter takes the place of the radius that says the same.
    if let Some(stem) = key.strip_suffix("_diameter_m") {
        map.remove(&format!("{stem}_radius_m"));
    }
    match (map.get_mut(key), value) {
        (Some(place @ Value::Object(_)), Value::Object(inner)) => {
            for (key, value) in inner {
                let key = match path.as_str() {
                    "registration" if key == "network" => "adjustment",
                    _ => key.as_str(),
                };
                merge_into(place, key, &path, value);
            }
        }
        _ => {
            map.insert(key.to_owned(), value.clone());
        }
    }
}

/// The name that a table of the project file has today.
fn todays_name(table: &str) -> &str {
    let renamed = RENAMED.iter().find(|(old, _)| *old == table);
    renamed.map_or(table, |(_, new)| new)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Estimator;
    use serde_json::json;

    fn with(parameters: Value) -> Result<Settings> {
        let Value::Object(map) = parameters else {
            panic!("parameters are an object")
        };
        Settings::default().with_parameters(&map)
    }

    #[test]
    fn what_is_named_changes_and_nothing_else() {
        let changed = with(json!({
            "registration": {"estimator": "gicp", "epoch_error_m": 0.002, "gicp": {"buffer_m": 1}},
            "m3c2": {"normal_diameter_m": 0.6},
        }))
        .unwrap();
        let mut expected = Settings::default();
        expected.registration.estimator = Estimator::Gicp;
        expected.registration.epoch_error_m = Some(0.002);
        expected.registration.gicp.buffer_m = 1.0;
        expected.m3c2.normal_radius_m = 0.3;
        assert_eq!(changed, expected);
        assert_eq!(with(json!({})).unwrap(), Settings::default());
    }

    #[test]
    fn former_names_work() {
        let changed =
            with(json!({"tiles": {"size_m": 3.0}, "registration": {"network": {"min_points": 30}}})).unwrap();
        assert_eq!(changed.ingest.size_m, 3.0);
        assert_eq!(changed.registration.adjustment.min_points, 30);
    }

    #[test]
    fn errors_name_table_and_key() {
        let error = |parameters| with(parameters).unwrap_err().to_string();
        let unknown = error(json!({"match": {"max_ration": 0.5}}));
        assert!(
            unknown.starts_with("match: unknown field `max_ration`"),
            "{unknown}"
        );
        assert!(error(json!({"matches": {}})).contains("unknown field `matches`"));
        assert!(error(json!({"match": {"max_ratio": "much"}})).contains("match: invalid type"));
        assert!(error(json!({"match": {"min_area_ratio": 1.5}})).contains("share"));
        assert!(
            with(json!({"match": {"max_ratio": -1.0}}))
                .unwrap_err()
                .is_wrong_usage()
        );
    }
}
