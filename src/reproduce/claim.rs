//! A published figure beside ours, and what to make of the difference.

use serde::Serialize;

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
    /// No number but words, with the range that we read in them: an infinite end is open.
    Says(&'static str, f64, f64),
    /// Nothing: a curve without numbers, or another convention of a number that is printed elsewhere.
    Nothing,
}

impl Published {
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
    fn agrees(self, value: f64) -> Option<bool> {
        let (low, high) = self.range()?;
        let rounding = if value.is_finite() {
            1e-12 * value.abs()
        } else {
            0.0
        };
        Some((low - rounding..=high + rounding).contains(&value))
    }

    /// How far `value` is from what is published: from the number, or from the nearer end of a range.
    pub fn difference(self, value: f64) -> Option<f64> {
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
    pub fn text(self) -> String {
        match self {
            Published::Exactly(text) | Published::Within(text, _) => text.to_owned(),
            Published::AtLeast(text) => format!("≥ {text}"),
            Published::AtMost(text) => format!("≤ {text}"),
            Published::Between(low, high) => format!("{low} to {high}"),
            Published::Says(words, ..) => format!("“{words}”"),
            Published::Nothing => String::new(),
        }
    }

    /// The tolerance either way.
    pub fn tolerance_text(self) -> String {
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

/// A number with four significant digits; whole numbers up to a million with all of theirs.
pub(super) fn figure(value: f64) -> String {
    let magnitude = value.abs();
    if value == 0.0 {
        "0".into()
    } else if !value.is_finite() {
        value.to_string()
    } else if value == value.round() && magnitude < 1e6 {
        format!("{value}")
    } else if !(1e-3..1e6).contains(&magnitude) {
        format!("{value:.3e}")
    } else {
        let decimals = (3 - magnitude.log10().floor() as i32).max(0) as usize;
        format!("{value:.decimals$}")
    }
}

/// What became of a comparison.
///
/// *Agrees* is kept for numbers that could have come out otherwise. A number that was put into the model, or takes nothing
/// but what was put in, is *given*: that it comes out again says only that nothing was lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Ours is within the tolerance.
    Agrees,
    /// Ours is not, which is known and explained.
    Differs,
    /// An input that comes out again.
    Given,
    /// Ours is not, although it is expected to be: a fault.
    Fails,
    /// Ours alone: nothing is published to compare it with.
    Ours,
    /// Theirs alone: the model has no part that could say.
    NotModelled,
}

impl Verdict {
    /// Every verdict.
    pub const ALL: [Verdict; 6] = [
        Verdict::Agrees,
        Verdict::Differs,
        Verdict::Given,
        Verdict::Fails,
        Verdict::Ours,
        Verdict::NotModelled,
    ];

    /// In words.
    pub fn text(self) -> &'static str {
        match self {
            Verdict::Agrees => "agrees",
            Verdict::Differs => "differs",
            Verdict::Given => "given",
            Verdict::Fails => "FAILS",
            Verdict::Ours => "ours alone",
            Verdict::NotModelled => "not modelled",
        }
    }
}

/// One comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The quantity.
    pub what: String,
    /// Its unit; empty for a pure number.
    pub unit: &'static str,
    /// What the thesis prints.
    pub published: Published,
    /// What the model gives, where it has a part that can say.
    pub computed: Option<f64>,
    /// Why the two are known to differ; `None` where they must agree.
    pub known_difference: Option<String>,
    /// How the published number went into the model; `None` where it did not.
    pub input: Option<String>,
    /// Whether the claim can be met without it.
    pub is_aside: bool,
    /// Convention, or what to think of.
    pub remark: String,
}

impl Row {
    /// A published number that the model must meet.
    pub fn holds(
        what: impl Into<String>,
        unit: &'static str,
        published: Published,
        computed: f64,
    ) -> Self {
        Row {
            what: what.into(),
            unit,
            published,
            computed: Some(computed),
            known_difference: None,
            input: None,
            is_aside: false,
            remark: String::new(),
        }
    }

