//! From photon time to bin and back: the edges of every bin of a window, exact to the femtosecond.
//!
//! ```text
//!   rising CLK edges    e−1          e           e+1
//!                        │           │            │
//!   photon times   ─────╎───────────╎────────────╎─────      earlier by the front end's latency
//!                  edges(…)[b]   edges(…)[b+1]                bin b: [edges[b], edges[b + 1])
//! ```
//!
//! A pulse is taken by the first rising CLK edge at or after its toggle flip-flop has changed. Edges are given for each
//! laser cycle, because CLK edges are rounded to whole femtoseconds; nobody who asks for them needs to know that bins
//! are a CLK period long, nor that they are equal: those of [`WindowLaw::with_taps`] are neither. Engines that bin many photons
//! at once have copies of [`WindowLaw::edge_of`], held to it by tests, and use them only where [`WindowLaw::has_clk_bins`].

use std::ops::Range;

use super::bins::Bins;
use super::config::{Mode, Tdc};
use super::window_law::{OpenWindow, WindowLaw};
use crate::units::Time;

/// The edges of a window's bins in one laser cycle: the time axis of its histogram.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BinEdges(Vec<Time>);

impl BinEdges {
    /// Of rising times, at least two: bin b lies between edges b and b + 1.
    pub(crate) fn new(edges: Vec<Time>) -> Self {
        debug_assert!(edges.len() > 1 && edges.is_sorted(), "bins have widths");
        BinEdges(edges)
    }

    /// How many bins.
    pub(crate) fn bins(&self) -> usize {
        self.0.len() - 1
    }

    /// The edges, one more than there are bins.
    pub fn edges(&self) -> &[Time] {
        &self.0
    }

    /// From the first edge to the last.
    pub(crate) fn span(&self) -> Range<Time> {
        self.0[0]..self.0[self.bins()]
    }

    /// Photon times of a bin, half open.
    pub fn bin(&self, bin: usize) -> Range<Time> {
        self.0[bin]..self.0[bin + 1]
    }

    /// Length of a bin.
    pub fn width(&self, bin: usize) -> Time {
        self.0[bin + 1] - self.0[bin]
    }

    /// Length of a bin on average, s.
    pub fn mean_width_s(&self) -> f64 {
        (self.span().end - self.span().start).as_s() / self.bins() as f64
    }

    /// The bin that a photon at `time` comes into.
    pub fn bin_of(&self, time: Time) -> Option<usize> {
        let edges_passed = self.0.partition_point(|&edge| edge <= time);
        (1..=self.bins())
            .contains(&edges_passed)
            .then(|| edges_passed - 1)
    }

    /// Photon time of a position: bin b reaches from b − ½ to b + ½, evenly. Before the first bin and after the last one
    /// they go on.
    pub(crate) fn time_of(&self, position_bins: f64) -> Time {
        let from_first_edge = position_bins + 0.5;
        let bin = (from_first_edge.floor().max(0.0) as usize).min(self.bins() - 1);
        let within = from_first_edge - bin as f64;
        let width_fs = self.width(bin).as_fs() as f64;
        self.0[bin] + Time::from_fs((within * width_fs).round() as i64)
    }
}

impl WindowLaw {
    /// The same law with bins that end at the taps of delay lines, which start values take in turn: one line for all of them,
    /// or two where odd and even windows have a line each. Taps are times after the window opens where bins of CLK
    /// periods would, rising, one more than there are bins. They need not be equal, nor fill those periods, so that windows may
    /// overlap.
    ///
    /// # Panics
    /// When there is no line, or one has not one more tap than the sensor has bins.
    #[must_use]
    pub fn with_taps(self, lines: &[Vec<Time>]) -> Self {
        assert!(!lines.is_empty(), "taps of a delay line");
        for taps in lines {
            assert_eq!(taps.len() as i64, self.bins + 1, "taps of a delay line");
            debug_assert!(taps.is_sorted(), "a delay line delays");
        }
        WindowLaw {
            edges: Bins::Taps(lines.into()),
            ..self
        }
    }

    /// Whether bins are the photons of one CLK edge each, so that [`WindowLaw::edge_of`] tells them.
    pub fn has_clk_bins(&self) -> bool {
        matches!(self.edges, Bins::Clk)
    }

