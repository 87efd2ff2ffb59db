//! Mean photons on one SPAD in any stretch of time, relative to the STOP edge of some laser cycle.
//!
//! The light is that of the photon stream: background and dark counts, constant or by a profile of the laser cycle, and
//! Gaussian echoes of every laser cycle by the [law of echoes](EchoLaw). What of it exists, and of which segment, depends on
//! where in the exposure the laser cycle is: [`Extent`].

use std::ops::Range;
use std::sync::Arc;

use smallvec::{SmallVec, smallvec};

use super::FEW_STEPS;
use crate::photon::{
    ECHO_REACH, Echo, EchoLaw, PixelLight, Profile, StreamConfig, pulse_share, pulse_shares,
};

/// Mean photons below which [`absorbed_dim`] holds.
pub(super) const DIM: f64 = 0.015;

/// Probability of a photon where `mean` are expected.
pub(super) fn absorbed(mean: f64) -> f64 {
    if mean < DIM {
        absorbed_dim(mean)
    } else {
        -libm::expm1(-mean)
    }
}

/// As [`absorbed`], for means below [`DIM`]: seven terms of the series are all there is to it.
#[inline(always)]
pub(super) fn absorbed_dim(mean: f64) -> f64 {
    const PARTS: [f64; 6] = [
        1.0 / 7.0,
        1.0 / 6.0,
        1.0 / 5.0,
        1.0 / 4.0,
        1.0 / 3.0,
        1.0 / 2.0,
    ];
    let series = PARTS
        .iter()
        .fold(1.0, |series, part| 1.0 - mean * part * series);
    mean * series
}

/// What exists of an exposure's light, seen from one of its laser cycles.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Extent {
    /// Number of the laser cycle, which tells the segment of the light.
    pub cycle: i64,
    /// The exposure, fs after the STOP edge of the laser cycle.
    pub lit_fs: Range<f64>,
    /// Laser cycles that send an echo, counted from this one.
    pub echoes: Range<i64>,
}

impl Extent {
    /// An exposure without beginning and end, but for the echoes it has, in the light of its first segment.
    pub(super) fn of_echoes(echoes: Range<i64>) -> Self {
        Extent {
            cycle: 0,
            lit_fs: f64::NEG_INFINITY..f64::INFINITY,
            echoes,
        }
    }
}

/// Light on one SPAD of a macropixel. Times in femtoseconds.
#[derive(Debug, Clone)]
pub(super) struct SpadLight {
    /// SPADs that share it.
    spads: f64,
    cycle_fs: f64,
    /// In their order; the first one also stands for all before it.
    segments: SmallVec<[SpadSegment; 1]>,
}

/// Light from a laser cycle on.
#[derive(Debug, Clone)]
struct SpadSegment {
    first_cycle: i64,
    background_per_fs: f64,
    /// Of all SPADs.
    profile: Option<Arc<Profile>>,
    echoes: SmallVec<[SpadEcho; 1]>,
}

/// One echo of each laser cycle.
#[derive(Debug, Clone, Copy)]
pub(super) struct SpadEcho {
    law: EchoLaw,
    photons: f64,
}

impl SpadEcho {
    /// Where that of laser cycle `number` is to be found.
    fn stretch_fs(&self, number: i64) -> Range<f64> {
        let centre_fs = self.law.centre_fs(number);
        let reach_fs = ECHO_REACH * self.law.sigma_fs;
        centre_fs - reach_fs..centre_fs + reach_fs + 1.0
    }

    /// Centre of that of laser cycle `number`.
    pub(super) fn centre_fs(&self, number: i64) -> f64 {
        self.law.centre_fs(number)
    }

    /// Its standard deviation.
    pub(super) fn sigma_fs(&self) -> f64 {
        self.law.sigma_fs
    }

    fn reaching(&self, stretch_fs: &Range<f64>) -> Range<i64> {
        // A pulse without width is somewhere within a femtosecond.
        self.law.reaching(stretch_fs.start - 1.0, stretch_fs.end)
    }
}

impl SpadLight {
    /// A SPAD's share of `light`.
    pub(super) fn new(config: &StreamConfig, light: &PixelLight) -> Self {
        let (cycle_fs, spads) = (config.cycle_s() * 1e15, config.spads.grid.spads() as f64);
        let echo = |echo: &Echo| SpadEcho {
            law: EchoLaw {
                cycle_fs,
                arrival_fs: echo.arrival.as_fs() as f64,
                sigma_fs: echo.sigma.unwrap_or(config.pulse_sigma).as_fs() as f64,
            },
            photons: echo.photons / spads,
        };
        let segments = light.segments().map(|segment| SpadSegment {
            first_cycle: i64::from(segment.first_cycle),
            background_per_fs: segment.background_hz * 1e-15 / spads,
            profile: segment.profile.clone(),
            echoes: segment.echoes().map(echo).collect(),
        });
        SpadLight {
            spads,
            segments: segments.collect(),
            cycle_fs,
        }
    }

