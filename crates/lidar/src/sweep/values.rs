//! Values that a study gives a key: lists and ranges.

use toml::Value;

use super::cell::{Column, TableCell};

/// Values of one key.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Values {
    /// These, in order.
    List(Vec<Value>),
    /// Numbers between two.
    Range(ValueSpan),
}

/// Numbers from one to another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ValueSpan {
    pub(super) from: f64,
    pub(super) to: f64,
    /// How many, both ends included; not needed where a design draws values.
    pub(super) steps: Option<u32>,
    /// In equal ratios.
    pub(super) is_log: bool,
    /// Rounded, for keys that count.
    pub(super) is_whole: bool,
}

impl ValueSpan {
    /// The value at a share of the way, 0 to 1.
    fn value(&self, share: f64) -> Value {
        let ValueSpan { from, to, .. } = *self;
        // The ends are what was written, to the bit.
        let number = match share {
            0.0 => from,
            1.0 => to,
            _ if self.is_log => from * libm::exp(share * libm::log(to / from)),
            _ => from + share * (to - from),
        };
        if self.is_whole {
            Value::Integer(number.round() as i64)
        } else {
            Value::Float(number)
        }
    }
}

/// A key that varies.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct VariedKey {
    /// Its whole name, as `sensor.clk_hz`.
    pub(super) name: String,
    pub(super) values: Values,
    /// Its column in the table.
    pub(super) column: Column,
}

impl Values {
    /// The list, or the ends of the range.
    pub(super) fn all(&self) -> Value {
        match self {
            Values::List(list) => Value::Array(list.clone()),
            Values::Range(span) => Value::Array(vec![span.value(0.0), span.value(1.0)]),
        }
    }
}

impl VariedKey {
    /// How many values it has, where that is a number.
    pub(super) fn len(&self) -> Option<u64> {
        match &self.values {
            Values::List(list) => Some(list.len() as u64),
            Values::Range(span) => span.steps.map(u64::from),
        }
    }

    /// One of its values, counted from 0.
    pub(super) fn value(&self, index: u64) -> Value {
        match &self.values {
            Values::List(list) => list[index as usize].clone(),
            Values::Range(span) => match span.steps.map(u64::from) {
                None | Some(1) => span.value(0.0),
                Some(steps) => span.value(index as f64 / (steps - 1) as f64),
            },
        }
    }

    /// The value at a share of the way, from 0 to less than 1.
    pub(super) fn value_at(&self, share: f64) -> Value {
        match &self.values {
            Values::List(list) => {
                let index = (share * list.len() as f64) as usize;
                list[index.min(list.len() - 1)].clone()
            }
            Values::Range(span) => span.value(share),
        }
    }

    pub(super) fn cell(&self, value: &Value) -> TableCell {
        TableCell::from_value(value, self.column.holds)
    }
}

/// Keys that vary together, the first values of all, then the second ones, and so on.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Axis(pub(super) Vec<VariedKey>);

impl Axis {
    /// How many values each of its keys has, where that is a number.
    pub(super) fn len(&self) -> Option<u64> {
        self.0[0].len()
    }
}
