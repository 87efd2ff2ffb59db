//! Numbers with units as text: `"384 MHz"`, `"8 ns"`, `"20 %"`.

use crate::files::nearest;

/// What units measure, in words for complaints: symbols, each with its power of ten of the base unit.
const UNITS: [(&str, &[(&str, i32)]); 21] = [
    (
        "a time",
        &[
            ("s", 0),
            ("ms", -3),
            ("us", -6),
            ("µs", -6),
            ("ns", -9),
            ("ps", -12),
            ("fs", -15),
        ],
    ),
    (
        "a frequency",
        &[("Hz", 0), ("kHz", 3), ("MHz", 6), ("GHz", 9)],
    ),
    (
        "a length",
        &[
            ("km", 3),
            ("m", 0),
            ("cm", -2),
            ("mm", -3),
            ("um", -6),
            ("µm", -6),
            ("nm", -9),
        ],
    ),
    ("a velocity", &[("m/s", 0), ("km/s", 3)]),
    ("a share per length", &[("1/m", 0), ("1/km", -3)]),
    ("a share per length and solid angle", &[("1/m/sr", 0)]),
    ("an amount of rain", &[("mm/h", 0)]),
    ("an angular velocity", &[("deg/s", 0)]),
    ("an angle", &[("deg", 0), ("°", 0)]),
    (
        "an energy",
        &[
            ("J", 0),
            ("mJ", -3),
            ("uJ", -6),
            ("µJ", -6),
            ("nJ", -9),
            ("pJ", -12),
        ],
    ),
    ("the energy of a carrier", &[("eV", 0), ("meV", -3)]),
    ("a voltage", &[("V", 0), ("mV", -3)]),
    ("a share per kelvin", &[("1/K", 0), ("%/K", -2)]),
    ("a voltage per kelvin", &[("mV/K", -3)]),
    ("a length per kelvin", &[("nm/K", -9), ("pm/K", -12)]),
    ("a temperature", &[("C", 0), ("degC", 0), ("°C", 0)]),
    ("a capacitance", &[("pF", -12), ("fF", -15)]),
    (
        "an illuminance",
        &[("lx", 0), ("lux", 0), ("klx", 3), ("klux", 3)],
    ),
    (
        "an irradiance",
        &[
            ("W/m2", 0),
            ("W/m²", 0),
            ("W/m^2", 0),
            ("mW/m2", -3),
            ("mW/m²", -3),
            ("mW/m^2", -3),
            ("kW/m2", 3),
            ("kW/m²", 3),
            ("kW/m^2", 3),
        ],
    ),
    ("a number of pixels", &[("px", 0)]),
    ("a plain number", &[("%", -2), ("", 0)]),
];

/// What a unit measures, and its power.
fn unit(symbol: &str) -> Option<(&'static str, i32)> {
    // The Greek letter is written for the micro sign, too.
    let symbol = symbol.replace('μ', "µ");
    UNITS.iter().find_map(|(dimension, units)| {
        let (_, power) = units.iter().find(|(name, _)| *name == symbol)?;
        Some((*dimension, *power))
    })
}

/// The number in `text` in the unit `wanted`, exact as the decimal fraction that it is. A number without a unit is in the
/// wanted one.
///
/// # Errors
/// What is wrong with it, and the cure: to follow the text.
pub(super) fn in_unit(text: &str, wanted: &str) -> Result<f64, String> {
    let (dimension, wanted_power) = unit(wanted).expect("keys have units of the table");
    let cure = match wanted {
        "" => "give a plain number".to_owned(),
        _ => format!("give {dimension} such as \"1 {wanted}\", or a plain number of {wanted}"),
    };
    let (number, symbol) = split(text);
    if number.is_empty() {
        return Err(format!("is not a number; {cure}"));
    }
    let power = match symbol {
        "" => wanted_power,
        _ => match unit(symbol) {
            Some((found, power)) if found == dimension => power,
            Some((found, _)) => return Err(format!("is {found}; {cure}")),
            None => {
                let known = UNITS.iter().find(|(known, _)| *known == dimension);
                let names = known
                    .into_iter()
                    .flat_map(|(_, units)| units.iter().map(|(name, _)| *name));
                let meant = names.clone().find(|name| name.eq_ignore_ascii_case(symbol));
                return Err(match meant.or_else(|| nearest(symbol, names)) {
                    Some(name) => format!("has an unknown unit; did you mean {name}?"),
                    None => format!("has an unknown unit; {cure}"),
                });
            }
        },
    };
    let not_a_number = || format!("is not a number with a unit; {cure}");
    let (digits, exponent) = match number.split_once(['e', 'E']) {
        None => (number, 0),
        Some((digits, exponent)) => {
            let exponent: i16 = exponent.parse().map_err(|_| not_a_number())?;
            (digits, i32::from(exponent))
        }
    };
    let exponent = exponent + power - wanted_power;
    format!("{digits}e{exponent}")
        .parse()
        .map_err(|_| not_a_number())
}

