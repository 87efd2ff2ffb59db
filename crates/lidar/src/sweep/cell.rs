//! Cells of the table of results, and what its columns hold.

use toml::Value;

use crate::report::quoted;

/// What a column holds. Any cell may be empty.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Holds {
    /// Whole numbers.
    Whole,
    /// Numbers.
    Number,
    /// Words.
    Word,
    /// true or false.
    Truth,
}

/// Parts of keys that say in which file they stand.
const FOLDERS: [&str; 5] = ["sensor", "scene", "frame", "theory", "object"];

/// A column.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Heading.
    pub name: String,
    /// Unit, if it has one.
    pub unit: &'static str,
    /// What it holds.
    pub holds: Holds,
}

impl Column {
    /// A column.
    pub(crate) fn new(name: impl Into<String>, unit: &'static str, holds: Holds) -> Self {
        Column {
            name: name.into(),
            unit,
            holds,
        }
    }

    /// Words and unit, for an axis: `light illuminance (klux)` of `scene.light.illuminance_klux`.
    pub(crate) fn label(&self) -> String {
        match self.unit {
            "" => self.words(),
            unit => format!("{} ({unit})", self.words()),
        }
    }

    /// The heading in words, without its unit.
    pub(crate) fn words(&self) -> String {
        let parts = self.name.split('.').filter(|part| !FOLDERS.contains(part));
        let words: Vec<&str> = parts.flat_map(|part| part.split('_')).collect();
        let plain = |text: &str| text.to_lowercase().replace(['/', '²', '³', ' '], "");
        let ends_in_unit = words
            .last()
            .is_some_and(|last| plain(last) == plain(self.unit));
        let kept = words.len() - usize::from(ends_in_unit && words.len() > 1);
        match words[..kept] {
            ["p", ref of @ ..] => format!("probability of {}", of.join(" ")),
            ref words => words.join(" "),
        }
    }
}

/// One value of the table.
#[derive(Debug, Clone, PartialEq)]
pub enum TableCell {
    /// Nothing.
    Empty,
    /// A whole number.
    Whole(i64),
    /// A number; not a number is nothing.
    Number(f64),
    /// Words.
    Word(String),
    /// true or false.
    Truth(bool),
}

impl TableCell {
    /// A number, where there is one.
    pub(crate) fn maybe(number: Option<f64>) -> Self {
        number.map_or(TableCell::Empty, TableCell::Number)
    }

    /// A count.
    pub(crate) fn count(count: usize) -> Self {
        TableCell::Whole(count as i64)
    }

    /// A setting's value in a column that holds `holds`.
    pub(super) fn from_value(value: &Value, holds: Holds) -> Self {
        match (value, holds) {
            (Value::Integer(n), Holds::Number) => TableCell::Number(*n as f64),
            (Value::Integer(n), Holds::Whole) => TableCell::Whole(*n),
            (Value::Float(x), Holds::Number) => TableCell::Number(*x),
            (Value::Boolean(b), Holds::Truth) => TableCell::Truth(*b),
            (Value::String(s), _) => TableCell::Word(s.clone()),
            (other, _) => TableCell::Word(other.to_string()),
        }
    }

    /// As a field of a CSV file.
    pub(super) fn csv(&self) -> String {
        match self {
            TableCell::Empty => String::new(),
            TableCell::Whole(n) => n.to_string(),
            TableCell::Number(x) if x.is_nan() => String::new(),
            TableCell::Number(x) => format!("{x:?}"),
            TableCell::Truth(b) => b.to_string(),
            TableCell::Word(word) => {
                // Ends of lines in a field are allowed, but many readers take them for a row's.
                quoted(&word.replace(['\n', '\r'], " "))
            }
        }
    }

    /// As JSON, which has no infinite numbers.
    pub(super) fn json(&self) -> serde_json::Value {
        match self {
            TableCell::Empty => serde_json::Value::Null,
            TableCell::Whole(n) => (*n).into(),
            TableCell::Number(x) if x.is_infinite() => {
                (if *x > 0.0 { "inf" } else { "-inf" }).into()
            }
            TableCell::Number(x) => (*x).into(),
            TableCell::Word(word) => word.as_str().into(),
            TableCell::Truth(b) => (*b).into(),
        }
    }

    /// From what [`TableCell::json`] makes of a cell of such a column; `None` if it is no such thing.
    pub(super) fn from_json(json: &serde_json::Value, holds: Holds) -> Option<Self> {
        Some(match (json, holds) {
            (serde_json::Value::Null, _) => TableCell::Empty,
            (json, Holds::Whole) => TableCell::Whole(json.as_i64()?),
            (serde_json::Value::String(infinite), Holds::Number) => {
                TableCell::Number(infinite.parse().ok()?)
            }
            (json, Holds::Number) => TableCell::Number(json.as_f64()?),
            (json, Holds::Word) => TableCell::Word(json.as_str()?.to_owned()),
            (json, Holds::Truth) => TableCell::Truth(json.as_bool()?),
        })
    }

    /// The number in it, if it is one.
    pub(crate) fn number(&self) -> Option<f64> {
        match self {
            TableCell::Whole(n) => Some(*n as f64),
            TableCell::Number(x) => Some(*x),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn any_cell() -> impl Strategy<Value = (TableCell, Holds)> {
        prop_oneof![
            Just((TableCell::Empty, Holds::Number)),
            any::<i64>().prop_map(|n| (TableCell::Whole(n), Holds::Whole)),
            (any::<f64>().prop_filter("not a number", |x| !x.is_nan()))
                .prop_map(|x| (TableCell::Number(x), Holds::Number)),
            "(?s).{0,20}".prop_map(|w| (TableCell::Word(w), Holds::Word)),
            any::<bool>().prop_map(|b| (TableCell::Truth(b), Holds::Truth)),
        ]
    }

    proptest! {
        /// To the bit, by way of text.
        #[test]
        fn cells_come_back_from_json((cell, holds) in any_cell()) {
            let text = cell.json().to_string();
            let json: serde_json::Value = serde_json::from_str(&text).unwrap();
            prop_assert_eq!(TableCell::from_json(&json, holds), Some(cell));
        }

        /// Words with ends of lines among them.
        #[test]
        fn fields_are_one_line_with_no_comma_of_their_own((cell, _) in any_cell()) {
            let field = cell.csv();
            prop_assert!(!field.contains(['\n', '\r']));
            prop_assert!(!field.starts_with(['=', '@']));
            prop_assert!(!field.starts_with(['+', '-']) || field.parse::<f64>().is_ok());
            prop_assert!(!field.contains(',') || (field.starts_with('"') && field.ends_with('"')));
        }
    }

    #[test]
    fn headings_become_words_and_lose_their_unit() {
        for (name, unit, label) in [
            (
                "scene.light.illuminance_klux",
                "klux",
                "light illuminance (klux)",
            ),
            (
                "scene.lidar.pulse_energy_uj",
                "uJ",
                "lidar pulse energy (uJ)",
            ),
            ("scene.object.car.reflectivity", "", "car reflectivity"),
            ("theory.range_m", "m", "range (m)"),
            ("share_within_a_bin", "", "share within a bin"),
            ("depths", "", "depths"),
            ("p_detection", "", "probability of detection"),
        ] {
            let column = Column::new(name, unit, Holds::Number);
            assert_eq!(column.label(), label);
        }
    }
}
