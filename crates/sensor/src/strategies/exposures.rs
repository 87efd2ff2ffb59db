//! Clocks, phases, lengths of laser cycles, and start values.
//!
//! ```text
//!   STOP  ──┐0                                              stop_periods · T, then the next laser cycle
//!   CLK    ─┴─┐  ┌──┐  ┌──       falls the phase before STOP rises: −T/2 to T/2
//!   start       └─ counted down from here: 0 to the last that opens a window, and one more
//! ```

use std::ops::Range;

use proptest::prelude::*;

use crate::chip::{Exposure, SensorConfig, Tap};

/// Frequency of CLK, Hz, and the rise of STOP after its fall, ps: anywhere within half a CLK period, at times as far as possible.
///
/// Shrinks towards the lowest frequency and no phase.
///
/// # Panics
/// If the range has no whole number of kHz.
pub fn clocks(clk_hz: Range<f64>) -> impl Strategy<Value = (f64, f64)> + Clone {
    let clk_khz = (clk_hz.start / 1e3).ceil() as u64..(clk_hz.end / 1e3).ceil() as u64;
    let per_mille = prop_oneof![8 => -450i32..=450, 1 => Just(499), 1 => Just(-499)];
    (clk_khz, per_mille).prop_map(|(clk_khz, per_mille)| {
        let clk_hz = clk_khz as f64 * 1e3;
        (clk_hz, f64::from(per_mille) * 1e9 / clk_hz)
    })
}

/// How long an exposure is, whatever the sensor.
#[derive(Debug, Clone, Copy)]
pub(super) struct Length {
    stop_periods: u32,
    laser_cycles: u32,
}

/// Shrinks towards one short laser cycle.
pub(super) fn lengths() -> impl Strategy<Value = Length> + Clone {
    (20u32..80, 1u32..8).prop_map(|(stop_periods, laser_cycles)| Length {
        stop_periods,
        laser_cycles,
    })
}

impl Length {
    /// An exposure of about this length.
    pub(super) fn exposure(self, config: &SensorConfig) -> Exposure {
        // Without memory a counter must come round with STOP, or no two laser cycles are alike.
        let wider = usize::from(config.tap == Tap::Borrow);
        let round = 1 << (config.counter_bits + wider);
        let comes_round = !config.p_counter.row().has_memory && round <= 128;
        let stop_periods = if comes_round {
            round
        } else {
            self.stop_periods
        };
        Exposure::new(config, stop_periods, self.laser_cycles)
    }
}

/// Exposures of a sensor: 1 to 7 laser cycles of 20 to 79 CLK periods. A counter without memory comes round in each laser cycle if it has
/// at most 128 counts.
///
/// The sensor must have passed [`SensorConfig::check`].
pub fn exposures(config: &SensorConfig) -> impl Strategy<Value = Exposure> + Clone + use<> {
    let config = config.clone();
    lengths().prop_map(move |length| length.exposure(&config))
}

/// Start values of a sensor in an exposure, from 0 to one whose window never opens, if the counter has bits for it.
pub fn start_values(
    config: &SensorConfig,
    exposure: &Exposure,
) -> impl Strategy<Value = u16> + Clone + use<> {
    0..=last_start(config, exposure)
}

/// A start value whose LOCAL_STOP does not come within the laser cycle, or the largest one there is.
pub(super) fn last_start(config: &SensorConfig, exposure: &Exposure) -> u16 {
    let most = exposure.stop_periods as usize / config.step_periods + 1;
    config.largest_start().min(most as u16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::{AfterBorrow, PCounter};
    use crate::strategies::drawn;

    #[test]
    fn phases_reach_half_a_clk_period_either_way() {
        let shares = (0..400).map(|seed| {
            let (clk_hz, stop_phase_ps) = drawn(seed, &clocks(100e6..500e6));
            assert!((100e6..500e6).contains(&clk_hz), "{clk_hz}");
            stop_phase_ps * clk_hz * 1e-12
        });
        let shares: Vec<f64> = shares.collect();
        let most = shares.iter().copied().fold(0.0, f64::max);
        let least = shares.iter().copied().fold(0.0, f64::min);
        assert!((0.498..0.5).contains(&most) && (0.498..0.5).contains(&-least));
    }

    #[test]
    fn a_counter_without_memory_comes_round_with_stop() {
        let config = SensorConfig {
            p_counter: PCounter::Memoryless,
            after_borrow: AfterBorrow::Wrap,
            counter_bits: 5,
            ..SensorConfig::default()
        };
        let exposure = drawn(1, &exposures(&config));
        assert_eq!(exposure.stop_periods, 64);
        assert_eq!(last_start(&config, &exposure), 31);
        let quantic4x4 = SensorConfig::default();
        let exposure = Exposure::new(&quantic4x4, 60, 1);
        assert_eq!(last_start(&quantic4x4, &exposure), 61);
        let law = crate::chip::WindowLaw::new(&quantic4x4, &exposure);
        assert_eq!(law.window(61), crate::chip::WindowOutcome::Never);
        let starts = (0..500).map(|seed| drawn(seed, &start_values(&quantic4x4, &exposure)));
        assert_eq!(starts.max(), Some(61));
    }
}