/// A number that may have been meant in another unit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LikelyQuantity {
    /// The number as it was given, with that unit.
    pub(super) text: String,
    /// The same in the wanted unit.
    pub(super) number: f64,
}

/// The quantity for which `is_right` holds if `number` is in another unit than the wanted one. Of several such units it is one a thousand times
/// larger or smaller, before others. `None` if there is no such unit.
pub(super) fn likely_quantity(
    number: f64,
    wanted: &str,
    is_right: impl Fn(f64) -> bool,
) -> Option<LikelyQuantity> {
    if !number.is_finite() || number == 0.0 {
        return None;
    }
    let (dimension, wanted_power) = unit(wanted)?;
    let (_, units) = UNITS.iter().find(|(name, _)| *name == dimension)?;
    let mut others: Vec<_> = units.iter().filter(|(_, p)| *p != wanted_power).collect();
    others.sort_by_key(|(_, power)| match (power - wanted_power).abs() {
        3 => 0,
        apart => apart,
    });
    let digits = if (1e-3..1e7).contains(&number.abs()) {
        format!("{number}")
    } else {
        format!("{number:e}")
    };
    let quantity = |(symbol, _): &(&str, i32)| {
        let text = format!("{digits} {symbol}");
        let number = in_unit(&text, wanted).ok()?;
        is_right(number).then_some(LikelyQuantity { text, number })
    };
    others.into_iter().find_map(quantity)
}

/// The number in front and what follows it.
fn split(text: &str) -> (&str, &str) {
    let text = text.trim();
    let bytes = text.as_bytes();
    let is_exponent = |at: usize| {
        let mut after = bytes[at + 1..].iter();
        matches!(bytes[at], b'e' | b'E')
            && match after.next() {
                Some(b'+' | b'-') => after.next().is_some_and(u8::is_ascii_digit),
                Some(digit) => digit.is_ascii_digit(),
                None => false,
            }
    };
    let is_number =
        |at: usize| bytes[at].is_ascii_digit() || b"+-.".contains(&bytes[at]) || is_exponent(at);
    let end = (0..bytes.len())
        .find(|&at| !is_number(at))
        .unwrap_or(bytes.len());
    (&text[..end], text[end..].trim())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn units_are_converted_exactly() {
        for (text, wanted, number) in [
            ("384 MHz", "Hz", 384e6),
            ("384MHz", "Hz", 384e6),
            ("0.384e3 MHz", "Hz", 384e6),
            ("8 ns", "ns", 8.0),
            ("8000ps", "ns", 8.0),
            ("8e-9 s", "ns", 8.0),
            ("8", "ns", 8.0),
            ("0.3 µm", "nm", 300.0),
            ("0.3 μm", "nm", 300.0),
            ("-10 cm", "m", -0.1),
            ("50000 lux", "klux", 50.0),
            ("18.5 %", "", 0.185),
            ("0.185", "", 0.185),
            ("16°", "deg", 16.0),
            ("3.047 W/m²", "W/m2", 3.047),
            ("20 uJ", "uJ", 20.0),
        ] {
            assert_eq!(in_unit(text, wanted), Ok(number), "{text}");
        }
    }

    #[test]
    fn another_dimension_is_named() {
        let says = |text, wanted| in_unit(text, wanted).unwrap_err();
        assert_eq!(
            says("8 ns", "Hz"),
            "is a time; give a frequency such as \"1 Hz\", or a plain number of Hz"
        );
        assert!(says("8 m", "").starts_with("is a length; give a plain number"));
        assert!(says("8 parsec", "m").starts_with("has an unknown unit; give a length"));
        assert_eq!(
            says("8 Mhz", "Hz"),
            "has an unknown unit; did you mean MHz?"
        );
        for text in ["", "ns", "1.2.3 ns", "--1 ns", "1e99999 ns", "eight ns"] {
            assert!(in_unit(text, "ns").is_err(), "{text}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_a_number_or_a_complaint(text in "\\PC{0,20}") {
            let _ = in_unit(&text, "ns");
        }

        /// Shifting the point by three is what another prefix is.
        #[test]
        fn prefixes_are_powers_of_ten(thousandths in -1_000_000_000i64..1_000_000_000) {
            let text = format!("{thousandths} ps");
            let expected: f64 = format!("{thousandths}e-3").parse().unwrap();
            prop_assert_eq!(in_unit(&text, "ns"), Ok(expected));
        }
    }
}
