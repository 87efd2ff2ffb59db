//! Values of settings between Python and TOML.

use std::ffi::CString;
use std::hash::{DefaultHasher, Hash, Hasher};

use guided_dtof::files::in_plain_words;
use guided_dtof::settings::{Assignment, Document, said_remarks};
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::{PyKeyError, PyTypeError, PyUserWarning};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString};
use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::{Table, Value};

use crate::failure::Failure;

/// A value as a settings file would have it; NumPy's scalars are numbers, too.
///
/// # Errors
/// When it is nothing that a settings file has.
pub(crate) fn to_toml(value: &Bound<'_, PyAny>) -> PyResult<Value> {
    if let Ok(flag) = value.cast::<PyBool>() {
        return Ok(Value::Boolean(flag.is_true()));
    }
    if value.is_instance_of::<PyInt>() {
        let number = value.extract();
        let too_large = || Failure::Input(format!("{value} is too large; give 64-bit numbers"));
        return Ok(Value::Integer(number.map_err(|_: PyErr| too_large())?));
    }
    if value.is_instance_of::<PyFloat>() {
        return Ok(Value::Float(value.extract()?));
    }
    if let Ok(text) = value.cast::<PyString>() {
        return Ok(Value::String(text.extract()?));
    }
    if let Ok(dict) = value.cast::<PyDict>() {
        return to_table(dict).map(Value::Table);
    }
    // NumPy's scalars and arrays say themselves what they are.
    if let Ok(plain) = value.call_method0("tolist")
        && !plain.get_type().is(value.get_type())
    {
        return to_toml(&plain);
    }
    if value.hasattr("__fspath__")? {
        return Ok(Value::String(value.call_method0("__fspath__")?.extract()?));
    }
    if let Ok(items) = value.try_iter() {
        let items: PyResult<Vec<Value>> = items.map(|item| to_toml(&item?)).collect();
        return Ok(Value::Array(items?));
    }
    let what = value.get_type().name()?;
    Err(PyTypeError::new_err(format!(
        "{what} is no value of a setting; give a number, a text, true or false, or a list of these"
    )))
}

/// A dict with keys that are texts; keys whose value is None are left out.
///
/// # Errors
/// As [`to_toml`].
pub(crate) fn to_table(dict: &Bound<'_, PyDict>) -> PyResult<Table> {
    let mut table = Table::new();
    for (key, value) in dict {
        if !value.is_none() {
            table.insert(key.extract()?, to_toml(&value)?);
        }
    }
    Ok(table)
}

/// A table as what it stands for.
///
/// # Errors
/// Unknown keys, and values of other types, each by its key.
pub(crate) fn typed<T: DeserializeOwned>(table: Table) -> Result<T, Failure> {
    table.try_into().map_err(|e: toml::de::Error| {
        let said = in_plain_words(e.message());
        // The reader adds the key in a line of its own.
        let whole = e.to_string();
        let key = whole
            .lines()
            .find_map(|line| line.strip_prefix("in `")?.strip_suffix('`'));
        match key {
            Some(key) => Failure::argument(key, said),
            None => Failure::Input(said),
        }
    })
}

/// A dict as TOML text: sections, and below them a value a line, in the dict's order, which tables do not keep. Keys with dots in them
/// stay as they are, and lists of dicts come last.
///
/// # Errors
/// As [`to_toml`].
pub(crate) fn to_text(dict: &Bound<'_, PyDict>) -> PyResult<String> {
    let (mut text, mut lists) = (String::new(), Vec::new());
    for (section, values) in dict {
        let section = Value::String(section.extract()?).to_string();
        match values.cast::<PyDict>() {
            Ok(values) => {
                let mut lines = String::new();
                write_lines(&mut lines, &section, "", values, &mut lists)?;
                text += &format!("[{section}]\n{lines}");
            }
            // It stands before all sections.
            Err(_) => text.insert_str(0, &format!("{section} = {}\n", to_toml(&values)?)),
        }
    }
    for (path, items) in lists {
        for item in items {
            let mut lines = String::new();
            write_lines(&mut lines, "", "", &item, &mut Vec::new())?;
            text += &format!("[[{path}]]\n{lines}");
        }
    }
    Ok(text)
}

/// Lists of dicts by their path.
type Lists<'py> = Vec<(String, Vec<Bound<'py, PyDict>>)>;

fn write_lines<'py>(
    lines: &mut String,
    section: &str,
    prefix: &str,
    values: &Bound<'py, PyDict>,
    lists: &mut Lists<'py>,
) -> PyResult<()> {
    for (key, value) in values {
        let key = format!("{prefix}{}", Value::String(key.extract()?));
        if let Ok(inner) = value.cast::<PyDict>() {
            write_lines(lines, section, &format!("{key}."), inner, lists)?;
            continue;
        }
        match value.extract::<Vec<Bound<'py, PyDict>>>() {
            Ok(items) if !items.is_empty() => lists.push((format!("{section}.{key}"), items)),
            _ if value.is_none() => (),
            _ => *lines += &format!("{key} = {}\n", to_toml(&value)?),
        }
    }
    Ok(())
}

