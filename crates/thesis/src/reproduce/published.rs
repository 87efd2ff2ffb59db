//! A published figure, as the thesis prints it, and what agrees with it.

/// What the thesis prints, always as it prints it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Published {
    /// A number, good to half a unit of its last digit.
    Exactly(&'static str),
    /// A number with a tolerance either way, in the same unit: where the thesis rounds to fewer digits than it
    /// prints, or says "about".
    Within(&'static str, f64),
    /// "At least", "over".
    AtLeast(&'static str),
    /// "No more than", "under".
    AtMost(&'static str),
    /// A range.
    Between(&'static str, &'static str),
    /// No number but words, as they stand in the thesis, with the range that we read in them: an infinite end is open.
    Says(&'static str, f64, f64),
    /// Nothing: a curve without numbers, or another convention of a number that is printed elsewhere.
    Nothing,
}

impl Published {
    /// What `thesis.toml` says, in the notation at its head.
    ///
    /// # Panics
    /// When it is in no such notation.
    pub(super) fn parse(text: &'static str) -> Self {
        if let Some((words, read)) = text
            .strip_prefix('\u{201c}')
            .and_then(|t| t.split_once("\u{201d} "))
        {
            let (low, high) = match (read.strip_prefix("≥ "), read.split_once(" to ")) {
                (Some(low), _) => (number(low), f64::INFINITY),
                (None, Some((low, high))) => (number(low), number(high)),
                (None, None) => (number(read), number(read)),
            };
            return Published::Says(words, low, high);
        }
        if let Some((value, tolerance)) = text.split_once(" ± ") {
            Published::Within(value, number(tolerance))
        } else if let Some((low, high)) = text.split_once(" to ") {
            Published::Between(low, high)
        } else if let Some(least) = text.strip_prefix("≥ ") {
            Published::AtLeast(least)
        } else if let Some(most) = text.strip_prefix("≤ ") {
            Published::AtMost(most)
        } else if text.is_empty() {
            Published::Nothing
        } else {
            Published::Exactly(text)
        }
    }

    /// Least and greatest value that agrees; `None` where nothing is published.
    pub fn range(self) -> Option<(f64, f64)> {
        match self {
            Published::Exactly(text) => {
                let half = 0.5 * last_digit(text);
                Some((number(text) - half, number(text) + half))
            }
            Published::Within(text, tolerance) => {
                Some((number(text) - tolerance, number(text) + tolerance))
            }
            Published::AtLeast(text) => Some((number(text), f64::INFINITY)),
            Published::AtMost(text) => Some((f64::NEG_INFINITY, number(text))),
            Published::Between(low, high) => Some((number(low), number(high))),
            Published::Says(_, low, high) => Some((low, high)),
            Published::Nothing => None,
        }
    }

    /// Whether `value` is within the tolerance, a last bit of rounding granted.
    pub(super) fn agrees(self, value: f64) -> Option<bool> {
        let (low, high) = self.range()?;
        let rounding = if value.is_finite() {
            1e-12 * value.abs()
        } else {
            0.0
        };
        Some((low - rounding..=high + rounding).contains(&value))
    }

    /// How far `value` is from what is published: from the number, or from the nearer end of a range.
    pub(crate) fn difference(self, value: f64) -> Option<f64> {
        let nearest = match self {
            Published::Exactly(text) | Published::Within(text, _) => number(text),
            _ => {
                let (low, high) = self.range()?;
                value.clamp(low, high)
            }
        };
        Some(value - nearest)
    }

    /// As the thesis prints it.
    pub(crate) fn text(self) -> String {
        match self {
            Published::Exactly(text) | Published::Within(text, _) => text.to_owned(),
            Published::AtLeast(text) => format!("≥ {text}"),
            Published::AtMost(text) => format!("≤ {text}"),
            Published::Between(low, high) => format!("{low} to {high}"),
            Published::Says(words, ..) => format!("\u{201c}{words}\u{201d}"),
            Published::Nothing => String::new(),
        }
    }

    /// The tolerance either way.
    pub(crate) fn tolerance_text(self) -> String {
        match self {
            Published::Exactly(text) => format!("±{}", 0.5 * last_digit(text)),
            Published::Within(_, tolerance) => format!("±{tolerance}"),
            Published::AtLeast(_) | Published::AtMost(_) | Published::Between(..) => "bound".into(),
            Published::Says(_, low, f64::INFINITY) => format!("read as ≥ {low}"),
            Published::Says(_, f64::NEG_INFINITY, high) => format!("read as ≤ {high}"),
            Published::Says(_, low, high) if low == high => format!("read as {low}"),
            Published::Says(_, low, high) => format!("read as {low} to {high}"),
            Published::Nothing => String::new(),
        }
    }
}

fn number(text: &str) -> f64 {
    text.parse().expect("a published number is written as one")
}

/// The value of one unit in the last digit of `text`.
fn last_digit(text: &str) -> f64 {
    let mantissa = text.split('e').next().unwrap_or(text);
    let decimals = mantissa.split_once('.').map_or(0, |(_, d)| d.len());
    let exponent = text.split_once('e').map_or(0, |(_, e)| {
        e.parse().expect("a published number is written as one")
    });
    10f64.powi(exponent - decimals as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_printed_number_is_good_to_half_its_last_digit() {
        for (text, low, high) in [
            ("0.43", 0.425, 0.435),
            ("768", 767.5, 768.5),
            ("1.2e3", 1150.0, 1250.0),
            ("-2.0", -2.05, -1.95),
        ] {
            let (a, b) = Published::Exactly(text).range().unwrap();
            assert!(
                (a - low).abs() < 1e-9 && (b - high).abs() < 1e-9,
                "{text}: {a} {b}"
            );
        }
    }

    #[test]
    fn every_notation_is_read() {
        use Published::*;
        for (text, published) in [
            ("", Nothing),
            ("-1.2e3", Exactly("-1.2e3")),
            ("2.4 ± 0.2", Within("2.4", 0.2)),
            ("≥ 6", AtLeast("6")),
            ("≤ 5", AtMost("5")),
            ("1 to 2", Between("1", "2")),
            ("“a to b” 1 to 2", Says("a to b", 1.0, 2.0)),
            ("“at all” 4096", Says("at all", 4096.0, 4096.0)),
            ("“far” ≥ 1", Says("far", 1.0, f64::INFINITY)),
        ] {
            assert_eq!(Published::parse(text), published);
        }
    }

    #[test]
    fn differences_are_from_the_number_or_the_nearer_bound() {
        let difference = |published: Published, value| published.difference(value).unwrap();
        assert_eq!(difference(Published::Within("10", 1.0), 12.0), 2.0);
        assert_eq!(difference(Published::AtLeast("6"), 5.5), -0.5);
        assert_eq!(difference(Published::AtLeast("6"), 7.0), 0.0);
        assert_eq!(difference(Published::Between("1", "2"), 2.5), 0.5);
    }
}
