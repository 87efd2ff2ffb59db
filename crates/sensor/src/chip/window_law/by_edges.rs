//! The window law edge by edge: what every CLK edge of a laser cycle does, one after the other, against the law's sums, in random cases
//! (`cases`).

mod cases;

use self::cases::{meets, sensors, timings};
use super::*;
use crate::chip::{AfterBorrow, SensorConfig};
use crate::units::Frequency;
use proptest::prelude::*;

/// Signals that are closer than this to a limit race.
const NEAR: Time = Time::from_fs(2);

/// What a start value does. A race has its signal's time, and from when to when it must not come.
#[derive(Debug, PartialEq)]
enum StartValueOutcome {
    Strobe {
        cause: Time,
        strobe: Time,
        counted: i64,
        is_regular: bool,
    },
    Irregular,
    Never,
    Race(Conflict, Time, Time, Option<Time>),
}

/// A macropixel whose edges are gone through.
struct Edges {
    config: SensorConfig,
    exposure: Exposure,
    timing: ChipTiming,
}

impl Edges {
    fn period(&self) -> Time {
        self.exposure.clock.period()
    }

    fn end(&self) -> Time {
        self.exposure.stop(1)
    }

    /// Some more than those of the exposure: a counter that nothing resets may count longer than a laser cycle.
    fn numbers(&self) -> std::ops::Range<i64> {
        let all = self.exposure.stop_periods * self.exposure.laser_cycles;
        -4..i64::from(all) + 4
    }

    fn strobe(&self, edge: i64) -> Time {
        let timing = &self.timing;
        let count = self.exposure.falling(edge) + timing.clk_to_counter_clk;
        count + timing.counter.clk_to_local_stop + timing.local_stop_to_strobe
    }

    /// The first strobe after STOP that HIT's reset may keep from being counted.
    fn surely_counts(&self) -> Time {
        let timing = &self.timing;
        let hit_falls = timing.stop_to_start_falls - timing.hit_high;
        timing.stop_to_hit_reset.min(hit_falls) - timing.strobe_to_hit - NEAR
    }

    /// The strobe of a P-counter that each STOP resets.
    fn after_reset(&self, start: u16) -> StartValueOutcome {
        let (timing, counter) = (&self.timing, &self.timing.counter);
        if self.period() <= counter.period + NEAR {
            return StartValueOutcome::Race(
                Conflict::SlowCounter,
                counter.period + NEAR,
                self.period(),
                None,
            );
        }
        let wraps = self.config.after_borrow == AfterBorrow::Wrap;
        let falls = wraps || self.config.p_counter.row().clears_first;
        if falls && starts_high(&self.config, start) {
            let rise = timing.stop_to_reset + counter.reset_to_local_stop.unwrap();
            let strobe = rise + timing.local_stop_to_strobe;
            let held = timing.stop_to_hit_release - timing.removal - NEAR;
            if strobe >= held {
                return StartValueOutcome::Race(
                    Conflict::ResetStrobeAtHitReset,
                    strobe,
                    held,
                    None,
                );
            }
        }
        let Some(rises) = Rises::from_start_value(&self.config, start) else {
            return StartValueOutcome::Never;
        };
        let no_more = timing.stop_to_reset_release - counter.removal - NEAR;
        let settled = timing.stop_to_reset + counter.settle;
        let released = timing.stop_to_reset_release + counter.release + counter.recovery;
        let surely = settled.max(released) + NEAR;
        let mut counts = 0;
        let mut stops = Vec::new();
        for edge in self.numbers() {
            let count = self.exposure.falling(edge) + timing.clk_to_counter_clk;
            if no_more <= count && count <= surely {
                return StartValueOutcome::Race(
                    Conflict::ClkAtResetEnd,
                    count,
                    no_more,
                    Some(surely),
                );
            }
            if surely < count && count < self.end() + timing.stop_to_reset {
                let since = counts - rises.first;
                if since == 0 || since > 0 && rises.every.is_some_and(|every| since % every == 0) {
                    stops.push(edge);
                }
                counts += 1;
            }
        }
        let (Some(&first), Some(&last)) = (stops.first(), stops.last()) else {
            return StartValueOutcome::Never;
        };
        let waits = rises.every.is_none();
        let strobe = self.strobe(last);
        let latched = self.end() + timing.stop_to_hit_reset - timing.strobe_to_hit;
        if strobe > latched + NEAR && waits {
            return StartValueOutcome::Never;
        }
        let surely = self.end() + self.surely_counts();
        if strobe >= surely {
            let until = waits.then_some(latched + NEAR);
            return StartValueOutcome::Race(Conflict::StrobeAtNextReset, strobe, surely, until);
        }
        let ready = timing.stop_to_hit_release + timing.recovery + NEAR;
        let strobe = self.strobe(first);
        if strobe >= self.surely_counts() && strobe <= ready {
            return StartValueOutcome::Race(
                Conflict::StrobeAtReset,
                strobe,
                self.surely_counts(),
                Some(ready),
            );
        }
        self.strobe_outcome(first, stops.len() == 1)
    }

