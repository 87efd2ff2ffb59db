//! A published figure beside ours, and what to make of the difference.
//!
//! Words in typographic quotes, and those of [`Published::Says`], are the thesis's, as they stand there; all that the project says of the
//! thesis keeps to it, and `tests/figures/quotations_stand_in_the_thesis.rs` looks each up.

use serde::Serialize;

use super::published::Published;

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
        let decimals = (3 - libm::log10(magnitude).floor() as i32).max(0) as usize;
        format!("{value:.decimals$}")
    }
}

/// What became of a comparison.
///
/// *Agrees* is kept for numbers that could have come out otherwise. A number that was put into the model, or takes nothing
/// but what was put in, is *given*: that it comes out again says only that nothing was lost. A measured number whose confidence interval
/// lies partly in the tolerance and partly outside is *not shown* to do either.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Ours is within the tolerance.
    Agrees,
    /// Ours is not, which is known and explained.
    Differs,
    /// Ours is too uncertain to tell.
    NotShown,
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
    pub const ALL: [Verdict; 7] = [
        Verdict::Agrees,
        Verdict::Differs,
        Verdict::NotShown,
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
            Verdict::NotShown => "not shown",
            Verdict::Given => "given",
            Verdict::Fails => "FAILS",
            Verdict::Ours => "ours alone",
            Verdict::NotModelled => "not modelled",
        }
    }
}

/// One comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct ClaimRow {
    /// The quantity.
    pub what: String,
    /// Its unit; empty for a pure number.
    pub unit: &'static str,
    /// What the thesis prints.
    pub published: Published,
    /// What the model gives, where it has a part that can say.
    pub computed: Option<f64>,
    /// The 95 % interval of what is measured; `None` where chance has no part in it, or its interval is not known.
    pub interval: Option<(f64, f64)>,
    /// Why the two are known to differ; `None` where they must agree.
    pub known_difference: Option<String>,
    /// How the published number went into the model; `None` where it did not.
    pub input: Option<String>,
    /// Whether the claim can be met without it.
    pub is_aside: bool,
    /// Convention, or what to think of.
    pub remark: String,
}

impl ClaimRow {
    /// A number of ours beside which nothing is published, and which no list names.
    pub(super) fn ours(what: impl Into<String>, unit: &'static str, computed: f64) -> Self {
        ClaimRow {
            what: what.into(),
            unit,
            published: Published::Nothing,
            computed: Some(computed),
            interval: None,
            known_difference: None,
            input: None,
            is_aside: false,
            remark: String::new(),
        }
    }

    /// Says that this difference is known, and why.
    #[must_use]
    pub(crate) fn differs(mut self, why: impl Into<String>) -> Self {
        self.known_difference = Some(why.into());
        self
    }

    /// Adds a remark.
    #[must_use]
    pub(crate) fn remark(mut self, remark: impl Into<String>) -> Self {
        self.remark = remark.into();
        self
    }

    /// What became of it. NaN never agrees.
    pub fn verdict(&self) -> Verdict {
        let Some(computed) = self.computed else {
            return Verdict::NotModelled;
        };
        let Some(mut agrees) = self.published.agrees(computed) else {
            return Verdict::Ours;
        };
        let sure = self.interval.filter(|_| computed.is_finite());
        if let (Some((low, high)), Some((least, greatest))) = (sure, self.published.range()) {
            let ends = [low, high].map(|end| self.published.agrees(end) == Some(true));
            let apart = high < least || low > greatest;
            match ends {
                [true, true] => agrees = true,
                _ if apart => agrees = false,
                _ => return Verdict::NotShown,
            }
        }
        match (
            agrees,
            self.input.is_some(),
            self.known_difference.is_some(),
        ) {
            (true, true, _) => Verdict::Given,
            (true, false, _) => Verdict::Agrees,
            (false, _, true) => Verdict::Differs,
            (false, _, false) => Verdict::Fails,
        }
    }