    /// Whether all laser cycles have the same light, with constant background.
    pub(super) fn is_steady(&self) -> bool {
        self.segments.len() == 1 && self.segments[0].profile.is_none()
    }

    /// Until when there is nothing but constant background, where these laser cycles send echoes: no later than `until_fs`.
    pub(super) fn steady_until(&self, sent: Range<i64>, until_fs: f64) -> f64 {
        if !self.is_steady() {
            return f64::NEG_INFINITY;
        }
        let echoes = sent.take(1).flat_map(|number| {
            let echoes = self.segments[0].echoes.iter();
            echoes.map(move |echo| echo.stretch_fs(number).start)
        });
        echoes.reduce(f64::min).unwrap_or(until_fs)
    }

    /// Laser cycles in which the light changes.
    pub(super) fn changes(&self) -> impl Iterator<Item = i64> {
        self.segments[1..].iter().map(|segment| segment.first_cycle)
    }

    /// The light of a laser cycle.
    fn segment(&self, cycle: i64) -> &SpadSegment {
        let later = self.segments[1..].partition_point(|segment| segment.first_cycle <= cycle);
        &self.segments[later]
    }

    /// Mean photons in `duration_fs` of the constant background with which the exposure begins.
    pub(super) fn background(&self, duration_fs: f64) -> f64 {
        self.segments[0].background_per_fs * duration_fs
    }

    /// Most background photons that `duration_fs` have on average.
    pub(super) fn most_background(&self, duration_fs: f64) -> f64 {
        let background = |segment: &SpadSegment| {
            let profile = segment.profile.as_ref();
            let greatest_hz = profile.map_or(0.0, |profile| profile.greatest_hz);
            segment.background_per_fs + greatest_hz * 1e-15 / self.spads
        };
        self.segments.iter().map(background).fold(0.0, f64::max) * duration_fs
    }

    /// An upper bound on the mean photons in a stretch that begins at `from_fs` of any laser cycle: what all laser
    /// cycles of an endless exposure send into it, each in its brightest segment.
    pub(super) fn most(&self, from_fs: f64, duration_fs: f64) -> f64 {
        let until_fs = from_fs + duration_fs;
        let numbers = self.echoes_in(from_fs..until_fs);
        if self.is_steady() {
            let endless = Extent::of_echoes(numbers);
            return self.steps(from_fs, duration_fs, 1, &endless)[0];
        }
        let photons = |segment: &SpadSegment, number: i64| -> f64 {
            let shares = segment.echoes.iter().map(|echo| {
                let centre_fs = echo.centre_fs(number);
                let (from, until) = (from_fs - centre_fs, until_fs - centre_fs);
                echo.photons * pulse_share(from, until, echo.sigma_fs())
            });
            shares.sum()
        };
        let most = |number: i64| {
            let each = self.segments.iter().map(|segment| photons(segment, number));
            each.fold(0.0, f64::max)
        };
        self.most_background(duration_fs) + numbers.map(most).sum::<f64>()
    }

    /// Laser cycles whose echoes may reach into a stretch of time, whatever their segment.
    pub(super) fn echoes_in(&self, stretch_fs: Range<f64>) -> Range<i64> {
        let echoes = self.segments.iter().flat_map(|segment| &segment.echoes);
        let reaching = echoes.map(|echo| echo.reaching(&stretch_fs));
        let all = reaching.filter(|numbers| !numbers.is_empty());
        let hull = |a: Range<i64>, b: Range<i64>| a.start.min(b.start)..a.end.max(b.end);
        all.reduce(hull).unwrap_or(0..0)
    }

    /// Echoes that are sent and reach into a stretch of time, with their laser cycles.
    pub(super) fn sent(
        &self,
        stretch_fs: Range<f64>,
        extent: &Extent,
    ) -> impl Iterator<Item = (i64, &SpadEcho)> {
        let cycle = extent.cycle;
        let reaching = self.echoes_in(stretch_fs.clone());
        let numbers = reaching.start.max(extent.echoes.start)..reaching.end.min(extent.echoes.end);
        numbers.flat_map(move |number| {
            let stretch_fs = stretch_fs.clone();
            let echoes = self.segment(cycle + number).echoes.iter();
            let echoes = echoes.filter(move |echo| echo.reaching(&stretch_fs).contains(&number));
            echoes.map(move |echo| (number, echo))
        })
    }

