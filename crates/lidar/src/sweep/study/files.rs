//! The sensor's and the scene's file in a study, beside keys that change them:
//!
//! ```toml
//! sensor = "x.toml"
//! sensor.rows = 16
//! ```
//!
//! In TOML a key is a text or a section, not both. So the file is read as a key of the section, `sensor.file = "x.toml"`.

/// Names that are a file as well as a section.
const FILES: [&str; 2] = ["sensor", "scene"];

/// The text with `sensor.file = …` for `sensor = …`, in the same lines. A section in braces stays.
pub(super) fn with_files_named(text: &str) -> String {
    let named = |line: &str| match line.split_once('=') {
        Some((key, value))
            if FILES.contains(&key.trim()) && !value.trim_start().starts_with('{') =>
        {
            format!("{}.file ={value}", key.trim_end())
        }
        _ => line.to_owned(),
    };
    text.split_inclusive('\n').map(named).collect()
}

/// What reports and complaints call the key at `path`.
pub(super) fn name_of(path: &str) -> &str {
    let file = path.strip_suffix(".file");
    file.filter(|name| FILES.contains(name)).unwrap_or(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_a_key_of_its_section() {
        let text = "[fixed]\n  sensor = \"x.toml\" # mine\r\nsensor.rows = 16\nscene=['a', 'b']\n";
        let table: toml::Table = toml::from_str(&with_files_named(text)).unwrap();
        let fixed = &table["fixed"];
        assert_eq!(fixed["sensor"]["file"].as_str(), Some("x.toml"));
        assert_eq!(fixed["sensor"]["rows"].as_integer(), Some(16));
        assert_eq!(fixed["scene"]["file"].as_array().unwrap().len(), 2);
        for kept in [
            "sensor = { rows = 2 }",
            "sensors = 1",
            "# sensor",
            "sensor.rows = 2",
        ] {
            assert_eq!(with_files_named(kept), kept);
        }
        let names = [
            "sensor.file",
            "scene.file",
            "sensor.rows",
            "scene.object.car.file",
        ]
        .map(name_of);
        assert_eq!(
            names,
            ["sensor", "scene", "sensor.rows", "scene.object.car.file"]
        );
    }
}