    /// A number of ours beside which nothing is published.
    pub fn ours(what: impl Into<String>, unit: &'static str, computed: f64) -> Self {
        Row::holds(what, unit, Published::Nothing, computed)
    }

    /// A published number that the model has no part for.
    pub fn not_modelled(
        what: impl Into<String>,
        unit: &'static str,
        published: Published,
        why: impl Into<String>,
    ) -> Self {
        Row {
            computed: None,
            remark: why.into(),
            ..Row::holds(what, unit, published, 0.0)
        }
    }

    /// Says that this difference is known, and why.
    #[must_use]
    pub fn differs(mut self, why: impl Into<String>) -> Self {
        self.known_difference = Some(why.into());
        self
    }

    /// Says that the published number was put into the model, and how: coming out again, it is *given*.
    #[must_use]
    pub fn given(mut self, how: impl Into<String>) -> Self {
        self.input = Some(how.into());
        self
    }

    /// Says that the claim is about something else: the row's verdict, unless it fails, is not the claim's.
    #[must_use]
    pub fn aside(mut self) -> Self {
        self.is_aside = true;
        self
    }

    /// Adds a remark.
    #[must_use]
    pub fn remark(mut self, remark: impl Into<String>) -> Self {
        self.remark = remark.into();
        self
    }

    /// What became of it. NaN never agrees.
    pub fn verdict(&self) -> Verdict {
        let Some(computed) = self.computed else {
            return Verdict::NotModelled;
        };
        match self.published.agrees(computed) {
            None => Verdict::Ours,
            Some(true) if self.input.is_some() => Verdict::Given,
            Some(true) => Verdict::Agrees,
            Some(false) if self.known_difference.is_some() => Verdict::Differs,
            Some(false) => Verdict::Fails,
        }
    }

    /// Computed less published, in the row's unit and, where that is a number other than zero, relative to it.
    pub fn difference(&self) -> Option<(f64, Option<f64>)> {
        let computed = self.computed?;
        let difference = self.published.difference(computed)?;
        let published = computed - difference;
        let is_number = published != 0.0 && !matches!(self.published, Published::Says(..));
        let relative = is_number.then(|| difference / published.abs());
        Some((difference, relative))
    }

    /// Everything there is to say about it.
    pub fn notes(&self) -> String {
        let why = match self.verdict() {
            Verdict::Differs => self.known_difference.as_deref(),
            Verdict::Given => self.input.as_deref(),
            _ => None,
        };
        let parts = why.into_iter().chain([self.remark.as_str()]);
        let parts: Vec<&str> = parts.filter(|part| !part.is_empty()).collect();
        parts.join(" ")
    }
}

/// One line of the list of published claims.
#[derive(Clone, Copy)]
pub struct Claim {
    /// Its number in the list.
    pub number: u32,
    /// What is claimed, in a few words.
    pub title: &'static str,
    /// Section, equation, figure or table of the thesis.
    pub source: &'static str,
    /// Computes it.
    pub compute: fn() -> Vec<Row>,
}