    /// The smallest standard deviation of an echo that may reach into a stretch of time, `None` if none does; 0 in light that
    /// changes abruptly.
    pub(super) fn finest_fs(&self, stretch_fs: Range<f64>) -> Option<f64> {
        if !self.is_steady() {
            return Some(0.0);
        }
        let reaching = |echo: &&SpadEcho| !echo.reaching(&stretch_fs).is_empty();
        let echoes = self.segments[0].echoes.iter().filter(reaching);
        echoes.map(SpadEcho::sigma_fs).reduce(f64::min)
    }

    /// When background changes abruptly, from one time until another one.
    pub(super) fn bends_fs(&self, stretch_fs: Range<f64>, extent: &Extent) -> Vec<f64> {
        if self.is_steady() {
            return Vec::new();
        }
        let cycles = self.cycles_in(&stretch_fs);
        let of_cycle = |number: i64| {
            let start_fs = number as f64 * self.cycle_fs;
            let profile = self.segment(extent.cycle + number).profile.as_ref();
            let edges_fs = profile.map_or(&[][..], |profile| &profile.edges_fs);
            let edges_fs = edges_fs.iter().map(|&edge_fs| edge_fs as f64);
            let within = edges_fs.filter(|edge_fs| *edge_fs < self.cycle_fs);
            let bends = std::iter::once(0.0).chain(within);
            bends
                .map(move |bend_fs| start_fs + bend_fs)
                .collect::<Vec<_>>()
        };
        cycles.flat_map(of_cycle).collect()
    }

    /// Laser cycles that a stretch of time touches.
    fn cycles_in(&self, stretch_fs: &Range<f64>) -> Range<i64> {
        let number = |time_fs: f64| (time_fs / self.cycle_fs).floor() as i64;
        number(stretch_fs.start)..number(stretch_fs.end) + 1
    }

    /// Mean background photons from one time until another one, within the exposure.
    fn background_between(&self, from_fs: f64, until_fs: f64, extent: &Extent) -> f64 {
        if self.is_steady() {
            return self.background(until_fs - from_fs);
        }
        let in_cycle = |number: i64| {
            let start_fs = number as f64 * self.cycle_fs;
            let (from_fs, until_fs) = (
                (from_fs - start_fs).max(0.0),
                (until_fs - start_fs).min(self.cycle_fs),
            );
            let segment = self.segment(extent.cycle + number);
            let profile = segment.profile.as_ref();
            let more = profile.map_or(0.0, |profile| profile.photons(from_fs, until_fs));
            let lit_fs = (until_fs - from_fs).max(0.0);
            segment.background_per_fs * lit_fs + more / self.spads
        };
        self.cycles_in(&(from_fs..until_fs)).map(in_cycle).sum()
    }

    /// Mean photons in `count` successive steps of `step_fs` from `from_fs` on.
    pub(super) fn steps(
        &self,
        from_fs: f64,
        step_fs: f64,
        count: usize,
        extent: &Extent,
    ) -> SmallVec<[f64; FEW_STEPS]> {
        let edge = |i: usize| from_fs + step_fs * i as f64;
        let lit_fs = &extent.lit_fs;
        let mut means: SmallVec<_> = smallvec![self.background(step_fs); count];
        let is_steady = self.is_steady();
        if lit_fs.start > from_fs || lit_fs.end < edge(count) || !is_steady {
            for (i, mean) in means.iter_mut().enumerate() {
                let from = edge(i).max(lit_fs.start);
                let until = edge(i + 1).min(lit_fs.end).max(from);
                *mean = if is_steady {
                    self.background(until - from)
                } else {
                    self.background_between(from, until, extent)
                };
            }
        }
        for (number, echo) in self.sent(from_fs..edge(count), extent) {
            let stretch_fs = echo.stretch_fs(number);
            let from = ((stretch_fs.start - from_fs) / step_fs).floor().max(0.0) as usize;
            let to = ((stretch_fs.end - from_fs) / step_fs).ceil();
            let to = to.clamp(0.0, count as f64) as usize;
            echo.add(
                number,
                |i| edge(from + i),
                extent,
                &mut means[from.min(to)..to],
            );
        }
        means
    }

    /// Mean photons between successive `edges`.
    pub(super) fn mean_photons(&self, edges: &[f64], extent: &Extent) -> Vec<f64> {
        let lit = |edge: f64| edge.clamp(extent.lit_fs.start, extent.lit_fs.end);
        let stretches = edges.windows(2);
        let mut means: Vec<f64> = stretches
            .map(|ends| self.background_between(lit(ends[0]), lit(ends[1]), extent))
            .collect();
        let (Some(&first), Some(&last)) = (edges.first(), edges.last()) else {
            return means;
        };
        for (number, echo) in self.sent(first..last, extent) {
            let stretch_fs = echo.stretch_fs(number);
            let from = edges[1..].partition_point(|&edge| edge <= stretch_fs.start);
            let to = edges[..means.len()].partition_point(|&edge| edge < stretch_fs.end);
            echo.add(
                number,
                |i| edges[from + i],
                extent,
                &mut means[from.min(to)..to],
            );
        }
        means
    }
}