    /// Length of a bin where all of all windows are equal, s; taps are equal to within their rounding to a femtosecond.
    pub fn bin_width_s(&self) -> Option<f64> {
        let lines = match &self.edges {
            Bins::Clk => return Some(self.period_fs * 1e-15),
            Bins::Taps(lines) => lines,
        };
        let widths = |taps: &[Time]| (taps[1] - taps[0]).as_fs();
        let widths_fs = lines.iter().flat_map(|taps| taps.windows(2).map(widths));
        let is_equal = widths_fs.clone().max()? - widths_fs.min()? <= 1;
        let span = lines[0][self.bins as usize] - lines[0][0];
        is_equal.then(|| span.as_s() / self.bins as f64)
    }

    /// Photon times at which the bins of `window` begin in laser cycle `cycle`, from the exposure's first STOP edge, and when
    /// the last one ends.
    pub fn edges(&self, window: &OpenWindow, cycle: i64) -> BinEdges {
        BinEdges::new(
            (0..=self.bins)
                .map(|n| self.edge(window, cycle, n))
                .collect(),
        )
    }

    /// Where bin `number` begins, or where the last one ends.
    pub(super) fn edge(&self, window: &OpenWindow, cycle: i64, number: i64) -> Time {
        let first = self.first_edge(window, cycle);
        match &self.edges {
            Bins::Clk => self.taken_until(first - 1 + number),
            Bins::Taps(lines) => {
                let taps = &lines[usize::from(window.start) % lines.len()];
                let origin = match self.sensor.tdc {
                    Tdc::Clocked | Tdc::Counter => self.taken_until(first - 1),
                    Tdc::DelayLine => self.frozen_until(window, cycle),
                };
                origin + taps[number as usize]
            }
        }
    }

    /// Until when a pulse has left its edge on PHOTONS when the delay lines are frozen in laser cycle `cycle`.
    fn frozen_until(&self, window: &OpenWindow, cycle: i64) -> Time {
        let (exposure, timing) = (&self.exposure, &self.timing);
        let sampled = match self.sensor.mode {
            Mode::Guided => {
                let edge = window.count_edge + cycle * i64::from(exposure.stop_periods);
                exposure.falling(edge) + self.ripple(window.start) + timing.local_stop_to_sample
            }
            Mode::Conventional => exposure.stop(cycle + 1) + timing.stop_to_sample,
        };
        sampled - self.latency + Time::from_fs(1)
    }

    /// The rising CLK edge, counted from the exposure's first STOP edge, that opens the window in laser cycle `cycle`.
    fn first_edge(&self, window: &OpenWindow, cycle: i64) -> i64 {
        cycle * i64::from(self.exposure.stop_periods) + window.first_edge
    }

    /// The rising CLK edge that takes a SPAD pulse at `pulse` after the exposure's first STOP edge: the first one at or
    /// after the pulse has toggled its flip-flop.
    #[inline]
    pub fn edge_of(&self, pulse: Time) -> i64 {
        let sampled = pulse + self.latency;
        let periods = (sampled + self.exposure.stop_phase).as_fs() as f64 / self.period_fs - 0.5;
        let edge = periods.ceil();
        // Exact arithmetic only where rounding could decide.
        if (edge - periods - 0.5).abs() < 0.499 {
            return edge as i64;
        }
        self.exposure.rising_until(sampled - Time::from_fs(1)) + 1
    }

    /// The bin of `window` in laser cycle `cycle` that a photon at `pulse` after the exposure's first STOP edge comes into.
    pub(crate) fn bin_of(&self, window: &OpenWindow, cycle: i64, pulse: Time) -> Option<usize> {
        match &self.edges {
            Bins::Clk => {
                let bin = self.edge_of(pulse) - self.first_edge(window, cycle);
                (0..self.bins).contains(&bin).then_some(bin as usize)
            }
            Bins::Taps(_) => self.edges(window, cycle).bin_of(pulse),
        }
    }

