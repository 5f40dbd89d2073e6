//! The text of a project file: read as values, changed with its comments and order kept.

use serde_json::{Map, Value as Json};
use std::path::Path;
use stonewise::{Error, Project};
use toml_edit::{Array, ArrayOfTables, Document, DocumentMut, InlineTable, Item, Table, TableLike, Value};

/// The way to a value: names of keys, and numbers in lists.
pub type Way = Vec<Step>;

/// A step on it.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(untagged)]
pub enum Step {
    /// A key of a table.
    Key(String),
    /// A place in a list.
    Place(usize),
}

/// Why a change cannot be made.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct Mistake {
    /// What is wrong, and the fix.
    pub message: String,
    /// The line, counted from 1.
    pub line: Option<usize>,
    /// The value that is wrong.
    pub way: Way,
}

impl Mistake {
    /// A mistake of no place in particular.
    pub fn new(message: impl Into<String>) -> Self {
        Self {
            message: message.into(),
            line: None,
            way: Way::new(),
        }
    }

    /// What the library says of a project file with this text.
    pub fn of(error: &Error, text: &str) -> Self {
        match error {
            Error::Project { line, message, .. } => Self {
                message: message.clone(),
                line: Some(*line),
                way: way_to(text, *line),
            },
            other => Self::new(other.to_string()),
        }
    }
}

/// The values of a project file.
///
/// # Errors
/// The text is not TOML.
pub fn values(text: &str) -> Result<Json, Mistake> {
    let document = text
        .parse::<DocumentMut>()
        .map_err(|e| Mistake::new(e.message().to_owned()))?;
    Ok(json(document.as_item()))
}

/// The text with a value set, or removed where it is `null`.
///
/// # Errors
/// The text is not TOML; the way leads through something that is not a table; TOML cannot represent the value.
pub fn with(text: &str, way: &[Step], value: &Json) -> Result<String, Mistake> {
    let mut document = text
        .parse::<DocumentMut>()
        .map_err(|e| Mistake::new(e.message().to_owned()))?;
    set(document.as_item_mut(), way, value).map_err(|message| Mistake {
        message,
        line: None,
        way: way.to_vec(),
    })?;
    Ok(document.to_string())
}

/// Checks what a project file at `path` with this text would be.
///
/// # Errors
/// As the library says, with the place.
pub fn check(path: &Path, text: &str) -> Result<Project, Mistake> {
    Project::parse(path, text).map_err(|error| Mistake::of(&error, text))
}

fn set(item: &mut Item, way: &[Step], value: &Json) -> Result<(), String> {
    let Some((first, rest)) = way.split_first() else {
        return Err("a change needs a place".to_owned());
    };
    match first {
        Step::Key(key) => {
            if item.is_none() {
                let mut table = Table::new();
                table.set_implicit(!rest.is_empty());
                *item = Item::Table(table);
            }
            let table = item
                .as_table_like_mut()
                .ok_or_else(|| format!("{key} is no key of a table"))?;
            match rest {
                [] => set_key(table, key, value),
                _ if value.is_null() && table.get(key).is_none() => Ok(()),
                _ => set(table.entry(key).or_insert(Item::None), rest, value),
            }
        }
        Step::Place(place) => set_place(item, *place, rest, value),
    }
}

/// Sets a key of a table; what stands around an old value, such as a comment behind it, stays.
fn set_key(table: &mut dyn TableLike, key: &str, value: &Json) -> Result<(), String> {
    if value.is_null() {
        table.remove(key);
        return Ok(());
    }
    let old = table.get(key).and_then(Item::as_value);
    let mut new = toml(value, old, key)?;
    if let Some(old) = old {
        *new.decor_mut() = old.decor().clone();
    }
    match table.get_mut(key) {
        Some(item) => *item = Item::Value(new),
        None => {
            table.insert(key, Item::Value(new));
        }
    }
    Ok(())
}

