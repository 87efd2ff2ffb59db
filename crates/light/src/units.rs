//! Units that cannot be mixed up: integer-femtosecond [`Time`], exact [`Frequency`], constants of nature (SI 2019, exact by
//! definition).
//!
//! Everything the chip does is timed in whole femtoseconds. Lengths and energies are `f64` whose
//! names end in their unit (`_m`, `_j`, `_nm`).

pub use femtogate::units::{Every, Frequency, FrequencyError, Time};

/// Speed of light in vacuum, m/s.
pub const SPEED_OF_LIGHT_M_PER_S: f64 = 299_792_458.0;

/// Planck's constant, J·s.
pub const PLANCK_J_S: f64 = 6.626_070_15e-34;

/// Boltzmann's constant, eV/K.
pub const BOLTZMANN_EV_PER_K: f64 = 8.617_333_262e-5;

/// 0 °C, K.
pub const ZERO_CELSIUS_K: f64 = 273.15;

/// Ranges as times of flight.
pub trait TimeOfFlight: Copy {
    /// Round-trip time of flight to a target `range_m` metres away.
    fn of_flight(range_m: f64) -> Self;

    /// Distance in metres of a target whose echo needs this round-trip time.
    fn as_range_m(self) -> f64;
}

impl TimeOfFlight for Time {
    fn of_flight(range_m: f64) -> Self {
        Time::from_s(2.0 * range_m / SPEED_OF_LIGHT_M_PER_S)
    }

    fn as_range_m(self) -> f64 {
        self.as_s() * SPEED_OF_LIGHT_M_PER_S / 2.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_travels_to_a_target_and_back() {
        let t = Time::of_flight(149.896_229);
        assert_eq!(t, Time::from_ns(1_000));
        assert!((t.as_range_m() - 149.896_229).abs() < 1e-9);
    }
}
