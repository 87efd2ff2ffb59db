//! The ripple to LOCAL_STOP of every start value, and when a reset has put all outputs back (thesis 4.6, Fig. 56).

use super::Bench;
use crate::chip::{AfterBorrow, Exposure, SensorConfig, Tap};
use crate::kernel::Recorder;
use crate::report::Checks;
use crate::units::Time;

/// What a load takes.
const LOAD: Time = Time::from_ns(5);

/// Loads every start value and counts it out twice, the second time from a counter that has rolled over.
pub(super) fn ripple(bench: &Bench, checks: &mut Checks) {
    let (config, timing) = (&bench.config, &bench.timing);
    let exposure = Exposure::new(config, 2, 1);
    let first_fall = bench.first_fall;
    // STOP is high and low for as long as its delay chain takes.
    let late = (first_fall - 1).max(0);
    let periods = |time: Time| (time.as_s() * config.clk_hz).ceil() as i64;
    let load_periods = 4.max(periods(LOAD));
    let after_borrow = 2 + periods(timing.ripple());
    let falling_clk = |period: i64| bench.origin + exposure.falling(period);
    let stop_at = |period: i64| falling_clk(period) + exposure.stop_phase;
    let mut drives = bench.power_up();
    let (mut cycles, mut loads) = (Vec::new(), Vec::new());
    let mut period = 0;
    for start in 0..=config.largest_start() as i64 {
        let disabled = stop_at(period);
        drives.set(disabled, bench.enable, false);
        bench.load(&mut drives, disabled, start as u64);
        period += load_periods;
        drives.set(stop_at(period), bench.enable, true);
        loads.push(disabled..stop_at(period));
        for _ in 0..2 {
            drives.pulse(bench.stop, stop_at(period), stop_at(period + 1 + late));
            let first = bench.first_edge(start as u64);
            cycles.extend(first.map(|first| (first, period)));
            period += first.unwrap_or(0) + 2 * late + after_borrow;
        }
    }
    bench.drive_clk(&mut drives, &exposure, (0, 2 * period));
    let counter_out = bench.inner.iter().flat_map(|[_, out]| out.iter().copied());
    let mut recorder = Recorder::new(counter_out.chain([bench.local_stop]));
    bench.rig.run(drives, falling_clk(period), &mut recorder);

    let mut rises = recorder.rising_edges(bench.local_stop);
    if config.after_borrow == AfterBorrow::Wrap {
        // Of each laser cycle the first: a short counter comes round before the next STOP.
        let mut last = None;
        let cycle_of = |t: &Time| cycles.partition_point(|&(_, stop)| stop_at(stop) <= *t);
        rises.retain(|rise| last.replace(cycle_of(rise)) != Some(cycle_of(rise)));
    }
    if config.tap == Tap::Msb {
        // It follows what is loaded.
        rises.retain(|rise| !loads.iter().any(|load| load.contains(rise)));
    }
    let expected = cycles.len();
    let what = format!(
        "start values 0 to {}, twice each: LOCAL_STOPs",
        config.largest_start()
    );
    checks.equal(what, expected, rises.len());
    let ripple = |(&rise, &(first, stop)): (&Time, &(i64, i64))| {
        rise - falling_clk(stop + first_fall + first)
    };
    let ripples: Vec<Time> = rises.iter().zip(&cycles).map(ripple).collect();
    let what = format!("ripple, CLK fall start + {first_fall} to LOCAL_STOP, of all");
    bench.takes(what, checks, Time::ZERO, timing.ripple(), &ripples);
    if bench.inner.is_none() {
        return;
    }
    const PUBLISHED: Time = Time::from_ps(1200);
    let worst = ripples.iter().copied().max().unwrap_or(Time::ZERO);
    let off = (worst - PUBLISHED).as_s() / PUBLISHED.as_s();
    let default = SensorConfig::default();
    let is_published = (config.counter_bits, config.corner, bench.factor)
        == (default.counter_bits, default.corner, 1.0);
    if is_published {
        checks.add_verdict(
            "worst ripple against the published one (4.6, Fig. 56)",
            format!("{PUBLISHED} within 1 %"),
            format!("{worst}, {:+.2} %", 100.0 * off),
            off.abs() < 0.01,
        );
    }

    // Outputs on their way back to the start value are edges for the next stage, too.
    let last_change = |stop: i64| {
        let (stop, first_count) = (stop_at(stop), falling_clk(stop + first_fall));
        let changes = recorder.changes();
        let until = first_count.min(stop + exposure.clock.half_periods(1));
        let until = changes.partition_point(|c| c.0 <= until);
        let back = changes[..until]
            .iter()
            .rev()
            .find(|c| c.1 != bench.local_stop);
        back.map_or(Time::ZERO, |c| (c.0 - stop).max(Time::ZERO))
    };
    let settled = cycles.iter().map(|&(_, stop)| last_change(stop)).max();
    let settled = settled.unwrap_or(Time::MAX);
    checks.add_verdict(
        "latest change of COUNTER_OUT by a reset, after STOP",
        format!(
            "before {}, COUNTER_RESET's fall",
            timing.stop_to_reset_release
        ),
        settled,
        Time::ZERO < settled && settled < timing.stop_to_reset_release,
    );
}