/// The same as an object of Python.
///
/// # Errors
/// When there is no memory for it.
pub(crate) fn to_python<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    match value {
        Value::String(text) => text.into_bound_py_any(py),
        Value::Integer(number) => number.into_bound_py_any(py),
        Value::Float(number) => number.into_bound_py_any(py),
        Value::Boolean(flag) => flag.into_bound_py_any(py),
        Value::Datetime(time) => time.to_string().into_bound_py_any(py),
        Value::Array(items) => {
            let items: PyResult<Vec<_>> = items.iter().map(|item| to_python(py, item)).collect();
            Ok(PyList::new(py, items?)?.into_any())
        }
        Value::Table(table) => Ok(table_to_python(py, table)?.into_any()),
    }
}

/// A table as a dict.
///
/// # Errors
/// As [`to_python`].
pub(crate) fn table_to_python<'py>(py: Python<'py>, table: &Table) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for (key, value) in table {
        dict.set_item(key, to_python(py, value)?)?;
    }
    Ok(dict)
}

/// What the library would write as JSON, as an object of Python: the same names as in frame.json.
///
/// # Errors
/// When there is no memory for it.
pub(crate) fn by_json<'py>(py: Python<'py>, value: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value).expect("the library's reports are JSON");
    py.import("json")?.call_method1("loads", (text,))
}

/// The settings in a dict, of the section `of` if that is not empty; `place` is the call, in which errors are reported.
///
/// # Errors
/// Values and keys that are none.
pub(crate) fn assignments(
    of: &str,
    place: &str,
    dict: Option<&Bound<'_, PyDict>>,
) -> PyResult<Vec<Assignment>> {
    let assignment = |(key, value): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
        let (key, value): (String, _) = (key.extract()?, to_toml(&value)?);
        let origin = format!("{place}({key}={value})");
        Ok(Assignment::new(&format!("{of}{key}"), value, origin).map_err(Failure::from)?)
    };
    dict.into_iter().flatten().map(assignment).collect()
}

/// These settings with others assigned by `with_`, in whose place errors are reported.
///
/// # Errors
/// Values that are none, and keys that are not there.
pub(crate) fn reassigned(
    name: &str,
    table: Table,
    keys: Option<&Bound<'_, PyDict>>,
) -> PyResult<Document> {
    let mut document = Document::from_table(name, table);
    for assignment in assignments("", "with_", keys)? {
        document.assign(&assignment).map_err(Failure::from)?;
    }
    Ok(document)
}

/// Warns of values that are probably in another unit than their key has; the warning is about the line `level` calls up in Python.
///
/// # Errors
/// When warnings are errors.
pub(crate) fn warn_of(
    py: Python<'_>,
    source: &str,
    remarks: &[String],
    level: i32,
) -> PyResult<()> {
    let category = py.get_type::<PyUserWarning>();
    for said in said_remarks(source, remarks) {
        let said = CString::new(said).expect("a name of a file has no zero in it");
        PyErr::warn(py, &category, &said, level)?;
    }
    Ok(())
}

/// The value that was found under `key`, as `[]` gives it.
///
/// # Errors
/// KeyError where there is none.
pub(crate) fn item<'py>(
    py: Python<'py>,
    key: &str,
    value: Option<&Value>,
) -> PyResult<Bound<'py, PyAny>> {
    match value {
        Some(value) => to_python(py, value),
        None => Err(PyKeyError::new_err(key.to_owned())),
    }
}

/// Settings as notebooks show them.
///
/// # Errors
/// When there is no memory for it.
pub(crate) fn html_of(py: Python<'_>, title: String, table: &Table) -> PyResult<String> {
    let html = py.import("gdtof._html")?;
    let arguments = (title, table_to_python(py, table)?);
    html.call_method1("of_keys", arguments)?.extract()
}

/// A value of a table by its dotted name; items of lists go by their `name`, or by their number from 1.
pub(crate) fn value_at<'t>(table: &'t Table, key: &str) -> Option<&'t Value> {
    let mut names = key.split('.');
    let mut at = table.get(names.next()?)?;
    for name in names {
        at = match at {
            Value::Table(inner) => inner.get(name)?,
            Value::Array(items) => {
                let has_name =
                    |item: &&Value| item.get("name").and_then(Value::as_str) == Some(name);
                let by_number = || items.get(name.parse::<usize>().ok()?.checked_sub(1)?);
                items.iter().find(has_name).or_else(by_number)?
            }
            _ => return None,
        };
    }
    Some(at)
}

/// A hash of settings: equal settings have equal ones.
pub(crate) fn hash_of(table: &Table) -> u64 {
    let mut hasher = DefaultHasher::new();
    table.to_string().hash(&mut hasher);
    hasher.finish()
}
