//! Settings with some parameters replaced, by the names that the project file has for them.

use crate::error::{Error, Result};
use crate::settings::Settings;
use stonewise_core::params::Params;

/// The settings with each parameter (`section.key`, as in the project file) set to its value.
///
/// # Errors
/// No parameter of this name, a value of the wrong kind, an impossible value.
pub(super) fn settings_with(settings: &Settings, changes: &[(&str, &toml::Value)]) -> Result<Settings> {
    let bad = |message: String| Error::Survey(message);
    let mut all = toml::Value::try_from(settings).map_err(|e| bad(e.to_string()))?;
    for (key, value) in changes {
        let place = find(&mut all, key).ok_or_else(|| bad(unknown(settings, key)))?;
        *place = (*value).clone();
    }
    let changed: Settings = all.try_into().map_err(|e: toml::de::Error| {
        let keys: Vec<String> = changes.iter().map(|(k, v)| format!("{k} = {v}")).collect();
        bad(format!("{}: {}", keys.join(", "), e.message()))
    })?;
    changed.check().map_err(|e| bad(e.to_string()))?;
    Ok(changed)
}

/// How many of these values differ from the settings' own.
pub(super) fn count_changes(settings: &Settings, changes: &[(&str, &toml::Value)]) -> Result<usize> {
    let differs = |change| Ok(settings_with(settings, &[change])? != *settings);
    let differ = changes
        .iter()
        .map(|c| differs(*c))
        .collect::<Result<Vec<bool>>>()?;
    Ok(differ.into_iter().filter(|d| *d).count())
}

/// Lines for a project file that set these parameters.
pub(super) fn project_lines(changes: &[(&str, &toml::Value)]) -> String {
    let mut root = toml::Table::new();
    for (key, value) in changes {
        insert(&mut root, key, value);
    }
    root.to_string()
}

fn insert(table: &mut toml::Table, key: &str, value: &toml::Value) {
    let Some((section, rest)) = key.split_once('.') else {
        table.insert(key.to_owned(), value.clone());
        return;
    };
    let inner = table
        .entry(section)
        .or_insert_with(|| toml::Value::Table(toml::Table::new()));
    if let toml::Value::Table(inner) = inner {
        insert(inner, rest, value);
    }
}

fn find<'a>(all: &'a mut toml::Value, key: &str) -> Option<&'a mut toml::Value> {
    let found = key.split('.').try_fold(all, |value, name| value.get_mut(name))?;
    (!found.is_table()).then_some(found)
}

/// Says that there is no such parameter, and names those that end alike.
fn unknown(settings: &Settings, key: &str) -> String {
    let mut open = vec![(String::new(), toml::Value::try_from(settings).ok())];
    let mut alike = Vec::new();
    let wanted = key.rsplit('.').next().unwrap_or(key);
    while let Some((path, value)) = open.pop() {
        match value {
            Some(toml::Value::Table(table)) => open.extend(
                table
                    .into_iter()
                    .map(|(name, value)| (format!("{path}.{name}"), Some(value))),
            ),
            _ if path.ends_with(&format!(".{wanted}")) => alike.push(path[1..].to_owned()),
            _ => {}
        }
    }
    alike.sort();
    let hint = if alike.is_empty() {
        "docs/src/project-file.md lists them, as section.key".to_owned()
    } else {
        format!("is it {}?", alike.join(" or "))
    };
    format!("no parameter {key:?} in a project file: {hint}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Estimator;

    fn value(text: &str) -> toml::Value {
        format!("x = {text}").parse::<toml::Table>().unwrap()["x"].clone()
    }

    #[test]
    fn parameters_are_set_by_their_names_and_nothing_else_changes() {
        let before = Settings::default();
        let (ratio, buffer, estimator) = (value("0.55"), value("1"), value("\"gicp\""));
        let after = settings_with(
            &before,
            &[
                ("match.max_ratio", &ratio),
                ("registration.gicp.buffer_m", &buffer),
                ("registration.estimator", &estimator),
            ],
        )
        .unwrap();
        assert_eq!(after.r#match.max_ratio, 0.55);
        assert_eq!(after.registration.gicp.buffer_m, 1.0);
        assert_eq!(after.registration.estimator, Estimator::Gicp);
        let mut back = after;
        back.r#match.max_ratio = before.r#match.max_ratio;
        back.registration.gicp.buffer_m = before.registration.gicp.buffer_m;
        back.registration.estimator = before.registration.estimator;
        assert_eq!(back, before);
    }

    #[test]
    fn wrong_names_and_values_are_explained() {
        let fail = |key: &str, text: &str| {
            settings_with(&Settings::default(), &[(key, &value(text))])
                .unwrap_err()
                .to_string()
        };
        assert!(fail("buffer_m", "1.0").contains("registration.gicp.buffer_m"));
        assert!(fail("match", "1.0").contains("no parameter"));
        assert!(fail("match.max_ratio", "\"much\"").contains("max_ratio"));
        assert!(fail("match.min_area_ratio", "1.5").contains("it must be 0 to 1"));
    }

    #[test]
    fn lines_read_back_as_tables() {
        let (a, b) = (value("0.4"), value("0.6"));
        let lines = project_lines(&[("match.max_ratio", &a), ("registration.gicp.buffer_m", &b)]);
        let read: Settings = toml::from_str(&lines).unwrap();
        assert_eq!(
            (read.r#match.max_ratio, read.registration.gicp.buffer_m),
            (0.4, 0.6)
        );
    }
}
