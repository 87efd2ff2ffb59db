//! JSON schema of a settings file, for editors that complete and check TOML (taplo, Even Better TOML).
//!
//! It is made of the same tables of keys that files are held to, so that it says neither more nor less: derived from the structs it
//! would know nothing of ranges and units, nor that numbers may be texts with a unit.

use serde_json::{Map, Value, json};
use toml::Table;

use super::key::{Key, Range};
use super::print::Section;

/// The schema of a file of these sections; of `values`, a file that has every key, it is seen which keys are lists.
pub fn schema(title: &str, sections: &[Section], values: &Table) -> Value {
    let mut properties = Map::new();
    for section in sections {
        if section.name.is_empty() {
            properties.extend(keys(section.keys, values));
            continue;
        }
        let nothing = Table::new();
        let value = values.get(section.name);
        let is_list = value.is_none_or(toml::Value::is_array);
        let section_values = value.and_then(toml::Value::as_table).unwrap_or(&nothing);
        let table = json!({
            "type": "object",
            "description": section.what,
            "properties": keys(section.keys, section_values),
            "additionalProperties": false,
        });
        let table = if is_list {
            json!({ "type": "array", "items": table })
        } else {
            table
        };
        properties.insert(section.name.into(), table);
    }
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": title,
        "type": "object",
        "properties": properties,
        "additionalProperties": false,
    })
}

fn keys(keys: &[Key], values: &Table) -> Map<String, Value> {
    let entry = |key: &Key| (key.name.to_owned(), of_key(key, values.get(key.name)));
    keys.iter().map(entry).collect()
}

fn of_key(key: &Key, value: Option<&toml::Value>) -> Value {
    let unit = match key.unit {
        "" => String::new(),
        unit => format!(", {unit}"),
    };
    let description = format!("{}{unit}. Source: {}.", key.what, key.source);
    let number = |least: &str, least_value: f64, most: f64| {
        let mut number = json!({ "type": "number" });
        for (limit, value) in [(least, least_value), ("maximum", most)] {
            if value.abs() < f64::MAX {
                number[limit] = json!(value);
            }
        }
        // A number with a unit.
        let single = json!([number, { "type": "string" }]);
        let list = json!({ "type": "array", "items": {
            "anyOf": [number, { "type": "string" }, { "type": "array" }],
        } });
        match value {
            Some(toml::Value::Array(_)) => list,
            Some(_) => json!({ "anyOf": single }),
            // Which it is can be seen of no value.
            None => json!({ "anyOf": [number, { "type": "string" }, list] }),
        }
    };
    let mut schema = match key.range {
        Range::Within(least, most) | Range::Limited(least, most, _) => {
            number("minimum", least, most)
        }
        Range::Above(below, most) => number("exclusiveMinimum", below, most),
        Range::OneOf(words) => json!({ "enum": words }),
        Range::WordOrCurve(words, _) => json!({
            "anyOf": [
                { "enum": words },
                { "type": "string", "pattern": "\\.csv$" },
                { "type": "array", "items": { "type": "array", "items": { "type": "number" } } },
            ],
        }),
        Range::Switch => json!({ "type": "boolean" }),
        Range::Text => json!({}),
    };
    schema["description"] = description.into();
    schema
}
