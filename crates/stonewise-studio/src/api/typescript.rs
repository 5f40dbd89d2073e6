//! The types of the API in TypeScript, from their JSON schema.

use super::types::{Act, EditsShown, NewEdits, ProjectChanges, ProjectShown, State};
use crate::remarks::{NewSignature, OldRemark, RemarksShown};
use crate::sightings::Sighting;
use crate::stable::NewStable;
use crate::teaching::{NewTeaching, TeachingShown};
use schemars::SchemaGenerator;
use serde_json::{Map, Value};
use std::fmt::Write;

/// The TypeScript module of the API's types.
pub fn typescript() -> String {
    let mut generator = SchemaGenerator::default();
    generator.subschema_for::<State>();
    generator.subschema_for::<ProjectShown>();
    generator.subschema_for::<ProjectChanges>();
    generator.subschema_for::<NewStable>();
    generator.subschema_for::<TeachingShown>();
    generator.subschema_for::<NewTeaching>();
    generator.subschema_for::<EditsShown>();
    generator.subschema_for::<NewEdits>();
    generator.subschema_for::<Act>();
    generator.subschema_for::<RemarksShown>();
    generator.subschema_for::<OldRemark>();
    generator.subschema_for::<NewSignature>();
    generator.subschema_for::<Sighting>();
    let mut text =
        "// Made from the types of crates/stonewise-studio; a cargo test writes and compares it.\n"
            .to_owned();
    for (name, schema) in generator.take_definitions(true) {
        declare(&mut text, &name, &schema);
    }
    text
}

fn declare(text: &mut String, name: &str, schema: &Value) {
    text.push('\n');
    comment(text, schema, "");
    match schema.get("properties").and_then(Value::as_object) {
        Some(properties) => {
            let _ = writeln!(text, "export interface {name} {{");
            fields(text, properties, schema);
            text.push_str("}\n");
        }
        None => {
            let _ = writeln!(text, "export type {name} = {};", typed(schema));
        }
    }
}

fn fields(text: &mut String, properties: &Map<String, Value>, schema: &Value) {
    let required = schema.get("required").and_then(Value::as_array);
    for (key, value) in properties {
        comment(text, value, "  ");
        let is_required = required.is_some_and(|r| r.iter().any(|k| k == key));
        let mark = if is_required { "" } else { "?" };
        let _ = writeln!(text, "  readonly {key}{mark}: {};", typed(value));
    }
}

fn comment(text: &mut String, schema: &Value, indent: &str) {
    if let Some(words) = schema.get("description").and_then(Value::as_str) {
        let words = words.split_whitespace().collect::<Vec<_>>().join(" ");
        let _ = writeln!(text, "{indent}/** {words} */");
    }
}

/// The type of a schema.
fn typed(schema: &Value) -> String {
    if let Some(name) = schema.get("$ref").and_then(Value::as_str) {
        return name.rsplit('/').next().unwrap_or("unknown").to_owned();
    }
    if let Some(constant) = schema.get("const") {
        return constant.to_string();
    }
    if let Some(words) = schema.get("enum").and_then(Value::as_array) {
        return union(words.iter().map(Value::to_string));
    }
    for key in ["oneOf", "anyOf"] {
        if let Some(choices) = schema.get(key).and_then(Value::as_array) {
            return union(choices.iter().map(typed));
        }
    }
    match schema.get("type") {
        Some(Value::Array(types)) => {
            let one = |name: &Value| {
                let mut schema = schema.clone();
                if let Some(keys) = schema.as_object_mut() {
                    keys.insert("type".to_owned(), name.clone());
                }
                typed(&schema)
            };
            union(types.iter().map(one))
        }
        Some(Value::String(name)) => match name.as_str() {
            "integer" | "number" => "number".to_owned(),
            "string" | "boolean" | "null" => name.clone(),
            "array" => array(schema),
            _ => "Readonly<Record<string, unknown>>".to_owned(),
        },
        _ => "unknown".to_owned(),
    }
}

/// A list, or a tuple where the number of its entries is fixed.
fn array(schema: &Value) -> String {
    let length = |key: &str| schema.get(key).and_then(Value::as_u64);
    let inner = schema.get("items").map_or("unknown".to_owned(), typed);
    match (length("minItems"), length("maxItems")) {
        (Some(least), Some(most)) if least == most => {
            let all = vec![inner; usize::try_from(least).unwrap_or(0)];
            format!("readonly [{}]", all.join(", "))
        }
        _ => format!("readonly ({inner})[]"),
    }
}

fn union(types: impl Iterator<Item = String>) -> String {
    let mut all: Vec<String> = types.collect();
    all.dedup();
    all.join(" | ")
}
