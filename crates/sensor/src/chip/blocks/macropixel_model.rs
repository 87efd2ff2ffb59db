//! A macropixel in plain Rust, stepped edge by edge through its blocks' models: the slow reference of engines and gates.
//!
//! It is for TDCs with CLK, not for delay lines. Only the arrival of the strobe, of the reset and of the SPAD pulses is timed
//! ([`ChipTiming`]).

use std::collections::VecDeque;

use super::{correlation, front_end, histogram, metdc, metdc_counter, p_counter};
use crate::chip::config::{Mode, SensorConfig, Tdc};
use crate::chip::exposure::Exposure;
use crate::chip::timing::chip_timing::ChipTiming;
use crate::chip::timing::local_stop::LocalStopDelays;
use crate::units::Time;

/// Reference model of a macropixel during one exposure.
#[derive(Debug, Clone)]
pub struct MacropixelModel<'a> {
    config: &'a SensorConfig,
    exposure: &'a Exposure,
    timing: ChipTiming,
    local_stop: &'a LocalStopDelays,
}

impl<'a> MacropixelModel<'a> {
    /// A macropixel of this sensor, with these delays, and of LOCAL_STOP those of each start value, in this exposure.
    pub fn new(
        config: &'a SensorConfig,
        (timing, local_stop): (ChipTiming, &'a LocalStopDelays),
        exposure: &'a Exposure,
    ) -> Self {
        MacropixelModel {
            config,
            exposure,
            timing,
            local_stop,
        }
    }

    /// Histogram after the exposure, `bins` counts, for a start value and the rising edges of
    /// SPAD_RAW as (time, SPAD), sorted by time.
    pub fn histogram(&self, start: u16, pulses: impl IntoIterator<Item = (Time, u8)>) -> Vec<u16> {
        let mut hits = vec![0u64; self.config.bins];
        if self.config.tdc == Tdc::Counter {
            self.add_events(start, pulses, &mut hits);
        } else {
            self.run(start, pulses, |_, latched| {
                for (bin, count) in hits.iter_mut().enumerate() {
                    *count += latched >> bin & 1;
                }
            });
        }
        histogram::counts(self.config, hits)
    }

    /// What a counter TDC adds to the bins: START is high from each strobe to the next reset.
    fn add_events(
        &self,
        start: u16,
        pulses: impl IntoIterator<Item = (Time, u8)>,
        hits: &mut [u64],
    ) {
        let (config, exposure, timing) = (self.config, self.exposure, &self.timing);
        let cycles = i64::from(exposure.laser_cycles);
        let mut rises = Vec::new();
        self.run(start, [], |local_stop, _| {
            let strobe = local_stop + timing.local_stop_to_strobe;
            let is_held = (0..=cycles).map(|cycle| exposure.stop(cycle)).any(|stop| {
                (stop + timing.stop_to_hit_reset..stop + timing.stop_to_hit_release)
                    .contains(&strobe)
            });
            if !is_held {
                rises.push(strobe + timing.strobe_to_hit);
            }
        });
        let falls = (0..=cycles).map(|cycle| exposure.stop(cycle) + timing.stop_to_start_falls);
        let falls: Vec<Time> = falls.collect();
        let last = |times: &[Time], now| {
            times[..times.partition_point(|&time| time <= now)]
                .last()
                .copied()
        };
        let mut pulses = pulses.into_iter().peekable();
        let mut front_end = front_end::FrontEndModel::new(config, timing);
        let mut metdc = metdc_counter::MetdcCounterModel::new(config.bins);
        for edge in 0..=cycles * i64::from(exposure.stop_periods) + 1 {
            let rise = exposure.rising(edge);
            if let Some(bin) = metdc.selected() {
                hits[bin] += u64::from(front_end.spad_timed().count_ones());
            }
            metdc.clock(last(&rises, rise) > last(&falls, rise));
            while let Some((time, spad)) =
                pulses.next_if(|(t, _)| *t + timing.spad_to_sampled <= rise)
            {
                front_end.pulse(time, spad);
            }
            front_end.clock();
        }
    }

    /// Runs the exposure; `strobe` is told the time of every strobe (LOCAL_STOP's rise in the guided
    /// mode) and the HIT bits that rise with it.
    pub fn run(
        &self,
        start: u16,
        pulses: impl IntoIterator<Item = (Time, u8)>,
        mut strobe: impl FnMut(Time, u64),
    ) {
        let (config, exposure, timing) = (self.config, self.exposure, &self.timing);
        let periods = exposure.stop_periods as i64;
        let cycles = exposure.laser_cycles as i64;
        let guided = config.mode == Mode::Guided;
        let has_memory = config.p_counter.row().has_memory;
        let mut pulses = pulses.into_iter().peekable();
        let mut counter = p_counter::PCounterModel::new(config, start);
        let mut front_end = front_end::FrontEndModel::new(config, timing);
        let mut metdc = metdc::MetdcModel::new(config.bins as u32);
        let mut hit = Hit::new(self);
        let mut pending: VecDeque<Strobe> = VecDeque::new();
        let by_local_stop = |local_stop, deadline| Strobe {
            cause: local_stop,
            arrival: local_stop + timing.local_stop_to_strobe,
            deadline,
        };
        let by_reset = |stop| {
            let reset_to_local_stop = timing.counter.reset_to_local_stop;
            let delay = reset_to_local_stop.expect("no other counter rises at its reset");
            by_local_stop(stop + timing.stop_to_reset + delay, Time::MAX)
        };
        // STOP edge number `cycle` is the next whose reset has not been released yet.
        let mut cycle = 0;
        let mut stop = exposure.stop(0);
        let mut ticks = exposure.clock.ticks(0).map(|t| t - exposure.stop_phase);

        for edge in 0..=cycles * periods {
            let (fall, rise) = (
                ticks.next().expect("endless"),
                ticks.next().expect("endless"),
            );
            if guided {
                let counter_clk = fall + timing.clk_to_counter_clk;
                while cycle <= cycles && stop + timing.stop_to_reset_release <= counter_clk {
                    if counter.reset() {
                        pending.push_back(by_reset(stop));
                    }
                    cycle += 1;
                    stop = exposure.stop(cycle);
                }
                let counts = if has_memory {
                    cycle > 0 && cycle <= cycles && stop + timing.stop_to_reset >= counter_clk
                } else {
                    rise > timing.stop_to_enabled && edge < cycles * periods
                };
                if counts && counter.clock() {
                    let local_stop = counter_clk + self.local_stop.of_start(start);
                    // The next reset takes back what still ripples.
                    let deadline = if has_memory {
                        stop + timing.stop_to_hit_reset - timing.strobe_to_hit
                    } else {
                        Time::MAX
                    };
                    pending.push_back(by_local_stop(local_stop, deadline));
                }
            } else if edge % periods == 0 {
                let stop = exposure.stop(edge / periods);
                pending.push_back(Strobe {
                    cause: stop,
                    arrival: stop + timing.stop_to_strobe,
                    deadline: Time::MAX,
                });
            }

            // A strobe that comes before the shift register changes sees it as it was.
            while let Some(&s) = pending.front()
                && s.arrival < rise + timing.clk_to_shift
            {
                hit.latch(s, metdc.hits(), &mut strobe);
                pending.pop_front();
            }
            let timed = front_end.spad_timed();
            metdc.clock(correlation::model(
                timed,
                config.event_type,
                config.threshold,
            ));
            while let Some((time, spad)) =
                pulses.next_if(|(t, _)| *t + timing.spad_to_sampled <= rise)
            {
                front_end.pulse(time, spad);
            }
            front_end.clock();
        }
        if guided && cycle <= cycles && counter.reset() {
            pending.push_back(by_reset(stop));
        }
        for s in pending {
            hit.latch(s, metdc.hits(), &mut strobe);
        }
    }
}

/// A strobe on its way to the HIT flip-flops.
#[derive(Debug, Clone, Copy)]
struct Strobe {
    /// When LOCAL_STOP (or STOP) rose.
    cause: Time,
    /// When it clocks HIT.
    arrival: Time,
    /// The last arrival that a reset of the P-counter does not forestall.
    deadline: Time,
}

/// The HIT flip-flops, which a laser cycle's first strobe finds at zero and a second one does not.
struct Hit<'m> {
    model: &'m MacropixelModel<'m>,
    held: u64,
    /// STOP edge whose reset of HIT comes next.
    next_stop: i64,
}

