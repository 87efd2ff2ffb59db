//! Mean photons on one SPAD in any stretch of time, relative to the STOP edge of some laser cycle.
//!
//! The light is that of the photon stream: background and dark counts evenly, and a Gaussian echo of every laser cycle by
//! the [law of echoes](EchoLaw). What of it exists depends on where in the exposure the laser cycle is: [`Extent`].

use std::ops::Range;

use smallvec::{SmallVec, smallvec};

use super::FEW_STEPS;
use crate::photon::{ECHO_REACH, EchoLaw, PixelLight, SPADS, StreamConfig, pulse_shares};

/// Mean photons below which [`absorbed_dim`] holds.
pub const DIM: f64 = 0.015;

/// Probability of a photon where `mean` are expected.
pub fn absorbed(mean: f64) -> f64 {
    match mean < DIM {
        true => absorbed_dim(mean),
        false => -libm::expm1(-mean),
    }
}

/// As [`absorbed`], for means below [`DIM`]: seven terms of the series are all there is to it.
#[inline(always)]
pub fn absorbed_dim(mean: f64) -> f64 {
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
pub struct Extent {
    /// The exposure, fs after the STOP edge of the laser cycle.
    pub lit_fs: Range<f64>,
    /// Laser cycles that send an echo, counted from this one.
    pub echoes: Range<i64>,
}

impl Extent {
    /// An exposure without beginning and end, but for the echoes it has.
    pub fn of_echoes(echoes: Range<i64>) -> Self {
        Extent {
            lit_fs: f64::NEG_INFINITY..f64::INFINITY,
            echoes,
        }
    }
}

/// Light on one SPAD of a macropixel. Times in femtoseconds.
#[derive(Debug, Clone, Copy)]
pub struct SpadLight {
    echoes: EchoLaw,
    signal: f64,
    background_per_fs: f64,
}

impl SpadLight {
    /// A sixteenth of `light`.
    pub fn new(config: &StreamConfig, light: &PixelLight) -> Self {
        SpadLight {
            echoes: EchoLaw {
                cycle_fs: config.cycle_s() * 1e15,
                arrival_fs: light.arrival.as_fs() as f64,
                sigma_fs: config.pulse_sigma.as_fs() as f64,
            },
            signal: light.signal_per_cycle / SPADS as f64,
            background_per_fs: light.background_hz * 1e-15 / SPADS as f64,
        }
    }

    /// Mean background photons in `duration_fs`.
    pub fn background(&self, duration_fs: f64) -> f64 {
        self.background_per_fs * duration_fs
    }

    /// Laser cycles whose echoes reach into a stretch of time.
    pub fn echoes_in(&self, stretch_fs: Range<f64>) -> Range<i64> {
        match self.signal > 0.0 {
            // A pulse without width is somewhere within a femtosecond.
            true => self.echoes.reaching(stretch_fs.start - 1.0, stretch_fs.end),
            false => 0..0,
        }
    }

    /// Where the echo of laser cycle `number` is to be found.
    pub fn echo(&self, number: i64) -> Range<f64> {
        let centre_fs = self.echoes.centre_fs(number);
        let reach_fs = ECHO_REACH * self.echoes.sigma_fs;
        centre_fs - reach_fs..centre_fs + reach_fs + 1.0
    }

    /// Its centre.
    pub fn centre_fs(&self, number: i64) -> f64 {
        self.echoes.centre_fs(number)
    }

    /// Standard deviation of an echo.
    pub fn sigma_fs(&self) -> f64 {
        self.echoes.sigma_fs
    }

    /// Mean photons in `count` successive steps of `step_fs` from `from_fs` on.
    pub fn steps(
        &self,
        from_fs: f64,
        step_fs: f64,
        count: usize,
        extent: &Extent,
    ) -> SmallVec<[f64; FEW_STEPS]> {
        let edge = |i: usize| from_fs + step_fs * i as f64;
        let lit_fs = &extent.lit_fs;
        let mut means: SmallVec<_> = smallvec![self.background(step_fs); count];
        if lit_fs.start > from_fs || lit_fs.end < edge(count) {
            for (i, mean) in means.iter_mut().enumerate() {
                let lit = edge(i + 1).min(lit_fs.end) - edge(i).max(lit_fs.start);
                *mean = self.background(lit.max(0.0));
            }
        }
        let reaching = self.echoes_in(from_fs..edge(count));
        for number in reaching.start.max(extent.echoes.start)..reaching.end.min(extent.echoes.end) {
            let echo = self.echo(number);
            let from = ((echo.start - from_fs) / step_fs).floor().max(0.0) as usize;
            let to = ((echo.end - from_fs) / step_fs).ceil();
            let to = to.clamp(0.0, count as f64) as usize;
            self.add_echo(
                number,
                |i| edge(from + i),
                extent,
                &mut means[from.min(to)..to],
            );
        }
        means
    }

    /// Mean photons between successive `edges`.
    pub fn between(&self, edges: &[f64], extent: &Extent) -> Vec<f64> {
        let lit = |edge: f64| edge.clamp(extent.lit_fs.start, extent.lit_fs.end);
        let stretches = edges.windows(2);
        let mut means: Vec<f64> = stretches
            .map(|ends| self.background(lit(ends[1]) - lit(ends[0])))
            .collect();
        let (Some(&first), Some(&last)) = (edges.first(), edges.last()) else {
            return means;
        };
        let reaching = self.echoes_in(first..last);
        for number in reaching.start.max(extent.echoes.start)..reaching.end.min(extent.echoes.end) {
            let echo = self.echo(number);
            let from = edges[1..].partition_point(|&edge| edge <= echo.start);
            let to = edges[..means.len()].partition_point(|&edge| edge < echo.end);
            self.add_echo(
                number,
                |i| edges[from + i],
                extent,
                &mut means[from.min(to)..to],
            );
        }
        means
    }

    /// Adds the photons of the echo of laser cycle `number` to the means of stretches between `edge`(0), `edge`(1), …
    fn add_echo(
        &self,
        number: i64,
        edge: impl Fn(usize) -> f64,
        extent: &Extent,
        means: &mut [f64],
    ) {
        let centre_fs = self.echoes.centre_fs(number);
        let time = |i: usize| edge(i).clamp(extent.lit_fs.start, extent.lit_fs.end) - centre_fs;
        let mut shares: SmallVec<[f64; FEW_STEPS]> = smallvec![0.0; means.len()];
        pulse_shares(time, self.echoes.sigma_fs, &mut shares);
        for (mean, share) in means.iter_mut().zip(shares) {
            *mean += self.signal * share;
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
            spads: SpadModel::with_dead_time(Time::from_ns(30)),
        }
    }

    fn light(arrival_ns: i64) -> SpadLight {
        let light = PixelLight {
            signal_per_cycle: 16.0,
            arrival: Time::from_ns(arrival_ns),
            background_hz: 16e6,
        };
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
            let light = PixelLight {
                signal_per_cycle: 16.0,
                arrival: Time::from_fs((arrival * cycle_fs) as i64),
                background_hz: 0.0,
            };
            let spad = SpadLight::new(&config, &light);
            let (n, left) = (i64::from(cycle), i64::from(CYCLES - cycle));
            let extent = Extent { lit_fs: -n as f64 * cycle_fs..left as f64 * cycle_fs, echoes: -n..left };
            let (from_fs, step_fs) = (from * cycle_fs, step * cycle_fs);
            let edges: Vec<f64> = (0..10).map(|i| from_fs + step_fs * f64::from(i)).collect();
            let steps = spad.steps(from_fs, step_fs, 9, &extent);
            let between = spad.between(&edges, &extent);
            for (i, (a, b)) in steps.iter().zip(between).enumerate() {
                let law = spad.echoes.share(cycle, CYCLES, edges[i], edges[i + 1]);
                prop_assert!((a - law).abs() < 1e-10 && (b - law).abs() < 1e-10, "{i}: {a} {b} {law}");
            }
        }
    }
}
