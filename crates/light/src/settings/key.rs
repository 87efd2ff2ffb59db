//! One key of a settings file.

use toml::Value;

use super::quantity::{self, LikelyQuantity};
use crate::files::{Misfit, in_plain_words, is_no_word, nearest, unknown_word};

/// A key: what it is, in which unit, what it may be, and where its default comes from.
#[derive(Debug, Clone, Copy)]
pub struct Key {
    /// Name in files.
    pub name: &'static str,
    /// What it is, without a full stop.
    pub what: &'static str,
    /// Symbol of the unit that plain numbers have; empty for numbers without one and for words.
    pub unit: &'static str,
    /// What it may be.
    pub range: Range,
    /// The least and the greatest size of what it is in use, besides 0; a value far from it is probably in another unit.
    pub usual: Option<(f64, f64)>,
    /// Where its default comes from.
    pub source: &'static str,
}

/// What a key may be. Of a list of numbers, each is held to it.
#[derive(Debug, Clone, Copy)]
pub enum Range {
    /// From the first number to the second, both included.
    Within(f64, f64),
    /// Above the first number, up to the second.
    Above(f64, f64),
    /// As [`Range::Within`], with the reason for the upper limit.
    Limited(f64, f64, &'static str),
    /// One of these words.
    OneOf(&'static [&'static str]),
    /// One of these words, or a measured curve of such pairs, in the file or in a CSV file.
    WordOrCurve(&'static [&'static str], &'static str),
    /// true or false.
    Switch,
    /// Any text.
    Text,
}

/// A number, with an exponent outside of `plain`.
fn in_short(number: f64, plain: std::ops::Range<f64>) -> String {
    if number == 0.0 || !number.is_finite() || plain.contains(&number.abs()) {
        format!("{number}")
    } else {
        format!("{number:e}")
    }
}

impl Range {
    fn holds(self, value: f64) -> bool {
        match self {
            Range::Within(least, most) | Range::Limited(least, most, _) => {
                (least..=most).contains(&value)
            }
            Range::Above(below, most) => value > below && value <= most,
            Range::OneOf(_) | Range::WordOrCurve(..) | Range::Switch | Range::Text => true,
        }
    }
}

impl std::fmt::Display for Range {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let short = |x: f64| in_short(x, 1e-3..1e5);
        match *self {
            Range::Within(least, f64::MAX) => write!(f, "{} or more", short(least)),
            Range::Above(below, f64::MAX) => write!(f, "above {}", short(below)),
            Range::Within(least, most) | Range::Limited(least, most, _) => {
                write!(f, "{} to {}", short(least), short(most))
            }
            Range::Above(below, most) => {
                write!(f, "above {}, up to {}", short(below), short(most))
            }
            Range::OneOf(words) => write!(f, "{}", words.join(", ")),
            Range::WordOrCurve(words, of) => write!(
                f,
                "{}, pairs of {of}, or a .csv file of two such columns",
                words.join(", ")
            ),
            Range::Switch => write!(f, "true or false"),
            Range::Text => write!(f, "any text"),
        }
    }
}

/// The numbers of a value, of lists too.
fn numbers(value: &Value) -> Box<dyn Iterator<Item = f64> + '_> {
    match value {
        Value::Integer(number) => Box::new(std::iter::once(*number as f64)),
        Value::Float(number) => Box::new(std::iter::once(*number)),
        Value::Array(values) => Box::new(values.iter().flat_map(numbers)),
        _ => Box::new(std::iter::empty()),
    }
}

impl Key {
    /// A key; see its fields.
    pub(crate) const fn new(
        name: &'static str,
        unit: &'static str,
        range: Range,
        what: &'static str,
        source: &'static str,
    ) -> Self {
        Key {
            name,
            what,
            unit,
            range,
            usual: None,
            source,
        }
    }

    /// A key without a unit, whose default is chosen.
    pub const fn chosen(name: &'static str, range: Range, what: &'static str) -> Self {
        Key::new(name, "", range, what, "chosen")
    }