/// The verdict on a claim: the worst of its published rows. One headline that is not modelled, that differs or that was
/// put in keeps the claim from being met, however many other rows agree.
pub fn overall(rows: &[Row]) -> Verdict {
    let has = |verdict| {
        let mut counting = rows
            .iter()
            .filter(|row| !row.is_aside || verdict == Verdict::Fails);
        counting.any(|row| row.verdict() == verdict)
    };
    let order = [
        Verdict::Fails,
        Verdict::NotModelled,
        Verdict::Differs,
        Verdict::Given,
        Verdict::Agrees,
    ];
    order.into_iter().find(|&v| has(v)).unwrap_or(Verdict::Ours)
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
    fn verdicts_follow_from_range_and_expectation() {
        let row = |published, computed| Row::holds("x", "m", published, computed);
        use Published::*;
        assert_eq!(row(Exactly("0.38"), 0.375).verdict(), Verdict::Agrees);
        assert_eq!(row(Exactly("0.38"), 0.374).verdict(), Verdict::Fails);
        assert_eq!(row(Exactly("0.38"), f64::NAN).verdict(), Verdict::Fails);
        assert_eq!(row(AtMost("6"), f64::INFINITY).verdict(), Verdict::Fails);
        assert_eq!(
            row(Exactly("0.38"), 0.5).differs("why").verdict(),
            Verdict::Differs
        );
        assert_eq!(
            row(Exactly("0.38"), 0.38).differs("why").verdict(),
            Verdict::Agrees
        );
        assert_eq!(row(AtLeast("6"), 5.9).verdict(), Verdict::Fails);
        assert_eq!(row(AtMost("6"), 5.9).verdict(), Verdict::Agrees);
        assert_eq!(row(Between("1", "2"), 1.0).verdict(), Verdict::Agrees);
        assert_eq!(row(Nothing, 1.0).verdict(), Verdict::Ours);
        assert_eq!(
            row(Says("about half", 0.4, 0.6), 0.5).verdict(),
            Verdict::Agrees
        );
        assert_eq!(
            row(Says("seamless", 1.0, f64::INFINITY), 0.9).verdict(),
            Verdict::Fails
        );
        let input = |computed| row(Exactly("1.2"), computed).given("chosen");
        assert_eq!(input(1.2).verdict(), Verdict::Given);
        assert_eq!(
            input(1.3).verdict(),
            Verdict::Fails,
            "an input that is lost on the way"
        );
        assert_eq!(input(1.2).notes(), "chosen");
        let none = Row::not_modelled("x", "m", Exactly("1"), "why");
        assert_eq!(none.verdict(), Verdict::NotModelled);
        assert_eq!(none.difference(), None);
    }

    #[test]
    fn differences_are_from_the_number_or_the_nearer_bound() {
        let difference = |published: Published, value| published.difference(value).unwrap();
        assert_eq!(difference(Published::Within("10", 1.0), 12.0), 2.0);
        assert_eq!(difference(Published::AtLeast("6"), 5.5), -0.5);
        assert_eq!(difference(Published::AtLeast("6"), 7.0), 0.0);
        assert_eq!(difference(Published::Between("1", "2"), 2.5), 0.5);
    }

    #[test]
    fn figures_are_short() {
        let texts = [0.0, 36864.0, 0.1234567, 1139.4321, 2.5e-7, 12.0].map(figure);
        assert_eq!(texts, ["0", "36864", "0.1235", "1139", "2.500e-7", "12"]);
    }

    #[test]
    fn what_is_published_as_zero_has_no_relative_difference() {
        let row = |published, computed| Row::holds("x", "m", published, computed).difference();
        assert_eq!(row(Published::Within("0", 0.02), 0.01), Some((0.01, None)));
        assert_eq!(row(Published::Exactly("2"), 1.0), Some((-1.0, Some(-0.5))));
    }

    #[test]
    fn a_claim_is_met_only_if_all_its_headlines_are() {
        let agrees = Row::holds("a", "", Published::Exactly("1"), 1.0);
        let differs = Row::holds("b", "", Published::Exactly("1"), 2.0).differs("why");
        let given = agrees.clone().given("how");
        let ours = Row::ours("c", "", 1.0);
        let gap = Row::not_modelled("d", "", Published::Exactly("1"), "why");
        let fails = Row::holds("e", "", Published::Exactly("1"), 2.0);
        for (rows, verdict) in [
            (vec![&agrees, &ours], Verdict::Agrees),
            (vec![&agrees, &given], Verdict::Given),
            (vec![&agrees, &given.clone().aside()], Verdict::Agrees),
            (vec![&agrees, &given, &differs], Verdict::Differs),
            (vec![&agrees, &differs, &gap], Verdict::NotModelled),
            (vec![&agrees, &gap, &fails.aside()], Verdict::Fails),
            (vec![&ours], Verdict::Ours),
        ] {
            let rows: Vec<Row> = rows.into_iter().cloned().collect();
            assert_eq!(overall(&rows), verdict, "{rows:?}");
        }
    }
}