    fn strobe_outcome(&self, counted: i64, is_regular: bool) -> StartValueOutcome {
        let strobe = self.strobe(counted);
        let cause = strobe - self.timing.local_stop_to_strobe;
        StartValueOutcome::Strobe {
            cause,
            strobe,
            counted,
            is_regular,
        }
    }

    /// The strobe of a P-counter that runs on from the exposure's first STOP edge.
    fn running_on(&self, start: u16) -> StartValueOutcome {
        let (timing, counter) = (&self.timing, &self.timing.counter);
        let enabled = timing.stop_to_enabled;
        let until = enabled + timing.clk_to_counter_clk + counter.clock_high + NEAR;
        for edge in self.numbers() {
            let rise = self.exposure.rising(edge);
            if enabled - NEAR <= rise && rise <= until {
                return StartValueOutcome::Race(
                    Conflict::ClkAtEnable,
                    rise,
                    enabled - NEAR,
                    Some(until),
                );
            }
        }
        let Some(Rises {
            first,
            every: Some(every),
        }) = Rises::from_start_value(&self.config, start)
        else {
            return StartValueOutcome::Never;
        };
        let periods = i64::from(self.exposure.stop_periods);
        let last = periods * i64::from(self.exposure.laser_cycles);
        // The low phase in which ENABLE comes is the first count, whether CLK falls before it or after.
        let counted = self
            .numbers()
            .find(|&edge| self.exposure.rising(edge) > enabled)
            .unwrap();
        let stops: Vec<i64> = (counted + first..=last).step_by(every as usize).collect();
        let fall = |edge| self.exposure.falling(edge);
        if let Some(&edge) = stops
            .first()
            .filter(|&&edge| first == 0 && fall(edge) <= enabled + NEAR)
        {
            let (comes, race) = (fall(edge), Conflict::LocalStopAtEnable);
            return StartValueOutcome::Race(
                race,
                comes,
                comes.min(enabled),
                Some(comes.max(enabled)),
            );
        }
        if stops.last() == Some(&last) {
            let (comes, end) = (fall(last), self.exposure.end() + enabled);
            return StartValueOutcome::Race(
                Conflict::LocalStopAtEnable,
                comes,
                comes.min(enabled),
                Some(comes.max(end)),
            );
        }
        if counted + first > last {
            return StartValueOutcome::Never;
        }
        let from = self.surely_counts();
        let to = timing.stop_to_hit_release + timing.recovery + NEAR;
        for &edge in &stops {
            let strobe = self.strobe(edge.rem_euclid(periods));
            for strobe in [strobe, strobe - self.end()] {
                if from <= strobe && strobe <= to {
                    return StartValueOutcome::Race(
                        Conflict::StrobeAtReset,
                        strobe,
                        from,
                        Some(to),
                    );
                }
            }
        }
        self.strobe_outcome(counted + first, periods == every)
    }

    fn strobed(&self, start: u16) -> StartValueOutcome {
        let timing = &self.timing;
        let event = timing.clk_to_event + timing.setup + NEAR;
        if self.config.tdc.has_clk_bins() && self.period() <= event {
            let what = match self.config.tdc {
                Tdc::Counter => Conflict::SlowPath,
                _ => Conflict::SlowCorrelation,
            };
            return StartValueOutcome::Race(what, event, self.period(), None);
        }
        match self.config.mode {
            Mode::Conventional if timing.stop_to_strobe <= timing.stop_to_hit_ready + NEAR => {
                StartValueOutcome::Race(
                    Conflict::StrobeAtReset,
                    timing.stop_to_strobe,
                    Time::ZERO,
                    Some(timing.stop_to_hit_ready + NEAR),
                )
            }
            Mode::Conventional => StartValueOutcome::Strobe {
                cause: self.end(),
                strobe: self.end() + timing.stop_to_strobe,
                counted: 0,
                is_regular: true,
            },
            Mode::Guided if self.config.p_counter.row().has_memory => self.after_reset(start),
            Mode::Guided => self.running_on(start),
        }
    }

