//! What the numbers of a Liberty file are in. A unit is a number, a prefix and a letter: `1ns`, `100ps`, `"1W"`.
//!
//! A unit that is left out is the Liberty manual's default where it has one (1 ns, 1 V), and else 1 nW for leakage, as other readers
//! take it. A word that is no unit is refused.

use super::error::LibertyError;
use super::group::Group;
use super::table_fault::{LibertyTableFault, LibertyUnit};

/// What a file's numbers are in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Units {
    pub time_fs: f64,
    pub load_ff: f64,
    /// Of internal energy: a load's, at the unit of voltage squared.
    pub energy_fj: f64,
    pub leakage_w: f64,
}

impl Units {
    /// Reads the units of a library.
    ///
    /// # Errors
    /// A unit that is none, and a library without a unit of capacitance.
    pub(super) fn read(library: &Group<'_>) -> Result<Self, LibertyError> {
        let fault = |fault| LibertyError::new(library.line, fault);
        let amount_of = |unit: LibertyUnit, power: i32, default: f64| {
            let Some(text) = library.value(unit.attribute()) else {
                return Ok(default);
            };
            amount(text, unit.letter(), power).ok_or_else(|| {
                let text = text.to_owned();
                fault(LibertyTableFault::UnknownUnit { unit, text })
            })
        };
        let load_ff = match library.values("capacitive_load_unit") {
            Some([number, unit]) => amount(&format!("{number}{unit}"), 'f', 15),
            _ => None,
        };
        let load_ff = load_ff.ok_or_else(|| fault(LibertyTableFault::NoLoadUnit))?;
        let volt = amount_of(LibertyUnit::Voltage, 0, 1.0)?;
        Ok(Units {
            time_fs: amount_of(LibertyUnit::Time, 15, 1e6)?,
            load_ff,
            energy_fj: load_ff * volt * volt,
            leakage_w: amount_of(LibertyUnit::LeakagePower, 0, 1e-9)?,
        })
    }

    /// The unit of time as a word, and whether it is one of a single step (`ns`, and not `10ps`), which is what SDC can name.
    pub(super) fn time_word(self) -> (String, bool) {
        let steps = [
            (1e15, "s"),
            (1e12, "ms"),
            (1e9, "us"),
            (1e6, "ns"),
            (1e3, "ps"),
            (1.0, "fs"),
        ];
        let (fs, word) = steps
            .into_iter()
            .find(|(fs, _)| self.time_fs >= fs * (1.0 - 1e-9))
            .unwrap_or((1.0, "fs"));
        let number = self.time_fs / fs;
        if (number - 1.0).abs() < 1e-9 {
            (word.to_owned(), true)
        } else {
            (format!("{number}{word}"), false)
        }
    }
}

/// The amount that a unit stands for, times a power of ten, so that whole ones stay exact: `100ps` of seconds with 15 is 1e5.
fn amount(text: &str, letter: char, power: i32) -> Option<f64> {
    let text = text.trim();
    let words = text.find(|c: char| c.is_ascii_alphabetic())?;
    // An `e` of the number's exponent is followed by its digits.
    let words = match text[words..].strip_prefix(['e', 'E']) {
        Some(rest) if rest.starts_with(|c: char| c.is_ascii_digit() || "+-".contains(c)) => {
            words + 1 + rest.find(|c: char| c.is_ascii_alphabetic())?
        }
        _ => words,
    };
    let (number, unit) = text.split_at(words);
    let number: f64 = number.trim().parse().ok()?;
    let mut unit = unit.chars();
    let last = unit.next_back()?;
    let prefix = match unit.as_str() {
        "" => 0,
        "k" => 3,
        "m" => -3,
        "u" => -6,
        "n" => -9,
        "p" => -12,
        "f" => -15,
        "a" => -18,
        _ => return None,
    };
    let scale: f64 = format!("1e{}", prefix + power).parse().ok()?;
    let amount = number * scale;
    (last.eq_ignore_ascii_case(&letter) && amount.is_finite() && amount > 0.0).then_some(amount)
}

#[cfg(test)]
mod tests {
    use super::super::group::read;
    use super::*;

    fn units(text: &str) -> Result<Units, LibertyError> {
        Units::read(&read(&format!("\n library (l) {{ {text} }}")).unwrap())
    }

    #[test]
    fn units_are_known_or_refused_with_the_librarys_line() {
        let read = |text: &str| units(&format!("capacitive_load_unit (1, pf); {text}")).unwrap();
        for (word, fs, name) in [
            ("1ns", 1e6, "ns"),
            ("1 ps", 1e3, "ps"),
            ("1fs", 1.0, "fs"),
            ("1us", 1e9, "us"),
            ("100ps", 1e5, "100ps"),
            ("10ps", 1e4, "10ps"),
        ] {
            let units = read(&format!("time_unit : \"{word}\";"));
            assert!((units.time_fs / fs - 1.0).abs() < 1e-12, "{word}");
            assert_eq!(units.time_word(), (name.to_owned(), name.len() == 2));
        }
        for (word, watts) in [("1W", 1.0), ("1mW", 1e-3), ("100uW", 1e-4), ("10fW", 1e-14)] {
            let units = read(&format!("leakage_power_unit : {word};"));
            assert!((units.leakage_w / watts - 1.0).abs() < 1e-12, "{word}");
        }
        assert_eq!(read("voltage_unit : \"100mV\";").energy_fj, 1e3 * 0.1 * 0.1);
        let defaults = read("");
        assert_eq!((defaults.time_fs, defaults.leakage_w), (1e6, 1e-9));
        for text in [
            "capacitive_load_unit (1, pf); time_unit : \"1 fortnight\";",
            "capacitive_load_unit (1, pf); time_unit : \"ns\";",
            "capacitive_load_unit (1, pf); time_unit : \"0ns\";",
            "capacitive_load_unit (1, pf); leakage_power_unit : \"1V\";",
            "capacitive_load_unit (1, pf); leakage_power_unit : \"1 nano\";",
            "capacitive_load_unit (1, pf); voltage_unit : \"-1V\";",
            "capacitive_load_unit (0, pf);",
            "capacitive_load_unit (1, oz);",
            "capacitive_load_unit (1);",
            "",
        ] {
            let fault = units(text).unwrap_err();
            assert_eq!(fault.line, 2, "{text}");
        }
    }
}
