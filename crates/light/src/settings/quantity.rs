//! Numbers with units as text: `"384 MHz"`, `"8 ns"`, `"20 %"`.

/// What a unit measures, in words for complaints, with an example.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Dimension {
    Time,
    Frequency,
    Length,
    Speed,
    PerLength,
    PerLengthAndAngle,
    Rain,
    AngularSpeed,
    Angle,
    Energy,
    CarrierEnergy,
    Voltage,
    VoltagePerKelvin,
    LengthPerKelvin,
    Temperature,
    Capacitance,
    Illuminance,
    Irradiance,
    Pixels,
    Share,
}

impl Dimension {
    fn words(self) -> &'static str {
        match self {
            Dimension::Time => "a time",
            Dimension::Frequency => "a frequency",
            Dimension::Length => "a length",
            Dimension::Speed => "a velocity",
            Dimension::PerLength => "a share per length",
            Dimension::PerLengthAndAngle => "a share per length and solid angle",
            Dimension::Rain => "an amount of rain",
            Dimension::AngularSpeed => "an angular velocity",
            Dimension::Angle => "an angle",
            Dimension::Energy => "an energy",
            Dimension::CarrierEnergy => "the energy of a carrier",
            Dimension::Voltage => "a voltage",
            Dimension::VoltagePerKelvin => "a voltage per kelvin",
            Dimension::LengthPerKelvin => "a length per kelvin",
            Dimension::Temperature => "a temperature",
            Dimension::Capacitance => "a capacitance",
            Dimension::Illuminance => "an illuminance",
            Dimension::Irradiance => "an irradiance",
            Dimension::Pixels => "a number of pixels",
            Dimension::Share => "a plain number",
        }
    }
}

/// Symbol, what it measures, and its power of ten of the dimension's base unit.
const UNITS: [(&str, Dimension, i32); 61] = [
    ("s", Dimension::Time, 0),
    ("ms", Dimension::Time, -3),
    ("us", Dimension::Time, -6),
    ("µs", Dimension::Time, -6),
    ("ns", Dimension::Time, -9),
    ("ps", Dimension::Time, -12),
    ("fs", Dimension::Time, -15),
    ("Hz", Dimension::Frequency, 0),
    ("kHz", Dimension::Frequency, 3),
    ("MHz", Dimension::Frequency, 6),
    ("GHz", Dimension::Frequency, 9),
    ("km", Dimension::Length, 3),
    ("m", Dimension::Length, 0),
    ("cm", Dimension::Length, -2),
    ("mm", Dimension::Length, -3),
    ("um", Dimension::Length, -6),
    ("µm", Dimension::Length, -6),
    ("nm", Dimension::Length, -9),
    ("m/s", Dimension::Speed, 0),
    ("km/s", Dimension::Speed, 3),
    ("1/m", Dimension::PerLength, 0),
    ("1/km", Dimension::PerLength, -3),
    ("1/m/sr", Dimension::PerLengthAndAngle, 0),
    ("mm/h", Dimension::Rain, 0),
    ("deg/s", Dimension::AngularSpeed, 0),
    ("deg", Dimension::Angle, 0),
    ("°", Dimension::Angle, 0),
    ("J", Dimension::Energy, 0),
    ("mJ", Dimension::Energy, -3),
    ("uJ", Dimension::Energy, -6),
    ("µJ", Dimension::Energy, -6),
    ("nJ", Dimension::Energy, -9),
    ("pJ", Dimension::Energy, -12),
    ("eV", Dimension::CarrierEnergy, 0),
    ("meV", Dimension::CarrierEnergy, -3),
    ("V", Dimension::Voltage, 0),
    ("mV", Dimension::Voltage, -3),
    ("mV/K", Dimension::VoltagePerKelvin, -3),
    ("nm/K", Dimension::LengthPerKelvin, -9),
    ("pm/K", Dimension::LengthPerKelvin, -12),
    ("C", Dimension::Temperature, 0),
    ("degC", Dimension::Temperature, 0),
    ("°C", Dimension::Temperature, 0),
    ("pF", Dimension::Capacitance, -12),
    ("fF", Dimension::Capacitance, -15),
    ("lx", Dimension::Illuminance, 0),
    ("lux", Dimension::Illuminance, 0),
    ("klx", Dimension::Illuminance, 3),
    ("klux", Dimension::Illuminance, 3),
    ("W/m2", Dimension::Irradiance, 0),
    ("W/m²", Dimension::Irradiance, 0),
    ("W/m^2", Dimension::Irradiance, 0),
    ("mW/m2", Dimension::Irradiance, -3),
    ("mW/m²", Dimension::Irradiance, -3),
    ("mW/m^2", Dimension::Irradiance, -3),
    ("kW/m2", Dimension::Irradiance, 3),
    ("kW/m²", Dimension::Irradiance, 3),
    ("kW/m^2", Dimension::Irradiance, 3),
    ("px", Dimension::Pixels, 0),
    ("%", Dimension::Share, -2),
    ("", Dimension::Share, 0),
];

fn unit(symbol: &str) -> Option<(Dimension, i32)> {
    // The Greek letter is written for the micro sign, too.
    let symbol = symbol.replace('μ', "µ");
    let found = UNITS.iter().find(|(name, _, _)| *name == symbol);
    found.map(|&(_, dimension, power)| (dimension, power))
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
        _ => format!(
            "give {} such as \"1 {wanted}\", or a plain number of {wanted}",
            dimension.words()
        ),
    };
    let (number, symbol) = split(text);
    let power = match symbol {
        "" => wanted_power,
        _ => match unit(symbol) {
            Some((found, power)) if found == dimension => power,
            Some((found, _)) => return Err(format!("is {}; {cure}", found.words())),
            None => return Err(format!("has an unknown unit; {cure}")),
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
        assert!(says("8 parsec", "m").starts_with("has an unknown unit"));
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