    /// Computed less published, in the row's unit and, where that is a number other than zero, relative to it.
    pub(crate) fn difference(&self) -> Option<(f64, Option<f64>)> {
        let computed = self.computed?;
        let difference = self.published.difference(computed)?;
        let published = computed - difference;
        let is_number = published != 0.0 && !matches!(self.published, Published::Says(..));
        let relative = is_number.then(|| difference / published.abs());
        Some((difference, relative))
    }

    /// Everything there is to say about it.
    pub fn notes(&self) -> String {
        let why = match (self.verdict(), self.interval) {
            (Verdict::Differs, _) => self.known_difference.clone(),
            (Verdict::Given, _) => self.input.clone(),
            (Verdict::NotShown, Some((low, high))) => Some(format!(
                "The 95 % interval, {} to {}, lies partly outside the tolerance.",
                figure(low),
                figure(high)
            )),
            _ => None,
        };
        let parts = why.into_iter().chain([self.remark.clone()]);
        let parts: Vec<String> = parts.filter(|part| !part.is_empty()).collect();
        parts.join(" ")
    }

    /// What the thesis is quoted with, in whatever verdict: its words as the published figure, and those between typographic quotes.
    pub fn quoted(&self) -> Vec<&str> {
        let texts = [
            Some(self.what.as_str()),
            Some(self.remark.as_str()),
            self.known_difference.as_deref(),
            self.input.as_deref(),
        ];
        let mut quoted: Vec<&str> = texts
            .into_iter()
            .flatten()
            .flat_map(between_quotes)
            .collect();
        if let Published::Says(words, ..) = self.published {
            quoted.push(words);
        }
        quoted
    }
}

/// What stands between typographic quotes.
pub fn between_quotes(text: &str) -> impl Iterator<Item = &str> {
    let after = text.split('\u{201c}').skip(1);
    after.map(|rest| rest.split('\u{201d}').next().unwrap_or(rest))
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
}