/// Sets, adds or removes an entry of a list of tables.
fn set_place(item: &mut Item, place: usize, rest: &[Step], value: &Json) -> Result<(), String> {
    if item.is_none() {
        *item = Item::ArrayOfTables(ArrayOfTables::new());
    }
    if let Some(list) = item.as_array_mut() {
        return set_inline(list, place, rest, value);
    }
    let list = item.as_array_of_tables_mut().ok_or("this is no list")?;
    if place > list.len() {
        return Err(format!("there are only {} entries", list.len()));
    }

    match (rest, value) {
        ([], Json::Null) if place < list.len() => {
            list.remove(place);
            Ok(())
        }
        ([], Json::Object(keys)) => {
            let mut table = Table::new();
            // Names come first, as people write them.
            let (names, others): (Vec<_>, Vec<_>) = keys.iter().partition(|(key, _)| *key == "name");
            for (key, value) in names.into_iter().chain(others).filter(|(_, v)| !v.is_null()) {
                table.insert(key, Item::Value(toml(value, None, key)?));
            }
            if place == list.len() {
                list.push(table);
            } else {
                list.replace(place, table);
            }
            Ok(())
        }
        ([], _) => Err("an entry of this list is a table".to_owned()),
        (rest, value) => {
            let table = list.get_mut(place).ok_or("no such entry")?;
            let mut entry = Item::Table(std::mem::take(table));
            let outcome = set(&mut entry, rest, value);
            if let Ok(changed) = entry.into_table() {
                *table = changed;
            }
            outcome
        }
    }
}

/// Sets, adds or removes an entry of a list that is written in one line.
fn set_inline(list: &mut Array, place: usize, rest: &[Step], value: &Json) -> Result<(), String> {
    if !rest.is_empty() {
        let entry = list.get_mut(place).ok_or("no such entry")?;
        let mut item = Item::Value(entry.clone());
        set(&mut item, rest, value)?;
        *entry = item
            .into_value()
            .map_err(|_| "an entry of this list is a table")?;
        return Ok(());
    }
    match value {
        Json::Null if place < list.len() => {
            list.remove(place);
        }
        Json::Null => {}
        value if place == list.len() => list.push(toml(value, None, "")?),
        value => {
            let entry = list.get_mut(place).ok_or("no such entry")?;
            *entry = toml(value, Some(entry), "")?;
        }
    }
    Ok(())
}

/// A value of TOML; whole numbers stay what the old value was.
fn toml(value: &Json, old: Option<&Value>, key: &str) -> Result<Value, String> {
    Ok(match value {
        Json::Null => return Err("TOML has no null".to_owned()),
        Json::Bool(yes) => (*yes).into(),
        Json::Number(n) => match (n.as_i64(), n.as_f64()) {
            (Some(whole), _) if !old.is_some_and(Value::is_float) => whole.into(),
            (_, Some(number)) => number.into(),
            _ => return Err(format!("{n} is no number of TOML")),
        },
        Json::String(text) if key == "date" => {
            let date: toml_edit::Datetime = text.parse().map_err(|_| "write a date as YYYY-MM-DD")?;
            date.into()
        }
        Json::String(text) => text.as_str().into(),
        Json::Array(list) => {
            let mut array = Array::new();
            for value in list {
                array.push(toml(value, None, "")?);
            }
            array.into()
        }
        Json::Object(keys) => {
            let mut table = InlineTable::new();
            for (key, value) in keys.iter().filter(|(_, v)| !v.is_null()) {
                table.insert(key, toml(value, None, key)?);
            }
            table.into()
        }
    })
}

fn json(item: &Item) -> Json {
    match item {
        Item::None => Json::Null,
        Item::Value(value) => json_of(value),
        Item::Table(table) => Json::Object(table.iter().map(|(k, v)| (k.to_owned(), json(v))).collect()),
        Item::ArrayOfTables(list) => {
            let object = |t: &Table| {
                t.iter()
                    .map(|(k, v)| (k.to_owned(), json(v)))
                    .collect::<Map<_, _>>()
            };
            Json::Array(list.iter().map(|t| Json::Object(object(t))).collect())
        }
    }
}

fn json_of(value: &Value) -> Json {
    match value {
        Value::String(text) => text.value().as_str().into(),
        Value::Integer(n) => (*n.value()).into(),
        Value::Float(n) => (*n.value()).into(),
        Value::Boolean(yes) => (*yes.value()).into(),
        Value::Datetime(date) => date.value().to_string().into(),
        Value::Array(list) => list.iter().map(json_of).collect(),
        Value::InlineTable(table) => {
            Json::Object(table.iter().map(|(k, v)| (k.to_owned(), json_of(v))).collect())
        }
    }
}

/// The innermost value that begins on a line or before it and has not ended there.
fn way_to(text: &str, line: usize) -> Way {
    let Ok(document) = Document::parse(text) else {
        return Way::new();
    };
    let start = text
        .split_inclusive('\n')
        .take(line.saturating_sub(1))
        .map(str::len)
        .sum::<usize>();
    let end = start + text.get(start..).unwrap_or("").find('\n').unwrap_or(0);
    let (mut way, mut best) = (Way::new(), Way::new());
    descend(document.as_item(), start, end, &mut way, &mut best);
    best
}