    /// The same value as a plain number (or list of numbers) in the key's unit, where it is a number with a unit as text.
    ///
    /// # Errors
    /// What is wrong with the text, and the cure.
    pub fn plain(&self, value: &Value) -> Result<Value, String> {
        let is_number = !matches!(
            self.range,
            Range::OneOf(_) | Range::WordOrCurve(..) | Range::Switch | Range::Text
        );
        match value {
            Value::String(text) if is_number => {
                let number = quantity::in_unit(text, self.unit)
                    .map_err(|message| format!("{} = {text:?} {message}", self.name))?;
                // Whole numbers stay whole, for keys that count.
                Ok(if number.fract() == 0.0 && number.abs() < 1e15 {
                    Value::Integer(number as i64)
                } else {
                    Value::Float(number)
                })
            }
            Value::Array(values) => {
                let values: Result<_, String> = values.iter().map(|v| self.plain(v)).collect();
                Ok(Value::Array(values?))
            }
            other => Ok(other.clone()),
        }
    }

    /// What a reader says of a value of the wrong type, in the user's words and with what may be written instead.
    pub(crate) fn misfit(&self, said: &str) -> String {
        let range = &self.range;
        let Some(misfit) = Misfit::from_message(said.trim()) else {
            return match range {
                Range::OneOf(words) if is_no_word(said.trim()) => {
                    format!(
                        "{}: a word belongs here; give {}",
                        self.name,
                        words.join(", ")
                    )
                }
                Range::WordOrCurve(words, _) => match unknown_word(said) {
                    Some(word) if nearest(word, words.iter().copied()).is_none() => {
                        format!("{}: `{word}` is impossible; give {range}", self.name)
                    }
                    _ => format!("{}: {}", self.name, in_plain_words(said)),
                },
                _ => format!("{}: {}", self.name, in_plain_words(said)),
            };
        };
        let wanted = match range {
            Range::OneOf(_) | Range::WordOrCurve(..) | Range::Switch => range.to_string(),
            Range::Text => return format!("{} = {misfit}", self.name),
            _ if misfit.wants_number() => {
                format!("{}, {range}{}", misfit.wanted, self.after_number())
            }
            _ => return format!("{} = {misfit}", self.name),
        };
        format!(
            "{} = {} is impossible; give {wanted}",
            self.name, misfit.found
        )
    }

    /// The unit as it follows a number.
    fn after_number(&self) -> String {
        match self.unit {
            "" => String::new(),
            unit => format!(" {unit}"),
        }
    }

    /// What is wrong with a plain value of the right type, if anything.
    pub fn fault(&self, value: &Value) -> Option<String> {
        let number = match value {
            Value::Integer(number) => *number as f64,
            Value::Float(number) => *number,
            Value::Array(values) => return values.iter().find_map(|v| self.fault(v)),
            _ => return None,
        };
        if self.range.holds(number) {
            return None;
        }
        let unit = self.after_number();
        let because = match self.range {
            Range::Limited(_, _, reason) if number >= 0.0 => format!(": {reason}"),
            _ => String::new(),
        };
        // A number of something is no share, which may be in per cent.
        let is_number = self.unit.is_empty() && self.range.holds(2.0);
        let is_possible = |number: f64| !is_number && self.range.holds(number);
        let meant = quantity::likely_quantity(number, self.unit, is_possible);
        let meant = meant.map_or(String::new(), |meant| format!("; {}", self.advice(&meant)));
        Some(format!(
            "{} = {} is impossible; give {}{unit}{because}{meant}",
            self.name,
            in_short(number, 1e-6..1e15),
            self.range
        ))
    }

    /// What to write for a quantity that may have been meant.
    fn advice(&self, meant: &LikelyQuantity) -> String {
        let number = in_short(meant.number, 1e-3..1e7);
        format!(
            "if you mean {}, give {number}{}",
            meant.text,
            self.after_number()
        )
    }

    /// A sentence on a possible value that is far from every usual one, with the unit in which it would be usual.
    pub fn remark(&self, value: &Value) -> Option<String> {
        let (least, most) = self.usual?;
        let is_usual = |number: f64| number == 0.0 || (least..=most).contains(&number.abs());
        let unusual = numbers(value).filter(|number| !is_usual(*number));
        let number = unusual.max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
        let short = |x: f64| in_short(x, 1e-3..1e5);
        let usual = match least {
            0.0 => format!("sizes up to {}", short(most)),
            _ => format!("{} to {}", short(least), short(most)),
        };
        let unit = self.after_number();
        let advice = match quantity::likely_quantity(number, self.unit, is_usual) {
            Some(meant) => self.advice(&meant),
            None => "check its unit".to_owned(),
        };
        let number = in_short(number, 1e-3..1e5);
        Some(format!(
            "{} = {number}{unit} is far from the usual {usual}{unit}; {advice}",
            self.name
        ))
    }
}
