//! Where LOCAL_STOP rises after STOP, and which resets its strobe may meet.
//!
//! ```text
//!   STOP           ▁╱▔▔▔▔▔▔▔▔▔▔▔▔▔ … ▔▔▔▔▔▔╱▔▔▔▔   the next one
//!   COUNTER_RESET  ▁▁╱▔▔▔▔▔▔▔╲▁▁▁▁ … ▁▁▁▁▁▁▁╱▔▔▔
//!   COUNTER_CLK    no edge ──┤ counts … counts ├── no edge that LOCAL_STOP still follows
//!   HIT's reset    ▁▁▁╱▔▔▔▔▔▔▔╲▁▁▁ … ▁▁▁▁▁▁▁▁╱▔▔   no strobe from where HIT is too short for its bin, until HIT has recovered
//! ```
//!
//! A counter with memory begins anew with each STOP. One without comes round by itself, from the ENABLE of the first laser cycle on.

use super::*;

/// Where LOCAL_STOP rises first.
pub(super) struct LocalStop {
    /// After its laser cycle's STOP edge.
    pub time: Time,
    /// The falling CLK edge that makes it.
    pub edge: i64,
    /// What keeps it from rising once in every laser cycle at this place, if anything.
    pub irregular: Option<Irregular>,
}

impl WindowLaw {
    /// STOP's own strobe, if it comes before STOP has released HIT.
    pub(super) fn strobe_of_stop(&self) -> Option<Race> {
        let (comes, ready) = (self.timing.stop_to_strobe, self.timing.stop_to_hit_ready);
        (comes <= ready + ROUNDING).then_some(Race {
            what: Conflict::StrobeAtReset,
            after: RaceOrigin::StopRises,
            comes,
            from: Time::ZERO,
            to: Some(ready + ROUNDING),
            cure: Cure::ResetChain,
        })
    }

    /// After a STOP edge, the last strobe of the laser cycle before that its bins count, and the last that they may.
    fn last_strobes(&self) -> (Time, Time) {
        let timing = &self.timing;
        let may = timing.stop_to_hit_reset - timing.strobe_to_hit;
        let surely = timing.stop_to_start_falls - timing.hit_high - timing.strobe_to_hit;
        (may.min(surely) - ROUNDING, may + ROUNDING)
    }

    /// A strobe that comes at `comes` after a STOP edge, from the last one on that counts until HIT is ready again.
    fn strobe_at_reset(&self, comes: Time) -> Option<Race> {
        let (from, _) = self.last_strobes();
        let to = self.timing.stop_to_hit_release + self.timing.recovery + ROUNDING;
        (from..=to).contains(&comes).then_some(Race {
            what: Conflict::StrobeAtReset,
            after: RaceOrigin::StopRises,
            comes,
            from,
            to: Some(to),
            cure: Cure::LaserCycle,
        })
    }

    /// COUNTER_RESET, where it ends before what it resets has settled.
    fn short_reset(&self) -> Option<Race> {
        let counter = &self.timing.counter;
        let race = || Race::short_reset(counter.reset_need, counter.reset_width);
        (counter.reset_width < counter.reset_need).then(race)
    }

    /// A strobe that the reset itself makes, where LOCAL_STOP starts high and may have been low or is cleared before, if the reset of HIT does not hold then.
    fn reset_strobe(&self, start: u16) -> Option<Race> {
        let (sensor, timing) = (&self.sensor, &self.timing);
        let falls = sensor.after_borrow == AfterBorrow::Wrap || sensor.p_counter.row().clears_first;
        if !falls || !starts_high(sensor, start) {
            return None;
        }
        let delay = timing.counter.reset_to_local_stop.unwrap_or_default();
        let arrival = timing.stop_to_reset + delay + timing.local_stop_to_strobe;
        let until = timing.stop_to_hit_release - timing.removal - ROUNDING;
        (arrival >= until).then_some(Race {
            what: Conflict::ResetStrobeAtHitReset,
            after: RaceOrigin::StopRises,
            comes: arrival,
            from: until,
            to: None,
            cure: Cure::Tap,
        })
    }

