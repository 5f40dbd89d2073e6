//! The JSON schema of the project file, from its types.

use crate::project_file::RawProject;
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema};
use serde_json::{Map, Value};
use stonewise_base::settings::Settings;

/// The JSON schema (draft 7, which most editors of TOML support) of the project file: every key with its meaning,
/// default and range, and its unit as `x-unit`. Nothing is referred to: each table holds its keys.
pub fn project_schema() -> Value {
    let mut file = schema_of::<RawProject>();
    let tables = schema_of::<Settings>().remove("properties");
    if let (Some(Value::Object(all)), Some(Value::Object(tables))) = (file.get_mut("properties"), tables) {
        all.extend(tables);
    }
    let mut schema = file.to_value();
    tidy(&mut schema);
    schema
}

fn schema_of<T: JsonSchema>() -> Schema {
    let settings = SchemaSettings::draft07().with(|s| s.inline_subschemas = true);
    settings.into_generator().into_root_schema_for::<T>()
}

/// Takes out what only Rust and JSON need: formats of numbers, `null` for what is absent (TOML has none),
/// defaults of whole tables, and the line breaks of comments.
fn tidy(schema: &mut Value) {
    match schema {
        Value::Object(keys) => {
            keys.retain(|key, value| match key.as_str() {
                "format" => !value.is_string(),
                "default" => !(value.is_null() || value.is_object()),
                _ => true,
            });
            if let Some(Value::String(text)) = keys.get_mut("description") {
                *text = text.split_whitespace().collect::<Vec<_>>().join(" ");
            }
            without_null(keys);
            keys.values_mut().for_each(tidy);
        }
        Value::Array(list) => list.iter_mut().for_each(tidy),
        _ => {}
    }
}

/// A schema that allows something or `null` becomes one that allows the first.
fn without_null(keys: &mut Map<String, Value>) {
    if let Some(Value::Array(types)) = keys.get_mut("type") {
        types.retain(|name| name != "null");
        if let [only] = types.as_slice() {
            let only = only.clone();
            keys.insert("type".to_owned(), only);
        }
    }
    let Some(Value::Array(choices)) = keys.get_mut("anyOf") else {
        return;
    };
    choices.retain(|choice| choice["type"] != "null");
    if let [Value::Object(only)] = choices.as_slice() {
        let mut only = only.clone();
        keys.remove("anyOf");
        only.append(keys);
        *keys = only;
    }
}