    /// Bins that take the photons of a rising CLK edge, counted from the exposure's first STOP edge, the latest laser cycle
    /// first: more than one only where a laser cycle is shorter than the window. For bins of CLK periods.
    #[inline]
    pub(crate) fn bins_of_edge(
        &self,
        window: &OpenWindow,
        edge: i64,
    ) -> impl Iterator<Item = usize> + use<> {
        debug_assert!(self.has_clk_bins());
        let (cycles, periods) = (self.latched_cycles(), i64::from(self.exposure.stop_periods));
        let (offset, bins) = (edge - window.first_edge, self.bins);
        let last = offset.div_euclid(periods).min(cycles.end - 1);
        let offsets = (cycles.start..=last).rev();
        let offsets = offsets.map(move |cycle| offset - cycle * periods);
        offsets
            .take_while(move |&bin| bin < bins)
            .map(|bin| bin as usize)
    }

    /// Photon times that `bin` of `window` collects in laser cycle `cycle`, half open, from the exposure's
    /// first STOP edge.
    pub fn bin_interval(&self, window: &OpenWindow, cycle: i64, bin: i64) -> Range<Time> {
        self.edge(window, cycle, bin)..self.edge(window, cycle, bin + 1)
    }

    /// Until when a rising CLK edge takes pulses.
    pub(super) fn taken_until(&self, edge: i64) -> Time {
        self.exposure.rising(edge) - self.latency + Time::from_fs(1)
    }

    /// How long before the exposure's first STOP edge the pulses begin that are taken together with one at that edge.
    pub(crate) fn lead(&self) -> Time {
        Time::ZERO - self.taken_until(self.edge_of(Time::ZERO) - 1)
    }

    /// Photon times that the whole window collects in laser cycle `cycle`, from the exposure's first STOP edge.
    pub(crate) fn interval_in(&self, window: &OpenWindow, cycle: i64) -> Range<Time> {
        self.edge(window, cycle, 0)..self.edge(window, cycle, self.bins)
    }

    /// Photon times that the whole window collects, relative to its laser cycle's STOP edge.
    pub fn interval(&self, window: &OpenWindow) -> Range<Time> {
        self.interval_in(window, 0)
    }

    /// Photon time of a position in the histogram (bin b's centre is b), relative to STOP.
    pub fn time_of(&self, window: &OpenWindow, position_bins: f64) -> Time {
        self.edges(window, 0).time_of(position_bins)
    }

