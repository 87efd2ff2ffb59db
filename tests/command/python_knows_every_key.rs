//! The types of Python's arguments follow from the tables that files are held to: a misspelt key of a sensor, or a word that it cannot have, is an error in
//! an editor.

use std::fmt::Write;
use std::path::Path;

use guided_dtof::chip::SensorConfig;
use guided_dtof::chip::sensors::CHIPS;
use guided_dtof::scene::Scene;
use serde_json::Value as Json;

const HEAD: &str = "\"\"\"Types of the keys of a sensor, and names of what is built in.

Made by `GDTOF_REMAKE=1 cargo test --test command python_knows_every_key` from the tables that files are held to.
\"\"\"

from collections.abc import Sequence
from typing import Any, Literal, SupportsFloat, SupportsIndex, TypedDict

";

/// `Literal["a", "b"]` on lines of their own.
fn literal<'a>(words: impl Iterator<Item = &'a str>) -> String {
    let words: Vec<String> = words.map(|word| format!("\"{word}\"")).collect();
    format!("Literal[{}]", words.join(", "))
}

/// The type of a key's values: numbers may be texts with a unit.
fn type_of(schema: &Json, usual: &toml::Value) -> String {
    if let Some(words) = schema["enum"].as_array() {
        return literal(words.iter().filter_map(Json::as_str));
    }
    let Some(kinds) = schema["anyOf"].as_array() else {
        let is_switch = schema["type"] == "boolean";
        return if is_switch { "bool" } else { "str" }.to_owned();
    };
    // Numbers of NumPy as well.
    let number = if usual.is_integer() {
        "SupportsIndex"
    } else {
        "SupportsFloat"
    };
    let has_list = kinds.iter().any(|kind| kind["type"] == "array");
    let list = if has_list { " | Sequence[Any]" } else { "" };
    format!("{number} | str{list}")
}

fn module() -> String {
    let chips = literal(CHIPS.iter().map(|chip| chip.name));
    let scenes = literal(Scene::built_in().map(|(name, _)| name));
    let mut text = format!("{HEAD}SensorName = {chips}\n\nSceneName = {scenes}\n\n");
    text += "\nclass SensorKeys(TypedDict, total=False):\n    \"\"\"Keys of a sensor. `gdtof sensor` prints what each is, its unit and range.\"\"\"\n\n";
    let schema = SensorConfig::schema();
    let usual = toml::Table::try_from(SensorConfig::default()).unwrap();
    for key in SensorConfig::SECTION.keys {
        let usual = usual.get(key.name).cloned();
        let usual = usual.unwrap_or(toml::Value::Float(0.0));
        let kind = type_of(&schema["properties"][key.name], &usual);
        let _ = writeln!(text, "    {}: {kind}", key.name);
    }
    text
}

/// Set GDTOF_REMAKE to write the module anew (`vectors/remake.sh` does).
#[test]
fn with_the_type_of_its_values() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("python/python/gdtof/_keys.py");
    if std::env::var_os("GDTOF_REMAKE").is_some() {
        std::fs::write(&path, module()).unwrap();
    }
    assert_eq!(std::fs::read_to_string(path).unwrap(), module());
}