/// The verdict on a claim: the worst of its published rows. One headline that is not modelled, that differs, that is not shown or that was
/// put in keeps the claim from being met, however many other rows agree.
pub fn overall(rows: &[ClaimRow]) -> Verdict {
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
        Verdict::NotShown,
        Verdict::Given,
        Verdict::Agrees,
    ];
    order.into_iter().find(|&v| has(v)).unwrap_or(Verdict::Ours)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::intervals::Estimate;

    impl ClaimRow {
        fn holds(what: &str, unit: &'static str, published: Published, computed: f64) -> Self {
            ClaimRow {
                published,
                ..ClaimRow::ours(what, unit, computed)
            }
        }

        fn measured(published: Published, measured: &Estimate) -> Self {
            ClaimRow {
                published,
                interval: Some((measured.low, measured.high)),
                ..ClaimRow::ours("x", "", measured.value)
            }
        }

        fn not_modelled(published: Published) -> Self {
            ClaimRow {
                published,
                computed: None,
                remark: "why".into(),
                ..ClaimRow::ours("x", "m", 0.0)
            }
        }

        fn given(mut self, how: &str) -> Self {
            self.input = Some(how.into());
            self
        }

        fn aside(mut self) -> Self {
            self.is_aside = true;
            self
        }
    }

    #[test]
    fn verdicts_follow_from_range_and_expectation() {
        let row = |published, computed| ClaimRow::holds("x", "m", published, computed);
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
        let none = ClaimRow::not_modelled(Exactly("1"));
        assert_eq!(none.verdict(), Verdict::NotModelled);
        assert_eq!(none.difference(), None);
    }

    /// All ways in which an interval can lie to "at least 6" and to "1 to 2".
    #[test]
    fn what_chance_could_decide_otherwise_is_not_shown() {
        let row = |published, low, value, high| {
            let row = ClaimRow::measured(published, &Estimate { value, low, high });
            row.differs("why").verdict()
        };
        use Published::*;
        assert_eq!(row(AtLeast("6"), 6.5, 7.1, 8.5), Verdict::Agrees);
        assert_eq!(row(AtLeast("6"), 5.88, 7.1, 8.46), Verdict::NotShown);
        assert_eq!(row(AtLeast("6"), 4.0, 5.3, 6.3), Verdict::NotShown);
        assert_eq!(row(AtLeast("6"), 4.0, 5.3, 5.9), Verdict::Differs);
        assert_eq!(row(Between("1", "2"), 0.5, 1.5, 2.5), Verdict::NotShown);
        assert_eq!(row(Between("1", "2"), 1.1, 1.5, 1.9), Verdict::Agrees);
        assert_eq!(row(Between("1", "2"), 2.1, 2.5, 2.9), Verdict::Differs);
        assert_eq!(row(AtLeast("6"), 6.5, f64::NAN, 8.5), Verdict::Differs);
        assert_eq!(row(Nothing, 0.0, 1.0, 2.0), Verdict::Ours);
        let measured = Estimate {
            value: 7.1,
            low: 5.88,
            high: 8.46,
        };
        let unsure = ClaimRow::measured(AtLeast("6"), &measured);
        assert!(
            unsure.notes().contains("5.880 to 8.460"),
            "{}",
            unsure.notes()
        );
    }

    #[test]
    fn quotes_are_found_in_whatever_is_said() {
        let row = ClaimRow::holds("x", "", Published::Says("a b", 0.0, 1.0), 0.5)
            .differs("it says “c” and “d e”")
            .remark("“f”, \"not this\"");
        assert_eq!(row.quoted(), ["f", "c", "d e", "a b"]);
    }

    #[test]
    fn figures_are_short() {
        let texts = [0.0, 36864.0, 0.1234567, 1139.4321, 2.5e-7, 12.0].map(figure);
        assert_eq!(texts, ["0", "36864", "0.1235", "1139", "2.500e-7", "12"]);
    }

    #[test]
    fn what_is_published_as_zero_has_no_relative_difference() {
        let row = |published, computed| ClaimRow::holds("x", "m", published, computed).difference();
        assert_eq!(row(Published::Within("0", 0.02), 0.01), Some((0.01, None)));
        assert_eq!(row(Published::Exactly("2"), 1.0), Some((-1.0, Some(-0.5))));
    }

    #[test]
    fn a_claim_is_met_only_if_all_its_headlines_are() {
        let agrees = ClaimRow::holds("a", "", Published::Exactly("1"), 1.0);
        let differs = ClaimRow::holds("b", "", Published::Exactly("1"), 2.0).differs("why");
        let given = agrees.clone().given("how");
        let ours = ClaimRow::ours("c", "", 1.0);
        let unsure = ClaimRow::measured(
            Published::AtLeast("1"),
            &Estimate {
                value: 2.0,
                low: 0.0,
                high: 4.0,
            },
        );
        let gap = ClaimRow::not_modelled(Published::Exactly("1"));
        let fails = ClaimRow::holds("e", "", Published::Exactly("1"), 2.0);
        for (rows, verdict) in [
            (vec![&agrees, &ours], Verdict::Agrees),
            (vec![&agrees, &given], Verdict::Given),
            (vec![&agrees, &given.clone().aside()], Verdict::Agrees),
            (vec![&agrees, &given, &unsure], Verdict::NotShown),
            (vec![&agrees, &given, &differs, &unsure], Verdict::Differs),
            (vec![&agrees, &differs, &gap], Verdict::NotModelled),
            (vec![&agrees, &gap, &fails.aside()], Verdict::Fails),
            (vec![&ours], Verdict::Ours),
        ] {
            let rows: Vec<ClaimRow> = rows.into_iter().cloned().collect();
            assert_eq!(overall(&rows), verdict, "{rows:?}");
        }
    }
}
