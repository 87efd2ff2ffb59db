//! A key and the value that it is given, outside a file: `--set sensor.clk_hz=300e6`, a study's row, an argument of Python.
//!
//! Text is read as a line of a settings file would be; what is no TOML is a text, so that words and quantities need no quotes. Values stay
//! what they are: a text of Python that looks like a number is a text.

use toml::{Table, Value};

use crate::files::InputError;

/// A key, its value, and who gives it.
#[derive(Debug, Clone, PartialEq)]
pub struct Assignment {
    pub(super) names: Vec<String>,
    pub(super) value: Value,
    /// What complaints call it.
    pub(super) origin: String,
}

impl Assignment {
    /// What `KEY=VALUE` says.
    ///
    /// # Errors
    /// When it has no value, or the key is none.
    pub fn parse(text: &str, origin: impl Into<String>) -> Result<Self, InputError> {
        let origin = origin.into();
        let Some((key, value)) = text.split_once('=') else {
            return Err(InputError::new(origin, "has no value; give key=value"));
        };
        Self::new(key, value_of(value), origin)
    }

    /// A value for a key: names with dots between them.
    ///
    /// # Errors
    /// When the key is none.
    pub fn new(
        key: &str,
        value: impl Into<Value>,
        origin: impl Into<String>,
    ) -> Result<Self, InputError> {
        let origin = origin.into();
        let Some(names) = names_of(key) else {
            let message = format!("{key:?} is not a key; give names with dots between them");
            return Err(InputError::new(origin, message));
        };
        Ok(Assignment {
            names,
            value: value.into(),
            origin,
        })
    }

    /// The key, from its first name to its last.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// What complaints call it.
    pub fn origin(&self) -> &str {
        &self.origin
    }

    /// The same within the section of its first name; none for a key of one name.
    pub fn within_section(&self) -> Option<Self> {
        let names = self.names.get(1..).filter(|names| !names.is_empty())?;
        Some(Assignment {
            names: names.to_vec(),
            ..self.clone()
        })
    }
}

/// The names of a dotted key, as TOML reads it.
fn names_of(key: &str) -> Option<Vec<String>> {
    let mut value: Value = one_value(&format!("{key} = 0"))?.into();
    let mut names = Vec::new();
    while let Value::Table(table) = value {
        let (name, inner) = table.into_iter().next()?;
        names.push(name);
        value = inner;
    }
    (!names.is_empty()).then_some(names)
}

fn value_of(text: &str) -> Value {
    let table = one_value(&format!("x = {text}"));
    let value = table.and_then(|mut table| table.remove("x"));
    value.unwrap_or_else(|| Value::String(text.trim().into()))
}

/// A table with a single value.
fn one_value(text: &str) -> Option<Table> {
    let table: Table = toml::from_str(text).ok()?;
    (table.len() == 1).then_some(table)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::{Document, Fault};
    use super::*;

    fn assigned(assignment: &Assignment) -> Table {
        let mut document = Document::from_table("here", Table::new());
        document.assign(assignment).unwrap();
        document.table
    }

    #[test]
    fn text_is_read_as_a_line_of_a_file() {
        for (text, line) in [
            ("lidar.pde=0.2", "lidar.pde = 0.2"),
            ("lidar.pde = 20 %", "lidar.pde = \"20 %\""),
            ("\"a b\".c=1", "\"a b\".c = 1"),
            ("list=[1, 2]", "list = [1, 2]"),
            ("word=slow", "word = \"slow\""),
            ("equation=a=b", "equation = \"a=b\""),
            ("two=1\nthree=2", "two = \"1\\nthree=2\""),
        ] {
            let table = assigned(&Assignment::parse(text, "--set").unwrap());
            assert_eq!(table, toml::from_str(line).unwrap(), "{text}");
        }
    }

    #[test]
    fn what_is_no_assignment_is_refused() {
        for (text, says) in [
            ("lidar.pde", "--set: has no value; give key=value"),
            ("=3", "--set: \"\" is not a key"),
            ("a..b=3", "--set: \"a..b\" is not a key"),
            ("a\nb=3", "is not a key"),
        ] {
            let refused = Assignment::parse(text, "--set").unwrap_err().to_string();
            assert!(refused.contains(says), "{refused}");
        }
    }

    #[test]
    fn complaints_name_who_gave_the_value_or_the_file_that_it_names() {
        let mut document = Document::from_table("here", Table::new());
        let file = Assignment::new("cells", "a.lib, b.lib", "--liberty a.lib, b.lib").unwrap();
        document.assign(&file).unwrap();
        for (message, says) in [
            ("is odd", "--liberty a.lib, b.lib: is odd"),
            ("b.lib:7: is odd", "b.lib:7: is odd"),
            ("a.lib: is odd", "a.lib: is odd"),
        ] {
            let complaint = document.complain(vec![Fault::new("cells", message)]);
            assert_eq!(complaint.unwrap_err().to_string(), says);
        }
    }

    proptest! {
        #[test]
        fn values_stay_what_they_are(text in "\\PC{0,20}", number: f64) {
            for value in [Value::String(text), Value::Float(number)] {
                let given = Assignment::new("a.b", value.clone(), "here").unwrap();
                let kept = &assigned(&given)["a"]["b"];
                // Unlike `==`, this takes no number for itself.
                prop_assert_eq!(format!("{kept:?}"), format!("{value:?}"));
            }
        }
    }
}