    /// LOCAL_STOP that leaves too short a piece of a pulse of COUNTER_CLK.
    fn cut_pulse(&self, start: u16) -> Option<Race> {
        let timing = &self.timing;
        let block = timing.counter.block?;
        let period = self.exposure.clock.period();
        let to_block = block.from_local_stop;
        let blocks = self.ripple(start) + to_block;
        let counter_clk = timing.clk_to_counter_clk;
        // From the pulse's rise until so much of it is left that it is a pulse.
        let within = (
            counter_clk - ROUNDING,
            counter_clk + timing.counter.clock_high - block.to_counter_clk + ROUNDING,
        );
        let pulses = (blocks - within.0).as_fs().div_euclid(period.as_fs());
        let is_cut = blocks < period * pulses + within.1;
        is_cut.then(|| {
            let ripples = self.ripples();
            let all = ((ripples.0 + to_block, ripples.1 + to_block), within);
            Race::cut_pulse(period, pulses, blocks, all, self.shortest_period())
        })
    }

    /// LOCAL_STOP of a counter that each STOP resets.
    pub(super) fn with_reset(&self, start: u16) -> Result<LocalStop, WindowOutcome> {
        let (exposure, timing) = (&self.exposure, &self.timing);
        let counter = &timing.counter;
        let (period, phase) = (exposure.clock.period(), exposure.stop_phase);
        let count = counter.period + ROUNDING;
        if period <= count {
            let what = Conflict::SlowCounter;
            return Err(WindowOutcome::Race(Race::too_slow(what, count, period)));
        }
        if let Some(race) = self.short_reset().or_else(|| self.reset_strobe(start)) {
            return Err(WindowOutcome::Race(race));
        }
        let Some(rises) = Rises::from_start_value(&self.sensor, start) else {
            return Err(WindowOutcome::Never);
        };
        let released = timing.stop_to_reset_release + counter.release + counter.recovery;
        let in_doubt = timing.stop_to_reset_release - counter.removal - ROUNDING
            ..=released.max(timing.stop_to_reset + counter.settle) + ROUNDING;
        let counter_clk = |edge| exposure.falling(edge) + timing.clk_to_counter_clk;
        let mut first = 0;
        while counter_clk(first) <= *in_doubt.end() {
            first += 1;
        }
        let edge = counter_clk(first - 1);
        if in_doubt.contains(&edge) {
            let what = Conflict::ClkAtResetEnd;
            let race = Race::with_stop(what, edge, in_doubt.into_inner(), phase, period);
            return Err(WindowOutcome::Race(race));
        }

        // Later than the counts that the next reset forestalls.
        let end = exposure.clock.periods(exposure.stop_periods as i64);
        let edges = (0..).map(|n| first + rises.first + n * rises.every.unwrap_or(i64::MAX / 2));
        let edges = edges.take_while(|&edge| counter_clk(edge) < end + timing.stop_to_reset);
        let edges: Vec<i64> = edges
            .take(if rises.every.is_some() { usize::MAX } else { 1 })
            .collect();
        let (Some(&edge), Some(&last)) = (edges.first(), edges.last()) else {
            return Err(WindowOutcome::Never);
        };
        let (surely, may) = self.last_strobes();
        let (surely, may) = (end + surely, end + may);
        let ripple = self.ripple(start);
        let strobe = |edge| exposure.falling(edge) + ripple + timing.local_stop_to_strobe;
        let last = strobe(last);
        if last > may && rises.every.is_none() {
            return Err(WindowOutcome::Never);
        }
        if last >= surely {
            return Err(WindowOutcome::Race(Race {
                what: Conflict::StrobeAtNextReset,
                after: RaceOrigin::StopRises,
                comes: last,
                from: surely,
                to: rises.every.is_none().then_some(may),
                cure: Cure::LaserCycle,
            }));
        }
        if let Some(race) = self.strobe_at_reset(strobe(edge)) {
            return Err(WindowOutcome::Race(race));
        }
        if let Some(race) = self.cut_pulse(start) {
            return Err(WindowOutcome::Race(race));
        }
        Ok(LocalStop {
            time: exposure.falling(edge) + ripple,
            edge,
            irregular: (edges.len() > 1)
                .then_some(Irregular::LocalStopRepeats { rises: edges.len() }),
        })
    }

