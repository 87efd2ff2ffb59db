//! What a study says of a key that varies: a list of values, or a range.

use serde::Deserialize;
use toml::{Table, Value};

use super::StudyKind;
use super::files::name_of;
use crate::files::{Misfit, in_plain_words};
use crate::sweep::cell::{Column, Holds};
use crate::sweep::keys::{self as names, TypedKey};
use crate::sweep::values::{ValueSpan, Values, VariedKey};

/// A range, as a study writes it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RangeEntry {
    from: Value,
    to: Value,
    steps: Option<u32>,
    #[serde(default)]
    scale: Scale,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Scale {
    #[default]
    Linear,
    Log,
}

/// What `[vary]` says of a key.
pub(super) fn varied(kind: StudyKind, name: &str, value: &Value) -> Result<VariedKey, String> {
    let name = name_of(name);
    let known = names::find(kind, name)?;
    let values = match value {
        Value::Array(list) if list.is_empty() => {
            return Err(format!("{name} has no values; give at least one"));
        }
        Value::Array(list) => {
            let list: Result<_, String> = list
                .iter()
                .map(|value| names::checked(&known, value))
                .collect();
            Values::List(list?)
        }
        Value::Table(range) => Values::Range(span(&known, name, range)?),
        _ => {
            return Err(format!(
                "{name} has one value; give a list or a range, or write it below [fixed]"
            ));
        }
    };
    let is_list = |value: &Value| value.is_array();
    let holds = match &values {
        // A position is no number that one could plot.
        Values::List(list) if list.iter().any(is_list) => Holds::Word,
        _ => known.holds,
    };
    Ok(VariedKey {
        name: name.to_owned(),
        column: Column::new(name, known.key.unit, holds),
        values,
    })
}

fn span(known: &TypedKey, name: &str, range: &Table) -> Result<ValueSpan, String> {
    let RangeEntry {
        from,
        to,
        steps,
        scale,
    } = range.clone().try_into().map_err(|e: toml::de::Error| {
        let said = e.message().trim();
        match Misfit::from_message(said) {
            Some(misfit) => format!(
                "{name}: {}; give {{from = …, to = …, steps = …, scale = \"linear\" or \"log\"}}",
                misfit.without_cure()
            ),
            None => format!("{name}: {}", in_plain_words(said)),
        }
    })?;
    let ends = [from, to].map(|end| -> Result<f64, String> {
        let end = names::checked(known, &end)?;
        let number = end.as_integer().map(|n| n as f64).or(end.as_float());
        number.ok_or_else(|| format!("{name} does not take numbers; give a list of its values"))
    });
    let [from, to] = ends;
    let (from, to) = (from?, to?);
    if steps == Some(0) || (steps == Some(1) && from != to) {
        return Err(format!(
            "{name}: a range needs at least 2 steps, its ends; give steps"
        ));
    }
    if scale == Scale::Log && !(from > 0.0 && to > 0.0) {
        return Err(format!(
            "{name}: equal ratios never reach {}; give ends above 0, or scale = \"linear\"",
            from.min(to)
        ));
    }
    Ok(ValueSpan {
        from,
        to,
        steps,
        is_log: scale == Scale::Log,
        is_whole: known.holds == Holds::Whole,
    })
}