impl SpadEcho {
    /// Adds the photons of that of laser cycle `number` to the means of stretches between `edge`(0), `edge`(1), …
    fn add(&self, number: i64, edge: impl Fn(usize) -> f64, extent: &Extent, means: &mut [f64]) {
        let centre_fs = self.centre_fs(number);
        let time = |i: usize| edge(i).clamp(extent.lit_fs.start, extent.lit_fs.end) - centre_fs;
        let mut shares: SmallVec<[f64; FEW_STEPS]> = smallvec![0.0; means.len()];
        pulse_shares(time, self.sigma_fs(), &mut shares);
        for (mean, share) in means.iter_mut().zip(shares) {
            *mean += self.photons * share;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photon::SpadModel;
    use crate::units::{Frequency, Time};
    use proptest::prelude::*;

    fn config() -> StreamConfig {
        StreamConfig {
            seed: 0,
            clock: Frequency::from_hz(100_000_000),
            stop_periods: 100,
            laser_cycles: 1,
            lead: Time::ZERO,
            pulse_sigma: Time::from_ns(2),
            pulse_shape: None,
            energy_spread: 0.0,
            spads: SpadModel::with_dead_time(Time::from_ns(30)),
        }
    }

    fn light(arrival_ns: i64) -> SpadLight {
        let light = PixelLight::echo(16.0, Time::from_ns(arrival_ns)).with_background(16e6);
        SpadLight::new(&config(), &light)
    }

    const NS: f64 = 1e6;

    fn endless() -> Extent {
        Extent::of_echoes(-9..9)
    }

    #[test]
    fn a_whole_cycle_holds_echo_and_background() {
        let sum: f64 = light(500)
            .steps(0.0, 10.0 * NS, 100, &endless())
            .iter()
            .sum();
        assert!((sum - 2.0).abs() < 1e-12, "{sum}");
        let elsewhere = light(500).steps(300.0 * NS, 10.0 * NS, 100, &endless());
        assert!((elsewhere.iter().sum::<f64>() - 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_window_before_stop_sees_the_previous_echo_unless_it_is_dark() {
        let before = |extent: &Extent| light(990).steps(-20.0 * NS, 10.0 * NS, 2, extent);
        assert!(before(&endless()).iter().sum::<f64>() > 0.99);
        let first = Extent {
            cycle: 0,
            lit_fs: 0.0..1e12,
            echoes: 0..9,
        };
        assert_eq!(before(&first).to_vec(), [0.0, 0.0]);
    }

    proptest! {
        /// For laser cycles anywhere in an exposure and echoes that may be longer than one.
        #[test]
        fn photons_follow_the_law_of_echoes(
            arrival in -1.5f64..2.5,
            sigma in prop_oneof![Just(0.0), 1e-3f64..1.5],
            cycle in 0u32..6,
            from in -1.5f64..1.5,
            step in 0.01f64..0.2,
        ) {
            const CYCLES: u32 = 6;
            let cycle_fs = 1000.0 * NS;
            let config = StreamConfig { pulse_sigma: Time::from_fs((sigma * cycle_fs) as i64), ..config() };
            let light = PixelLight::echo(16.0, Time::from_fs((arrival * cycle_fs) as i64));
            let spad = SpadLight::new(&config, &light);
            let (n, left) = (i64::from(cycle), i64::from(CYCLES - cycle));
            let extent = Extent { cycle: n, lit_fs: -n as f64 * cycle_fs..left as f64 * cycle_fs, echoes: -n..left };
            let (from_fs, step_fs) = (from * cycle_fs, step * cycle_fs);
            let edges: Vec<f64> = (0..10).map(|i| from_fs + step_fs * f64::from(i)).collect();
            let law = spad.segments[0].echoes[0].law;
            let steps = spad.steps(from_fs, step_fs, 9, &extent);
            let between = spad.mean_photons(&edges, &extent);
            for (i, (a, b)) in steps.iter().zip(between).enumerate() {
                let share = law.share(cycle, CYCLES, edges[i], edges[i + 1]);
                prop_assert!((a - share).abs() < 1e-10 && (b - share).abs() < 1e-10, "{i}: {a} {b} {share}");
            }
        }
    }
}
