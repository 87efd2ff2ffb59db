//! Random macropixels for the window law. Delays are multiples of 100 ps, CLK's too, and a few femtoseconds off: so every two signals meet
//! in some cases, and limits are tried to the femtosecond.

use super::Edges;
use crate::chip::timing::{ChipTiming, CounterTiming};
use crate::chip::{AfterBorrow, Mode, PCounter, SensorConfig, Tap, Tdc};
use crate::units::Time;
use proptest::prelude::*;

/// Multiples of 100 ps, one in four of them a few femtoseconds off.
fn delay(steps: std::ops::Range<i64>) -> impl Strategy<Value = Time> {
    let off = prop_oneof![3 => Just(0i64), 1 => -3i64..4];
    (steps, off).prop_map(|(steps, off)| Time::from_fs((100_000 * steps + off).max(0)))
}

prop_compose! {
    fn counters()(
        (clk_to_local_stop, reset_to_local_stop) in (delay(2..20), delay(1..20)),
        (release, settle, period) in (delay(0..6), delay(0..20), delay(5..26)),
        (recovery, removal, clock_high) in (delay(0..4), delay(0..4), delay(0..6)),
    ) -> CounterTiming {
        let reset_to_local_stop = Some(reset_to_local_stop);
        CounterTiming {
            clk_to_local_stop, reset_to_local_stop, release, settle, period, recovery, removal, clock_high,
            block: None, load_pulse: None, reset_width: Time::ZERO, reset_need: Time::ZERO,
        }
    }
}

prop_compose! {
    /// Pulses of resets are longer than the way of a CLK edge to COUNTER_CLK, as all netlists have them.
    pub(super) fn timings()(
        (spad_to_sampled, clk_to_counter_clk, counter) in (delay(1..20), delay(1..8), counters()),
        (local_stop_to_strobe, local_stop_to_sample) in (delay(1..8), delay(1..12)),
        (stop_to_strobe, stop_to_sample, strobe_to_hit) in (delay(1..20), delay(1..20), delay(0..6)),
        (hit_high, stop_to_hit_ready) in (delay(0..6), delay(0..12)),
        (clk_to_shift, clk_to_event) in (delay(0..14), delay(5..22)),
        (stop_to_reset, reset, stop_to_hit_reset, hit_reset) in (delay(1..5), delay(8..20), delay(1..12), delay(4..20)),
        (stop_to_enabled, stop_to_start_falls) in (delay(1..30), delay(2..30)),
        (setup, hold, recovery, removal) in (delay(0..4), delay(0..3), delay(0..4), delay(0..4)),
    ) -> ChipTiming {
        ChipTiming {
            spad_to_sampled, clk_to_counter_clk, counter, local_stop_to_strobe, local_stop_to_sample, stop_to_strobe,
            stop_to_sample, strobe_to_hit, hit_high, stop_to_hit_ready, clk_to_shift, clk_to_event, stop_to_reset, stop_to_hit_reset,
            stop_to_enabled, stop_to_start_falls, setup, hold, recovery, removal,
            stop_to_reset_release: stop_to_reset + reset,
            stop_to_hit_release: stop_to_hit_reset + hit_reset,
            clk_period: Time::ZERO,
            ..ChipTiming::new(&SensorConfig::default())
        }
    }
}

/// A CLK edge, by its number, that comes at a limit, and how far beside it, fs.
#[derive(Debug, Clone, Copy)]
pub(super) enum Meet {
    /// The strobe that it counts towards, and the next laser cycle's reset.
    Reset(i64, i64),
    /// Its fall, and ENABLE.
    Enable(i64, i64),
}

pub(super) fn meets() -> impl Strategy<Value = Option<Meet>> {
    let reset = (4i64..60, -5i64..6).prop_map(|(edge, off)| Meet::Reset(edge, off));
    let enable = (1i64..3, -5i64..6).prop_map(|(edge, off)| Meet::Enable(edge, off));
    prop_oneof![2 => Just(None), 1 => reset.prop_map(Some), 1 => enable.prop_map(Some)]
}

impl Edges {
    pub(super) fn apply_meet(&mut self, meet: Option<Meet>) {
        match meet {
            None => {}
            Some(Meet::Reset(edge, off)) => {
                let reset = self.end() + self.timing.stop_to_hit_reset;
                self.timing.strobe_to_hit = reset - self.strobe(edge) - Time::from_fs(off);
            }
            Some(Meet::Enable(edge, off)) => {
                self.timing.stop_to_enabled = self.exposure.falling(edge) - Time::from_fs(off);
            }
        }
    }
}

prop_compose! {
    pub(super) fn sensors()(
        half_period in 10i64..22,
        phase in -20i64..20,
        (counter_bits, step) in (3usize..6, 0u32..2),
        p_counter in prop::sample::select(PCounter::ALL.to_vec()),
        tap in prop::sample::select(vec![Tap::Borrow, Tap::Msb]),
        after_borrow in prop::sample::select(vec![AfterBorrow::Hold, AfterBorrow::Wrap]),
        mode in prop::sample::select(vec![Mode::Guided, Mode::Guided, Mode::Conventional]),
        tdc in prop::sample::select(vec![Tdc::Clocked, Tdc::Counter, Tdc::DelayLine]),
    ) -> SensorConfig {
        SensorConfig {
            clk_hz: 1e10 / (2 * half_period) as f64,
            stop_phase_ps: 100.0 * phase.clamp(-half_period, half_period) as f64,
            counter_bits,
            step_periods: 1 << step,
            p_counter,
            tap,
            after_borrow,
            mode,
            tdc,
            ..SensorConfig::default()
        }
    }
}