    /// LOCAL_STOP of a counter that nothing resets.
    pub(super) fn coming_round(&self, start: u16) -> Result<LocalStop, WindowOutcome> {
        let (exposure, timing) = (&self.exposure, &self.timing);
        let counter = &timing.counter;
        let load_period = self.sensor.load_clock().period();
        let half = Time::from_fs(load_period.as_fs() / 2) - ROUNDING;
        let long_load = counter.load_pulse.filter(|&pulse| pulse >= half);
        let long_load = long_load.map(|pulse| Race::long_load(pulse, load_period));
        if let Some(race) = long_load.or_else(|| self.short_reset()) {
            return Err(WindowOutcome::Race(race));
        }
        let enabled = timing.stop_to_enabled;
        let first = exposure.rising_until(enabled) + 1;
        let shortest = counter.clock_high + timing.clk_to_counter_clk + ROUNDING;
        let in_doubt = (enabled - ROUNDING, enabled + shortest);
        let meets = [first, first - 1].map(|edge| exposure.rising(edge));
        let meets = meets
            .into_iter()
            .find(|t| (in_doubt.0..=in_doubt.1).contains(t));
        if let Some(edge) = meets {
            let what = Conflict::ClkAtEnable;
            let (phase, period) = (exposure.stop_phase, exposure.clock.period());
            let race = Race::with_stop(what, edge, in_doubt, phase, period);
            return Err(WindowOutcome::Race(race));
        }
        // A built-in counter without memory wraps.
        let Some(rises) = Rises::from_start_value(&self.sensor, start) else {
            return Err(WindowOutcome::Never);
        };
        let Some(every) = rises.every else {
            return Err(WindowOutcome::Never);
        };
        let periods = exposure.stop_periods as i64;
        let last = periods * exposure.laser_cycles as i64;
        let edge = first + rises.first;
        let is_first_count = rises.first == 0 && exposure.falling(first) <= enabled + ROUNDING;
        if is_first_count || (last >= edge && (last - edge) % every == 0) {
            let comes = exposure.falling(if is_first_count { first } else { last });
            return Err(WindowOutcome::Race(Race {
                what: Conflict::LocalStopAtEnable,
                after: RaceOrigin::FirstStop,
                comes,
                from: comes.min(enabled),
                to: Some(comes.max(if is_first_count {
                    enabled
                } else {
                    exposure.end() + enabled
                })),
                cure: Cure::LaserCycle,
            }));
        }
        if edge > last {
            return Err(WindowOutcome::Never);
        }
        // STOP also resets HIT.
        let end = exposure.clock.periods(periods);
        let meets_reset = |edge: i64| {
            let place = exposure.falling(edge.rem_euclid(periods));
            let arrival = place + self.ripple(start) + timing.local_stop_to_strobe;
            let mut arrivals = [arrival, arrival - end].into_iter();
            arrivals.find_map(|comes| self.strobe_at_reset(comes))
        };
        let mut edges = (edge..last).step_by(every as usize).take(periods as usize);
        if let Some(race) = edges.find_map(meets_reset) {
            return Err(WindowOutcome::Race(race));
        }
        Ok(LocalStop {
            time: exposure.falling(edge) + self.ripple(start),
            edge,
            irregular: (periods != every).then_some(Irregular::OutOfStep {
                stop_periods: periods,
                round: every,
            }),
        })
    }
}
