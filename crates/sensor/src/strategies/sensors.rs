//! Sensors: every key of a sensor file that the chip allows, in values that it allows.
//!
//! Two strategies. [`sensors_of_every_engine`] draws what engines run alike: clocks, P-counters, SPADs, events, bins, corner, cells.
//! [`sensors`] draws the rest as well: front ends and TDCs that some engines leave to the gates, skew, readout, temperature, SPAD noise.
//! Where keys limit each other, the later one in the drawing follows the earlier one; what is left is rejected by
//! [`SensorConfig::check`]. Arrays have one macropixel; `scenarios` makes them larger.
//!
//! Kept from drawing: netlists of one's own, which are files of their user, and `liberty_cells`, the names in such a file.

use std::path::PathBuf;

use proptest::bool::weighted;
use proptest::prelude::*;
use proptest::sample::select;

use super::exposures::clocks;
use super::silicon::{corners, temperatures_c};
use crate::chip::{
    AfterBorrow, EventType, FrontEnd, Mode, NeverMet, Overflow, PCounter, SensorConfig, Tap, Tdc,
};

/// Sensors that engines count alike: random clocks from 100 to 500 MHz, P-counters, SPADs, events, bins and corners. One in six is made of
/// a library of these files, if there are any.
///
/// Shrinks towards the ripple counter, few bins and bits, one SPAD event of any SPAD, a slow CLK without a phase, and built-in cells.
pub fn sensors_of_every_engine(
    libraries: &[PathBuf],
) -> impl Strategy<Value = SensorConfig> + Clone + use<> {
    // The built-in cells have no file.
    let mut files = vec![PathBuf::new(); 5 * libraries.len().max(1)];
    files.extend_from_slice(libraries);
    let counters = (
        select(PCounter::ALL.to_vec()),
        select(Tap::ALL.to_vec()),
        select(AfterBorrow::ALL.to_vec()),
        // More often every CLK period than in steps.
        select(vec![1, 1, 1, 2, 4, 8]),
        3usize..10,
    );
    let counters = counters.prop_map(|(p_counter, tap, after_borrow, steps, counter_bits)| {
        let row = p_counter.row();
        SensorConfig {
            p_counter,
            tap: if row.no_msb.is_some() {
                Tap::Borrow
            } else {
                tap
            },
            // A counter without memory must come round, and has no reset for a divider.
            after_borrow: if row.has_memory {
                after_borrow
            } else {
                AfterBorrow::Wrap
            },
            step_periods: if row.has_memory { steps } else { 1 },
            counter_bits,
            rows: 1,
            cols: 1,
            ..SensorConfig::default()
        }
    });
    // Every other macropixel is the QuantIC4x4's.
    const GRIDS: [(usize, usize); 10] = [
        (4, 4),
        (1, 1),
        (4, 4),
        (2, 2),
        (4, 4),
        (8, 8),
        (4, 4),
        (2, 4),
        (4, 4),
        (8, 1),
    ];
    let pixels = (
        select(GRIDS.to_vec()),
        select(vec![EventType::Greater, EventType::Equal, EventType::Less]),
        0u8..3,
        3_000u32..12_000,
        2usize..17,
        2usize..15,
    );
    let operated = (
        clocks(100e6..500e6),
        weighted(0.2),
        corners(),
        select(files),
    );
    (counters, pixels, operated).prop_map(|(mut config, pixels, operated)| {
        let ((rows, cols), event_type, threshold, dead_time_ps, bins, bin_bits) = pixels;
        (config.spad_rows, config.spad_cols) = (rows, cols);
        (config.event_type, config.threshold) = (event_type, threshold);
        config.dead_time_ns = f64::from(dead_time_ps) * 1e-3;
        (config.bins, config.bin_bits) = (bins, bin_bits);
        let ((clk_hz, stop_phase_ps), is_conventional, corner, file) = operated;
        (config.clk_hz, config.stop_phase_ps) = (clk_hz, stop_phase_ps);
        if is_conventional {
            config.mode = Mode::Conventional;
        }
        config.corner = corner;
        config.liberty_slow = file.clone();
        config.liberty_fast = file.clone();
        config.liberty = file;
        with_possible_threshold(config)
    })
}

/// The same with the nearest threshold that a number of its lines meets.
fn with_possible_threshold(mut config: SensorConfig) -> SensorConfig {
    let possible = NeverMet::possible(config.event_type, config.lines());
    let (least, most) = (*possible.start() as u8, *possible.end() as u8);
    config.threshold = config.threshold.clamp(least, most);
    config
}