    /// The window as well: the edge that takes the photons of bin 0, and what the strobe has left.
    fn window(&self, start: u16) -> (StartValueOutcome, Option<(i64, Time)>) {
        let found = self.strobed(start);
        let StartValueOutcome::Strobe {
            cause,
            strobe,
            counted,
            is_regular,
        } = found
        else {
            return (found, None);
        };
        let timing = &self.timing;
        if self.config.tdc == Tdc::Counter {
            return self.counted_by_clk(found, strobe + timing.strobe_to_hit, counted);
        }
        let is_clocked = self.config.tdc == Tdc::Clocked;
        let (mut edge, mut last, mut slack) = (-100, None, Time::MAX);
        while self.exposure.rising(edge) + timing.clk_to_shift <= strobe + self.period() {
            let shift = self.exposure.rising(edge) + timing.clk_to_shift;
            let (from, to) = (shift - timing.hold - NEAR, shift + timing.setup + NEAR);
            if is_clocked && from <= strobe && strobe <= to {
                let fall = self.exposure.falling(counted);
                let race = match self.config.mode {
                    Mode::Guided => StartValueOutcome::Race(
                        Conflict::StrobeAtShift,
                        strobe - fall,
                        from - fall,
                        Some(to - fall),
                    ),
                    Mode::Conventional => {
                        let strobe = strobe - cause;
                        let (from, to) =
                            (strobe - timing.setup - NEAR, strobe + timing.hold + NEAR);
                        StartValueOutcome::Race(
                            Conflict::ShiftAtStrobe,
                            shift - cause,
                            from,
                            Some(to),
                        )
                    }
                };
                return (race, None);
            }
            if shift <= strobe {
                last = Some(edge);
            }
            if is_clocked {
                let (setup, hold) = (strobe - timing.setup - shift, shift - timing.hold - strobe);
                slack = slack.min(setup.max(hold));
            }
            edge += 1;
        }
        if !is_regular {
            return (StartValueOutcome::Irregular, None);
        }
        let bins = self.config.bins as i64;
        (found, last.map(|edge| (edge - bins, slack)))
    }

    /// The window of a counter TDC whose START rises at `rises`.
    fn counted_by_clk(
        &self,
        found: StartValueOutcome,
        rises: Time,
        counted: i64,
    ) -> (StartValueOutcome, Option<(i64, Time)>) {
        let (setup, hold) = (self.timing.setup, self.timing.hold);
        let falls = self.timing.stop_to_start_falls;
        let edges = || {
            let numbers = self.numbers();
            numbers.map(|edge| (edge, self.exposure.rising(edge)))
        };
        for (_, clk) in edges() {
            let (from, to) = (falls - hold - NEAR, falls + setup + NEAR);
            if from <= clk && clk <= to {
                let race = StartValueOutcome::Race(Conflict::StartFallsAtClk, clk, from, Some(to));
                return (race, None);
            }
        }
        let mut slack = Time::MAX;
        for (_, clk) in edges() {
            let (from, to) = (clk - setup - NEAR, clk + hold + NEAR);
            if from <= rises && rises <= to {
                let fall = self.exposure.falling(counted);
                let (from, to) = (from - fall, Some(to - fall));
                let race = StartValueOutcome::Race(Conflict::StartAtClk, rises - fall, from, to);
                return (race, None);
            }
            slack = slack.min((clk - setup - rises).max(rises - hold - clk));
        }
        let first_after = |change: Time| edges().find(|&(_, clk)| clk >= change);
        let (Some((low, _)), Some((first, _))) = (first_after(falls), first_after(rises)) else {
            return (StartValueOutcome::Irregular, None);
        };
        let is_regular = matches!(
            found,
            StartValueOutcome::Strobe {
                is_regular: true,
                ..
            }
        );
        let ends = first + self.config.bins as i64;
        if !is_regular || first <= low || ends > i64::from(self.exposure.stop_periods) {
            return (StartValueOutcome::Irregular, None);
        }
        (found, Some((first, slack)))
    }
}