impl<'m> Hit<'m> {
    fn new(model: &'m MacropixelModel<'m>) -> Self {
        Hit {
            model,
            held: 0,
            next_stop: 0,
        }
    }

    /// Latches `hits`, unless HIT is in reset, and tells `strobe` which bits rise.
    fn latch(&mut self, s: Strobe, hits: u64, strobe: &mut impl FnMut(Time, u64)) {
        let MacropixelModel {
            config,
            exposure,
            timing,
            ..
        } = self.model;
        if config.mode == Mode::Conventional {
            // NOT STOP has cleared HIT.
            strobe(s.cause, hits);
            return;
        }
        if s.arrival > s.deadline {
            return;
        }
        let cycles = i64::from(exposure.laser_cycles);
        let resets_at = |stop| exposure.stop(stop) + timing.stop_to_hit_reset;
        while self.next_stop <= cycles && resets_at(self.next_stop) <= s.arrival {
            self.next_stop += 1;
            self.held = 0;
        }
        let last_release = exposure.stop(self.next_stop - 1) + timing.stop_to_hit_release;
        if self.next_stop == 0 || self.next_stop > cycles || s.arrival < last_release {
            strobe(s.cause, 0);
        } else if s.arrival <= resets_at(self.next_stop) - timing.strobe_to_hit {
            strobe(s.cause, hits & !self.held);
            self.held = hits;
        }
    }
}