fn descend(item: &Item, start: usize, end: usize, way: &mut Way, best: &mut Way) {
    let touches =
        |span: Option<std::ops::Range<usize>>| span.is_some_and(|s| s.start <= end && s.end > start);
    if touches(item.span()) && way.len() >= best.len() {
        best.clone_from(way);
    }
    let mut enter = |step: Step, inner: &Item, way: &mut Way| {
        way.push(step);
        descend(inner, start, end, way, best);
        way.pop();
    };
    match item {
        Item::Table(table) => {
            for (key, inner) in table.iter() {
                enter(Step::Key(key.to_owned()), inner, way);
            }
        }
        Item::ArrayOfTables(list) => {
            for (place, table) in list.iter().enumerate() {
                enter(Step::Place(place), &Item::Table(table.clone()), way);
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    const TEXT: &str = "\
#:schema ./s.json
[project]   # the dam
name = \"Lower dam\"

# The first one was foggy.
[[epochs]]
name = \"2024\"
clouds = [\"a.laz\"]  # from the left bank
[[epochs]]
name = \"2025\"
clouds = [\"b.laz\"]

[match]
max_ratio = 0.5 # tuned
";

    fn way(steps: &[&str]) -> Way {
        let step = |s: &&str| s.parse().map_or_else(|_| Step::Key((*s).to_owned()), Step::Place);
        steps.iter().map(step).collect()
    }

    #[test]
    fn a_change_leaves_every_other_byte_as_it_was() {
        let changed = with(TEXT, &way(&["match", "max_ratio"]), &json!(1)).unwrap();
        assert_eq!(changed, TEXT.replace("0.5 # tuned", "1.0 # tuned"));
        let changed = with(TEXT, &way(&["epochs", "0", "clouds"]), &json!(["a.laz", "c.laz"])).unwrap();
        assert_eq!(
            changed,
            TEXT.replace("[\"a.laz\"]  #", "[\"a.laz\", \"c.laz\"]  #")
        );
        let changed = with(TEXT, &way(&["epochs", "1", "date"]), &json!("2025-04-01")).unwrap();
        assert_eq!(
            changed,
            TEXT.replace("[\"b.laz\"]\n", "[\"b.laz\"]\ndate = 2025-04-01\n")
        );
        let changed = with(TEXT, &way(&["match", "max_ratio"]), &Json::Null).unwrap();
        assert_eq!(changed, TEXT.replace("max_ratio = 0.5 # tuned\n", ""));
        assert_eq!(
            with(TEXT, &way(&["label", "min_points"]), &Json::Null).unwrap(),
            TEXT
        );
    }

    #[test]
    fn new_tables_and_zones_come_last_and_read_as_they_were_meant() {
        let zone = json!({ "name": "crest", "polygon": [[0.0, 2.5], [4.0, 2.5], [4.0, 3.0]], "alarm_mm": 5 });
        let mut text = with(TEXT, &way(&["thresholds", "alarm_mm"]), &json!(12.5)).unwrap();
        let other = json!({ "name": "toe", "polygon": [[0.0, 0.0], [4.0, 0.0], [4.0, 0.5]], "alarm_mm": 2 });
        for (place, zone) in [("0", &other), ("1", &zone)] {
            text = with(&text, &way(&["thresholds", "zones", place]), zone).unwrap();
        }
        assert!(text.starts_with(TEXT), "{text}");
        // Read by another reader of TOML.
        let read: Json = serde_json::to_value(values(&text).unwrap()).unwrap();
        assert_eq!(read["thresholds"]["zones"], json!([other, zone]));
        assert_eq!(read["thresholds"]["alarm_mm"], 12.5);
        let without = with(&text, &way(&["thresholds", "zones", "0"]), &Json::Null).unwrap();
        assert_eq!(values(&without).unwrap()["thresholds"]["zones"], json!([zone]));
    }

    #[test]
    fn a_line_leads_to_its_value() {
        for (line, expected) in [
            (3, way(&["project", "name"])),
            (8, way(&["epochs", "0", "clouds"])),
            (10, way(&["epochs", "1", "name"])),
            (14, way(&["match", "max_ratio"])),
        ] {
            assert_eq!(way_to(TEXT, line), expected, "{line}");
        }
    }

    #[test]
    fn what_toml_cannot_hold_is_refused() {
        assert!(with(TEXT, &way(&["epochs", "0", "date"]), &json!("soon")).is_err());
        assert!(with(TEXT, &way(&["project", "name", "x"]), &json!(1)).is_err());
        assert!(with(TEXT, &way(&["epochs", "7", "name"]), &json!("x")).is_err());
    }
}