fn of_law(law: &WindowLaw, start: u16) -> (StartValueOutcome, Option<(i64, Time)>) {
    match law.window(start) {
        WindowOutcome::Open(window) => {
            let strobe = match law.sensor.mode {
                Mode::Guided => window.strobe_cause + law.timing.local_stop_to_strobe,
                Mode::Conventional => window.strobe_cause + law.timing.stop_to_strobe,
            };
            let found = StartValueOutcome::Strobe {
                cause: window.strobe_cause,
                strobe,
                counted: window.count_edge,
                is_regular: true,
            };
            let slack = match law.sensor.tdc {
                Tdc::Clocked | Tdc::Counter => window.slack,
                Tdc::DelayLine => Time::MAX,
            };
            (found, Some((window.first_edge, slack)))
        }
        WindowOutcome::Never => (StartValueOutcome::Never, None),
        WindowOutcome::Irregular(_) => (StartValueOutcome::Irregular, None),
        WindowOutcome::Race(race) => (
            StartValueOutcome::Race(race.what, race.comes, race.from, race.to),
            None,
        ),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    #[test]
    fn the_law_is_what_the_edges_do(
        config in sensors(), timing in timings(), meet in meets(),
        stop_periods in 4u32..140, laser_cycles in 1u32..5, cycle in 0i64..5,
    ) {
        if config.check().is_err() {
            return Ok(());
        }
        let exposure = Exposure::new(&config, stop_periods, laser_cycles);
        let mut edges = Edges { config, exposure, timing };
        edges.apply_meet(meet);
        if edges.config.tdc == Tdc::Counter {
            // START does not come before what sets it.
            edges.timing.strobe_to_hit = edges.timing.strobe_to_hit.max(Time::ZERO);
        }
        let timing = edges.timing;
        let mut law = WindowLaw::with_timing(&edges.config, &exposure, timing);
        let taps: Vec<Time> = (0..=16).map(|n| Time::from_ps(130 * n)).collect();
        if edges.config.tdc == Tdc::DelayLine {
            law = law.with_taps(std::slice::from_ref(&taps));
        }
        for start in 0..=edges.config.largest_start() {
            let (found, window) = edges.window(start);
            prop_assert_eq!(of_law(&law, start), (found, window), "{} {:?}", start, edges.config);
            // At the periods that a cure offers nothing is too slow, and the strobe keeps its distance. It comes by way of more gates than
            // the shift register.
            if let WindowOutcome::Race(Race { what, comes, cure: Cure::Period { at_least, at_most }, .. }) = law.window(start)
                && (what != Conflict::StrobeAtShift || comes > timing.clk_to_shift)
            {
                for period in [Some(at_least), at_most].into_iter().flatten() {
                    let clock = Frequency::from_hz_f64(1.0 / period.as_s()).unwrap();
                    let cured = WindowLaw::with_timing(&edges.config, &Exposure { clock, ..exposure }, timing);
                    if let WindowOutcome::Race(race) = cured.window(start) {
                        let is_slower = race.what <= Conflict::SlowPath && what > Conflict::SlowPath;
                        prop_assert!(race.what != what && !is_slower, "{race} at {period}");
                    }
                }
            }
            let WindowOutcome::Open(window) = law.window(start) else {
                continue;
            };
            // The first pulse that comes too late for the signal that ends each bin.
            let later = exposure.stop(cycle);
            let sampled = match edges.config.mode {
                Mode::Guided => window.strobe_cause + timing.local_stop_to_sample,
                Mode::Conventional => window.strobe_cause + timing.stop_to_sample,
            };
            let ends: Vec<Time> = taps.iter().zip(window.first_edge - 1..).map(|(&tap, edge)| {
                let end = match edges.config.tdc {
                    Tdc::Clocked | Tdc::Counter => exposure.rising(edge),
                    Tdc::DelayLine => sampled + tap,
                };
                later + end - timing.spad_to_sampled + Time::from_fs(1)
            }).collect();
            let found = law.edges(&window, cycle);
            prop_assert_eq!(found.edges(), &ends[..]);
        }
    }

    /// Where one of the start values opens a window that the law looks at first.
    #[test]
    fn the_chosen_start_value_is_the_best_that_opens(
        config in sensors(), timing in timings(), stop_periods in 4u32..140, laser_cycles in 1u32..5, at in 0f64..1.2,
    ) {
        if config.check().is_err() {
            return Ok(());
        }
        let exposure = Exposure::new(&config, stop_periods, laser_cycles);
        let law = WindowLaw::with_timing(&config, &exposure, timing);
        let largest = config.largest_start();
        let opens = |start: u16| law.window(start).open();
        if ![0, 1, 16.min(largest), largest / 2].into_iter().any(|start| opens(start).is_some()) {
            return Ok(());
        }
        let time = Time::from_s(at * exposure.stop(1).as_s());
        let distance = |start: u16| {
            let interval = law.interval(&opens(start)?);
            let twice = interval.start + interval.end - time - time;
            interval.contains(&time).then(|| twice.as_fs().abs() / 2)
        };
        let least = (0..=largest).filter_map(distance).min();
        let chosen = law.start_for(time);
        prop_assert_eq!(chosen.is_some(), least.is_some(), "{:?}", config);
        if let (Some(chosen), Some(least)) = (chosen, least) {
            let found = distance(chosen).unwrap();
            prop_assert!(found <= least + 1, "{chosen} {found} {least} {config:?}");
        }
    }
}