/// Sensors with any key that the chip allows, those of [`sensors_of_every_engine`] among them.
///
/// Shrinks towards these, and their keys towards those of the QuantIC4x4.
pub fn sensors(libraries: &[PathBuf]) -> impl Strategy<Value = SensorConfig> + Clone + use<> {
    let front_end = (
        select(FrontEnd::ALL.to_vec()),
        0usize..4,
        select(Tdc::ALL.to_vec()),
        prop_oneof![3 => Just(0), 1 => 1usize..16],
        0u32..=200,
        weighted(0.3),
    );
    let lines = (550u32..=1_100, 0u32..=250, 0u32..100);
    let spads = (
        prop_oneof![2 => Just(0u32), 1 => 0u32..=200],
        0u32..100,
        weighted(0.2),
        0u32..=100,
        0u32..=20,
        0u32..=500,
        0u32..=50,
    );
    let surroundings = (
        50u32..=400,
        50u32..=400,
        weighted(0.2),
        1usize..=8,
        proptest::option::weighted(0.3, temperatures_c()),
        0u32..=50,
        0u32..=5,
    );
    let all_engines = sensors_of_every_engine(libraries);
    let keys = (all_engines, front_end, lines, spads, surroundings);
    let sensors = keys.prop_map(|(mut config, front_end, lines, spads, surroundings)| {
        let (front_end, coincident, tdc, reset_stages, clk_skew_ps, wraps) = front_end;
        config.tdc = tdc;
        config.front_end = match tdc {
            Tdc::DelayLine => FrontEnd::Summation,
            Tdc::Clocked | Tdc::Counter => front_end,
        };
        if tdc != Tdc::Clocked {
            (config.event_type, config.threshold) = (EventType::Greater, 0);
        }
        if tdc == Tdc::Counter {
            config.mode = Mode::Guided;
        }
        config.coincident_spads = 1 + coincident % config.spads();
        config.reset_stages = reset_stages;
        config.clk_skew_ps = clk_skew_ps.into();
        if wraps {
            config.overflow = Overflow::Wrap;
        }
        let (control_mv, sigma_per_mille, seed) = lines;
        config.delay_control_v = f64::from(control_mv) * 1e-3;
        config.delay_sigma = f64::from(sigma_per_mille) * 1e-3;
        config.delay_seed = seed;
        let (spread_per_mille, seed, paralysable, afterpulses, time_ns, activation, crosstalk) =
            spads;
        config.dead_time_spread = f64::from(spread_per_mille) * 1e-3;
        config.dead_time_seed = seed;
        config.paralysable = paralysable;
        config.afterpulse_probability = f64::from(afterpulses) * 1e-3;
        config.afterpulse_time_ns = time_ns.into();
        config.afterpulse_activation_ev = f64::from(activation) * 1e-3;
        config.crosstalk_probability = f64::from(crosstalk) * 1e-3;
        let (load_mhz, read_mhz, reset_to_load, readout_pins, temperature_c, slew_ps, wire_ff) =
            surroundings;
        config.load_clk_hz = f64::from(load_mhz) * 1e6;
        config.read_clk_hz = f64::from(read_mhz) * 1e6;
        config.reset_to_load = reset_to_load;
        config.readout_pins = readout_pins;
        if config.liberty.as_os_str().is_empty() {
            config.temperature_c = temperature_c;
        } else {
            // A library is characterised at its own temperature.
            config.input_slew_ps = slew_ps.into();
            config.wire_ff = wire_ff.into();
        }
        with_possible_threshold(config)
    });
    let may_be = |config: &SensorConfig| config.check().is_ok();
    sensors.prop_filter("a sensor that the chip refuses", may_be)
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};
    use std::path::Path;

    use super::*;
    use crate::settings::Settings;
    use crate::strategies::drawn;

    fn library() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../vectors/liberty/example.lib")
    }

    #[test]
    fn sensors_of_every_engine_are_valid_by_construction() {
        for seed in 0..200 {
            let config = drawn(seed, &sensors_of_every_engine(&[library()]));
            assert_eq!(config.check(), Ok(()), "seed {seed}");
        }
    }

    #[test]
    fn every_key_is_drawn_in_several_values() {
        let mut values: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for seed in 0..200 {
            let config = drawn(seed, &sensors(&[library()]));
            assert_eq!(config.check(), Ok(()), "seed {seed}");
            for (key, value) in toml::Table::try_from(&config).unwrap() {
                values.entry(key).or_default().insert(value.to_string());
            }
        }
        for key in SensorConfig::KEYS {
            let is_drawn = values.get(key.name).is_some_and(|values| values.len() > 1)
                // Left out of the table where it is not given.
                || key.name == "temperature_c" && values.contains_key(key.name);
            let is_of_scenarios = ["rows", "cols"].contains(&key.name);
            let is_file_of_user = key.name.ends_with("_block") || key.name == "liberty_cells";
            assert_eq!(
                is_drawn,
                !is_of_scenarios && !is_file_of_user,
                "{}",
                key.name
            );
        }
    }
}
