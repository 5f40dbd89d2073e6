//! Parameters that a caller gives beside the project file, by the names that the file has for them.

use crate::error::{Error, Result};
use crate::settings::Settings;
use serde_json::{Map, Value};
use stonewise_core::params::Params;

impl Settings {
    /// The settings with other parameters, by the names of the tables in the project file.
    ///
    /// # Errors
    /// No such parameter, a value of the wrong kind, an impossible value.
    pub fn with_parameters(&self, parameters: &Map<String, Value>) -> Result<Self> {
        let mut all = serde_json::to_value(self).map_err(|e| Error::Parameters(e.to_string()))?;
        for (table, value) in parameters {
            let mut changed = all.clone();
            merge_into(&mut changed, table, value);
            // One table at a time, so that the message can name it.
            let read: std::result::Result<Self, _> = serde_json::from_value(changed.clone());
            if let Err(error) = read {
                return Err(Error::Parameters(format!("{table}: {error}")));
            }
            all = changed;
        }
        let settings: Self = serde_json::from_value(all).map_err(|e| Error::Parameters(e.to_string()))?;
        settings.check().map_err(|e| Error::Parameters(e.to_string()))?;
        Ok(settings)
    }
}

/// Puts a value into a table: over what is there, key by key where both are tables.
fn merge_into(table: &mut Value, key: &str, value: &Value) {
    let Value::Object(map) = table else {
        return;
    };
    // A diameter takes the place of the radius that says the same.
    if let Some(stem) = key.strip_suffix("_diameter_m") {
        map.remove(&format!("{stem}_radius_m"));
    }
    match (map.get_mut(key), value) {
        (Some(place @ Value::Object(_)), Value::Object(inner)) => {
            for (key, value) in inner {
                merge_into(place, key, value);
            }
        }
        _ => {
            map.insert(key.to_owned(), value.clone());
        }
    }
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
    fn errors_name_table_and_key() {
        let error = |parameters| with(parameters).unwrap_err().to_string();
        let unknown = error(json!({"match": {"max_ration": 0.5}}));
        assert!(
            unknown.starts_with("match: unknown field `max_ration`"),
            "{unknown}"
        );
        assert!(error(json!({"matches": {}})).contains("unknown field `matches`"));
        assert!(error(json!({"match": {"max_ratio": "much"}})).contains("match: invalid type"));
        assert_eq!(
            error(json!({"match": {"min_area_ratio": 1.5}})),
            "match.min_area_ratio = 1.5 is not possible: it must be 0 to 1"
        );
        assert!(
            with(json!({"match": {"max_ratio": -1.0}}))
                .unwrap_err()
                .is_wrong_usage()
        );
    }
}
