//! The page of the project file, the JSON schema and the program say the same about every key.

use serde_json::{Map, Value, json};
use std::fs;
use stonewise_base::settings::Settings;
use stonewise_project::project_schema;

fn docs(file: &str) -> String {
    fs::read_to_string(format!("{}/../../docs/src/{file}", env!("CARGO_MANIFEST_DIR"))).unwrap()
}

/// What stands under the heading of a table of the project file.
fn section<'a>(page: &'a str, table: &str) -> Option<&'a str> {
    let heading =
        |brackets: [&str; 2]| page.split_once(&format!("### `{}{table}{}`\n", brackets[0], brackets[1]));
    let (_, rest) = heading(["[", "]"]).or_else(|| heading(["[[", "]]"]))?;
    Some(rest.split("\n### ").next().unwrap_or(rest))
}

/// A row of a table of the page.
struct Row {
    table: String,
    key: String,
    default: String,
    allowed: String,
}

fn rows(page: &str) -> Vec<Row> {
    let mut table = String::new();
    let mut rows = Vec::new();
    for line in page.lines() {
        if let Some(heading) = line.strip_prefix("### ") {
            table = heading.trim_matches(['`', '[', ']']).to_owned();
        }
        let cells: Vec<&str> = line.split(" | ").collect();
        if let [key, default, allowed, _] = cells.as_slice()
            && let Some(key) = key.strip_prefix("| `")
        {
            rows.push(Row {
                table: table.clone(),
                key: key.trim_matches('`').to_owned(),
                default: default.trim_matches('`').to_owned(),
                allowed: allowed.trim().to_owned(),
            });
        }
    }
    rows
}

/// The schema of a key of a table.
fn property<'a>(schema: &'a Value, table: &str, key: &str) -> Option<&'a Value> {
    let mut found = schema;
    for name in table.split('.').chain([key]).filter(|name| !name.is_empty()) {
        let tables = [found, &found["items"]];
        found = tables.into_iter().find_map(|t| t["properties"].get(name))?;
    }
    Some(found)
}

#[test]
fn the_committed_schema_is_that_of_the_types() {
    let committed: Value = serde_json::from_str(&docs("project-file.schema.json")).unwrap();
    assert!(
        committed == project_schema(),
        "write it again: cargo run -- self schema > docs/src/project-file.schema.json"
    );
}

#[test]
fn every_key_of_the_schema_is_on_the_page_with_its_default_and_unit() {
    let page = docs("project-file.md");
    let (head, _) = page.split_once("## Parameters").unwrap();
    let mut open = vec![(String::new(), head, project_schema())];
    let mut keys = 0;
    while let Some((table, text, schema)) = open.pop() {
        for (key, property) in schema["properties"].as_object().unwrap() {
            let path = format!("{table}.{key}").trim_matches('.').to_owned();
            let described = property["description"].as_str().unwrap_or_default();
            assert!(
                described.len() > 5 && !["[`", "None"].iter().any(|w| described.contains(w)),
                "{path}: {described:?}"
            );
            let inner = [property, &property["items"]]
                .into_iter()
                .find(|p| p["properties"].is_object());
            if let Some(inner) = inner {
                open.push((path.clone(), section(&page, &path).unwrap_or(text), inner.clone()));
                continue;
            }
            keys += 1;
            let is_word = |c: char| c.is_alphanumeric() || c == '_';
            assert!(
                text.split(|c| !is_word(c)).any(|word| word == key),
                "{path} is not on the page"
            );
            let row = text
                .lines()
                .find(|line| line.starts_with(&format!("| `{key}` |")));
            if let (Some(default), true) = (property.get("default"), text.contains("| key | default |")) {
                let start = format!("| `{key}` | `{default}` |");
                assert!(row.is_some_and(|row| row.starts_with(&start)), "{path}: {start}");
            }
            let unit = match property["x-unit"].as_str() {
                Some("m") => "metres",
                Some("mm") => "millimetres",
                Some("rad") => "radians",
                Some("px") => "pixels",
                Some("MiB") => "MiB",
                Some(other) => panic!("{path}: unit {other}"),
                None => continue,
            };
            for words in [described, row.unwrap_or(text)] {
                assert!(
                    words.to_lowercase().contains(&unit.to_lowercase()),
                    "{path} without {unit}: {words}"
                );
            }
        }
    }
    assert!(keys > 130, "only {keys} keys found: the search is broken");
}

