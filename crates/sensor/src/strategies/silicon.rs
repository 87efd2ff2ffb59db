//! What a chip is made of, and where it is operated: process, voltage, temperature, mismatch.
//!
//! Delays follow [`Conditions::delay_factor`]; mismatch is a Gaussian of each cell's delays. Both shrink towards typical silicon.

use std::ops::RangeInclusive;

use proptest::prelude::*;
use proptest::sample::select;

use crate::chip::{SensorConfig, Silicon};
use crate::netlist::{Conditions, Corner, Mismatch};

/// Where the built-in cells are characterised: 1.1 V, 50 °C.
const USUAL: Conditions = Conditions {
    process: Corner::Typ,
    voltage_v: 1.1,
    temperature_c: 50.0,
};

/// Numbers of a range, as whole steps away from a middle towards which they shrink.
fn near_middle(
    middle: f64,
    steps: RangeInclusive<i32>,
    step: f64,
) -> impl Strategy<Value = f64> + Clone {
    steps.prop_map(move |steps| middle + f64::from(steps) * step)
}

/// The silicon's corner. Shrinks towards the typical one.
pub(super) fn corners() -> impl Strategy<Value = Corner> + Clone {
    select(vec![Corner::Typ, Corner::Slow, Corner::Fast])
}

/// Junction temperatures from −40 to 125 °C. They shrink towards 50 °C.
pub(super) fn temperatures_c() -> impl Strategy<Value = f64> + Clone {
    near_middle(USUAL.temperature_c, -90..=75, 1.0)
}

/// Any process, 0.95 to 1.3 V, −40 to 125 °C: delays are known for all of them.
///
/// Shrinks towards typical silicon at 1.1 V and 50 °C.
pub fn conditions() -> impl Strategy<Value = Conditions> + Clone {
    let voltages_v = near_middle(USUAL.voltage_v, -15..=20, 0.01);
    (corners(), voltages_v, temperatures_c()).prop_map(|(process, voltage_v, temperature_c)| {
        Conditions {
            process,
            voltage_v,
            temperature_c,
        }
    })
}

/// Mismatch of cells of up to 20 % of an inverter's delay. Shrinks towards none.
pub fn mismatches() -> impl Strategy<Value = Mismatch> + Clone {
    (0u32..=200, any::<u64>()).prop_map(|(per_mille, seed)| Mismatch {
        sigma: f64::from(per_mille) * 1e-3,
        seed,
    })
}

/// What a sensor may be made of: its own library, in seven of ten cases in any conditions, and in three of ten with mismatch.
///
/// The sensor must have passed [`SensorConfig::check`]. Shrinks towards its own silicon.
pub fn silicon(config: &SensorConfig) -> impl Strategy<Value = Silicon> + Clone + use<> {
    let own = Silicon::new(config);
    let conditions = proptest::option::weighted(0.7, conditions());
    let mismatch = proptest::option::weighted(0.3, mismatches());
    (conditions, mismatch).prop_map(move |(conditions, mismatch)| {
        let factor = conditions.map(|conditions| conditions.delay_factor());
        Silicon {
            factor: factor.map_or(1.0, |factor| factor.expect("delays are known there")),
            mismatch,
            ..own
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategies::drawn;

    #[test]
    fn silicon_is_slow_and_fast_and_shrinks_to_the_usual() {
        assert_eq!(USUAL, Conditions::default());
        let config = SensorConfig::default();
        let drawn = (0..300).map(|seed| drawn(seed, &silicon(&config)));
        let drawn: Vec<Silicon> = drawn.collect();
        let factors = drawn.iter().map(|silicon| silicon.factor);
        let most = factors.clone().fold(0.0, f64::max);
        let least = factors.fold(f64::MAX, f64::min);
        assert!(least < 0.8 && most > 1.3, "{least} to {most}");
        let varied = drawn.iter().filter(|silicon| silicon.mismatch.is_some());
        assert!((50..150).contains(&varied.count()));
    }
}