    /// The start value whose window is centred nearest to photon time `time` after STOP, or `None` where no
    /// start value opens a window that contains it.
    pub fn start_for(&self, time: Time) -> Option<u16> {
        let distance = |start: u16| {
            let interval = self.interval(&self.window(start).open()?);
            let centre = Time::from_fs((interval.start.as_fs() + interval.end.as_fs()) / 2);
            Some((centre - time).as_fs().abs())
        };
        // Start values count steps of CLK periods, whatever bins are.
        let step_s = self.sensor.step_periods as f64 / self.exposure.clock.as_hz();
        let opens = |start| Some((start, self.window(start).open()?));
        let (sample, window) = self.samples().find_map(opens)?;
        let centre = self.interval(&window);
        let centre_s = (centre.start.as_s() + centre.end.as_s()) / 2.0;
        let guess = sample as f64 + ((time.as_s() - centre_s) / step_s).round();
        let largest = self.sensor.largest_start();
        let guess = guess.clamp(0.0, largest as f64) as u16;
        // Windows beside the guess suffice where they open, and those by which start values' ripples may differ. Where some do not open,
        // as at the laser cycle's end, any that contains the time may be the best.
        let within =
            |reach: u16| guess.saturating_sub(reach)..=(guess.saturating_add(reach)).min(largest);
        let near = 1 + self.ripple_spread_periods();
        let beside = within(near).map(|start| Some((distance(start)?, start)));
        let best = match beside.collect::<Option<Vec<_>>>() {
            Some(beside) => beside.into_iter().min()?.1,
            None => {
                let half_s = (centre.end - centre.start).as_s() / 2.0;
                let reach = (half_s / step_s).ceil() as u16 + near;
                let opening = within(reach).filter_map(|start| Some((distance(start)?, start)));
                opening.min()?.1
            }
        };
        let window = self.window(best).open()?;
        self.interval(&window).contains(&time).then_some(best)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::{Exposure, SensorConfig};
    use proptest::prelude::*;

    /// Bins of any widths, femtoseconds to some CLK periods.
    fn taps(bins: usize) -> impl Strategy<Value = Vec<Time>> {
        let width = prop_oneof![1 => 1i64..20, 8 => 10_000i64..4_000_000];
        (0i64..3_000_000, prop::collection::vec(width, bins)).prop_map(|(first, widths)| {
            let mut at = first;
            let ends = widths.iter().map(|width| {
                at += width;
                at
            });
            let ends: Vec<i64> = ends.collect();
            std::iter::once(first)
                .chain(ends)
                .map(Time::from_fs)
                .collect()
        })
    }

    fn law(config: &SensorConfig, exposure: &Exposure, taps: Option<Vec<Time>>) -> WindowLaw {
        let law = WindowLaw::new(config, exposure);
        match taps {
            Some(taps) => law.with_taps(&[taps]),
            None => law,
        }
    }

    proptest! {
        /// Edges are where the bin of a photon changes: the last femtosecond before one belongs to the bin before it.
        #[test]
        fn a_photon_is_in_the_bin_between_whose_edges_it_comes(
            clk_mhz in 50f64..400.0,
            start in 0u16..512,
            cycle in 0i64..42,
            phase in -0.9f64..0.9,
            within in 0f64..1.0,
            taps in prop::option::of(taps(16)),
        ) {
            let config = SensorConfig {
                clk_hz: clk_mhz * 1e6,
                stop_phase_ps: phase * 0.5e6 / clk_mhz,
                ..SensorConfig::default()
            };
            let exposure = Exposure::new(&config, 600, 40);
            let law = law(&config, &exposure, taps);
            let Some(window) = law.window(start).open() else {
                return Ok(());
            };
            let edges = law.edges(&window, cycle);
            prop_assert_eq!(edges.bins(), config.bins);
            for (number, &edge) in edges.edges().iter().enumerate() {
                let after = Some(number).filter(|&bin| bin < config.bins);
                let before = number.checked_sub(1);
                let earlier = |bin: usize| 1 + ((edges.width(bin).as_fs() - 1) as f64 * within) as i64;
                let inside = before.map_or(edge, |bin| edge - Time::from_fs(earlier(bin)));
                let is_in = if before.is_some() { before } else { after };
                for (time, bin) in [(edge, after), (edge - Time::from_fs(1), before), (inside, is_in)] {
                    prop_assert_eq!(edges.bin_of(time), bin);
                    prop_assert_eq!(law.bin_of(&window, cycle, time), bin);
                    if law.has_clk_bins() {
                        let bins: Vec<usize> = law.bins_of_edge(&window, law.edge_of(time)).collect();
                        prop_assert_eq!(bins, Vec::from_iter(bin.filter(|_| cycle < 40)));
                    }
                }
            }
            let (lead, at_stop) = (Time::ZERO - law.lead(), law.edge_of(Time::ZERO));
            prop_assert_eq!(law.edge_of(lead), at_stop);
            prop_assert_eq!(law.edge_of(lead - Time::from_fs(1)), at_stop - 1);
            for bin in 0..config.bins {
                prop_assert_eq!(law.bin_interval(&window, cycle, bin as i64), edges.bin(bin));
            }
            prop_assert_eq!(law.interval_in(&window, cycle), edges.span());
            prop_assert_eq!(law.time_of(&window, 2.0), law.edges(&window, 0).time_of(2.0));
        }

        /// A clock's periods and a law's own sums are rounded to a femtosecond each.
        #[test]
        fn the_window_of_every_laser_cycle_comes_a_laser_cycle_later(
            start in 20u16..300,
            cycle in 1i64..40,
            phase in -0.9f64..0.9,
            tdc in prop::sample::select(vec![Tdc::Clocked, Tdc::DelayLine]),
            mode in prop::sample::select(vec![Mode::Guided, Mode::Conventional]),
            taps in prop::option::of(taps(16)),
        ) {
            let period_ps = 1e6 / 384.0;
            let config = SensorConfig { stop_phase_ps: phase * 0.5 * period_ps, tdc, mode, ..SensorConfig::default() };
            let exposure = Exposure::new(&config, 600, 40);
            let law = law(&config, &exposure, taps);
            let Some(window) = law.window(start).open() else {
                return Ok(());
            };
            let (first, later) = (law.edges(&window, 0), law.edges(&window, cycle));
            prop_assert_eq!(first.width(3), first.bin(3).end - first.bin(3).start);
            let sum_s: f64 = (0..first.bins()).map(|bin| first.width(bin).as_s()).sum();
            prop_assert!((first.mean_width_s() * first.bins() as f64 / sum_s - 1.0).abs() < 1e-12);
            for (first, later) in first.edges().iter().zip(later.edges()) {
                let off = *later - *first - exposure.stop(cycle);
                prop_assert!(off.as_fs().abs() <= 2, "{off}");
            }
        }

        #[test]
        fn taps_of_a_clk_period_each_divide_a_window_as_clk_does(
            clk_mhz in 50f64..400.0, start in 0u16..512, cycle in 0i64..40,
        ) {
            let config = SensorConfig { clk_hz: clk_mhz * 1e6, ..SensorConfig::default() };
            let exposure = Exposure::new(&config, 600, 40);
            let periods = (0..=16).map(|n| config.clock().periods(n));
            let [of_clk, of_taps] = [None, Some(periods.collect())].map(|taps| law(&config, &exposure, taps));
            let Some(window) = of_clk.window(start).open() else {
                return Ok(());
            };
            let [of_clk, of_taps] = [of_clk, of_taps].map(|law| law.edges(&window, cycle));
            for (of_clk, of_taps) in of_clk.edges().iter().zip(of_taps.edges()) {
                prop_assert!((*of_clk - *of_taps).as_fs().abs() <= 1, "{of_clk} {of_taps}");
            }
        }

        #[test]
        fn bins_have_one_length_where_no_two_differ(
            first_fs in 0i64..3_000_000, width_fs in 1_000i64..4_000_000, longer_fs in 2i64..1000, which in 0usize..16,
        ) {
            let line = |extra_fs: i64| -> Vec<Time> {
                let after = |n: usize| if n > which { extra_fs } else { 0 };
                (0..=16).map(|n| Time::from_fs(first_fs + n as i64 * width_fs + after(n))).collect()
            };
            let config = SensorConfig::default();
            let of_clk = || WindowLaw::new(&config, &Exposure::new(&config, 520, 1));
            prop_assert_eq!(of_clk().bin_width_s(), Some(1.0 / config.clk_hz));
            let of_taps = of_clk().with_taps(&[line(0), line(1)]);
            prop_assert_eq!((of_clk().has_clk_bins(), of_taps.has_clk_bins()), (true, false));
            let width_s = of_taps.bin_width_s();
            prop_assert!(width_s.is_some_and(|s| (s / (width_fs as f64 * 1e-15) - 1.0).abs() < 1e-12));
            prop_assert_eq!(of_clk().with_taps(&[line(longer_fs)]).bin_width_s(), None);
            prop_assert_eq!(of_clk().with_taps(&[line(0), line(longer_fs)]).bin_width_s(), None);
        }

        #[test]
        fn the_time_of_a_position_lies_in_its_bin(taps in taps(12), position in -3f64..15.0) {
            // Bins of picoseconds: in one of a femtosecond no time is at its centre.
            let edges = BinEdges::new(taps.into_iter().map(|tap| tap * 1000).collect());
            for bin in 0..12 {
                prop_assert_eq!(edges.time_of(bin as f64 - 0.5), edges.bin(bin).start);
                let centre = (edges.bin(bin).start.as_fs() + edges.bin(bin).end.as_fs()) as f64 / 2.0;
                prop_assert!((edges.time_of(bin as f64).as_fs() as f64 - centre).abs() <= 0.5);
            }
            let time = edges.time_of(position);
            if let Some(bin) = edges.bin_of(time) {
                let a_femtosecond = 1.0 / edges.width(bin).as_fs() as f64;
                prop_assert!((bin as f64 - position).abs() <= 0.5 + a_femtosecond);
            }
        }
    }
}