#[test]
fn every_row_of_the_page_is_in_the_schema() {
    let schema = project_schema();
    for row in rows(&docs("project-file.md")) {
        assert!(
            property(&schema, &row.table, &row.key).is_some(),
            "{}.{}",
            row.table,
            row.key
        );
    }
}

/// A range as the page writes it: the least value, whether it is itself allowed, the largest.
fn range_of(words: &str) -> Option<(f64, bool, f64)> {
    let words = words.trim_end_matches(" each").split(',').next()?;
    if let Some(least) = words.strip_prefix("above ") {
        return Some((least.parse().ok()?, false, f64::INFINITY));
    }
    if let Some(least) = words.strip_suffix(" or more") {
        return Some((least.parse().ok()?, true, f64::INFINITY));
    }
    let (least, most) = words.split_once(" to ")?;
    Some((least.parse().ok()?, true, most.parse().ok()?))
}

fn is_accepted(row: &Row, number: f64) -> bool {
    let is_integer = row.default.parse::<u32>().is_ok();
    let number = if is_integer {
        json!(number as i64)
    } else {
        json!(number)
    };
    let value = if row.default.starts_with('[') {
        json!([number])
    } else {
        number
    };
    let mut table = json!({ &row.key: value });
    if row.key == "tile_px" {
        table["overlap_px"] = json!(0);
    }
    for name in row.table.split('.').rev() {
        table = json!({ name: table });
    }
    let Value::Object(parameters) = table else {
        return false;
    };
    let parameters: Map<String, Value> = parameters;
    Settings::default().with_parameters(&parameters).is_ok()
}

#[test]
fn numbers_are_accepted_in_the_ranges_of_the_page_and_nowhere_else() {
    let schema = project_schema();
    let mut ranges = 0;
    // What is read from files is no parameter of a step; the tests of `project_file` try the limits.
    let of_steps = |row: &Row| !["conditions", "instruments"].contains(&row.table.as_str());
    for row in rows(&docs("project-file.md")).into_iter().filter(of_steps) {
        let name = format!("{}.{}", row.table, row.key);
        let Some((least, is_closed, most)) = range_of(&row.allowed) else {
            assert!(
                row.default.parse::<f64>().is_err(),
                "{name} has no range on the page"
            );
            continue;
        };
        ranges += 1;
        let is_integer = row.default.parse::<u32>().is_ok();
        let step = if is_integer { 1.0 } else { 1e-3 };
        assert_eq!(is_accepted(&row, least), is_closed, "{name} = {least}");
        assert!(is_accepted(&row, least + step), "{name} just above {least}");
        assert!(!is_accepted(&row, least - step), "{name} just below {least}");
        if most.is_finite() {
            assert!(is_accepted(&row, most), "{name} = {most}");
            assert!(!is_accepted(&row, most + step), "{name} just above {most}");
        } else if !row.allowed.contains(',') {
            assert!(is_accepted(&row, 1e9), "{name} = 1e9");
        }

        let property = property(&schema, &row.table, &row.key).unwrap();
        let number = if property["items"].is_object() {
            &property["items"]
        } else {
            property
        };
        let stated = match number["exclusiveMinimum"].as_f64() {
            Some(least) => (least, false),
            None => (number["minimum"].as_f64().unwrap(), true),
        };
        let expected = if is_integer && !is_closed {
            (least + 1.0, true)
        } else {
            (least, is_closed)
        };
        assert_eq!(stated, expected, "{name} in the schema");
        assert_eq!(
            number["maximum"].as_f64(),
            Some(most).filter(|m| m.is_finite()),
            "{name} in the schema"
        );
    }
    assert!(ranges > 100, "only {ranges} ranges found: the search is broken");
}
