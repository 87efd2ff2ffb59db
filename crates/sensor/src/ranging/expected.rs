//! The mean histogram of an echo: what dead time and one count a bin make of a known pulse.
//!
//! ```text
//!   light      signal·(Gaussian about the arrival) + background, shared evenly by the SPADs
//!   SPAD       fires with rate light × chance that it is ready; then it is blind for the dead time
//!   bin        counts in a laser cycle if as many SPADs fired in it as TYPE and THRESHOLD ask for
//! ```
//!
//! Bins are equal. Times are in bins: bin i reaches from i − ½ to i + ½, as positions of peaks do. A SPAD's chance to be ready follows
//! exactly from the light: it is, unless it fired within the last dead time (non-paralysable), or unless a photon came
//! within it (paralysable). SPADs fire independently, so the number of those that fire in a bin is binomial.
//!
//! How a SPAD goes through a laser cycle is [`spad_state`](super::spad_state)'s.
//!
//! Assumed: SPADs alike, and recovered from the echo before the next laser cycle's.

use std::sync::LazyLock;

use super::counting::Counting;
use super::spad_state::{Dead, Spad};
use crate::chip::{EventType, SensorConfig};
use crate::numerics::{Dual, normal_above, normal_density};
use crate::units::Time;

/// Steps to a bin, at least.
const STEPS: usize = 4;

/// Steps to a dead time, at least, and to the time in which light fires a SPAD, where SPADs fire again under a pulse; and most
/// steps to a bin.
const STEPS_OF_DEAD_TIME: f64 = 12.0;
const STEPS_OF_RATE: f64 = 8.0;
const MOST_STEPS: f64 = 96.0;

/// Standard deviations from its centre where a pulse begins and ends: 10⁻¹¹ of it is left out, less than a photon of 10¹⁰.
const PULSE_REACH: f64 = 6.7;

/// Parameters of the light: place, ln signal, ln background, ln width.
pub(super) const PARAMETERS: usize = 4;

/// Light on a macropixel, in mean photons that its SPADs would detect without dead time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EchoLight {
    /// Centre of the echo, bins.
    pub position_bins: f64,
    /// Photons of the echo in a laser cycle.
    pub signal: f64,
    /// Background and dark counts in a bin and laser cycle.
    pub background_per_bin: f64,
    /// Standard deviation of the echo, bins: that of the laser pulse with all jitter ([`Response::pulse_sigma_bins`]), or more.
    pub sigma_bins: f64,
}

/// How finely time goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Steps {
    /// To find where to look.
    Coarse,
    /// As finely as the light needs.
    Fine,
}

/// How a macropixel answers to light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    /// Histogram bins.
    pub(crate) bins: usize,
    /// Standard deviation of the pulse, bins.
    pub pulse_sigma_bins: f64,
    pub(super) counting: Counting,
    dead: Dead,
}

impl Response {
    /// Of a sensor's macropixels, with bins of `bin_s` seconds each, to Gaussian pulses of standard deviation `pulse_sigma`,
    /// all jitter included.
    pub fn new(config: &SensorConfig, bin_s: f64, pulse_sigma: Time) -> Self {
        let grid = config.spad_grid();
        // Each of four directions is as likely; at an edge there is nobody.
        let neighbours = 2.0 * grid.neighbours() as f64 / (4 * grid.spads()) as f64;
        Response {
            bins: config.bins,
            pulse_sigma_bins: pulse_sigma.as_s() / bin_s,
            counting: Counting {
                event_type: config.event_type,
                threshold: usize::from(config.threshold),
                spads: config.spads(),
            },
            dead: Dead {
                time_bins: config.dead_time().as_s() / bin_s,
                paralysable: config.paralysable,
                afterpulses: config.afterpulse_probability,
                afterpulse_bins: (config.afterpulse_time_ns * 1e-9 / bin_s).max(1e-9),
                crosstalk: config.crosstalk_probability * neighbours,
            },
        }
    }

    /// What counts where this does not, and the other way round; `None` where that is no TYPE and THRESHOLD. Of light that makes
    /// this count less, the other counts more.
    pub(super) fn complement(&self) -> Option<Self> {
        let threshold = match (self.counting.event_type, self.counting.threshold) {
            (EventType::Less, threshold @ 1..) => threshold - 1,
            (EventType::Equal, 0) => 0,
            _ => return None,
        };
        let mut other = *self;
        other.counting.event_type = EventType::Greater;
        other.counting.threshold = threshold;
        Some(other)
    }

    /// Dead time, bins.
    pub(crate) fn dead_time_bins(&self) -> f64 {
        self.dead.time_bins
    }

    /// The chance of every bin to count in a laser cycle.
    pub fn chances(&self, light: &EchoLight) -> Vec<f64> {
        self.chances_in(light, Steps::Fine)
    }

    /// The chance of every bin to count in a laser cycle, and what a laser cycle's count tells of the echo's place: Fisher's information,
    /// 1/bins². The least variance of a place after N laser cycles is 1 over N times their sum.
    pub fn information(&self, light: &EchoLight) -> Vec<(f64, f64)> {
        let of_bin = |chance: &Dual<1>| {
            let spread = chance.value * (1.0 - chance.value);
            let told = chance.slope[0] * chance.slope[0] / spread;
            (chance.value, if spread > 0.0 { told } else { 0.0 })
        };
        let chances = self.chances_of::<1>(light, Steps::Fine);
        chances.iter().map(of_bin).collect()
    }

    pub(super) fn chances_in(&self, light: &EchoLight, steps: Steps) -> Vec<f64> {
        let chances = self.chances_of::<0>(light, steps);
        chances.iter().map(|chance| chance.value).collect()
    }

    /// Whether this light needs finer steps than the fewest.
    pub(super) fn needs_fine_steps(&self, light: &EchoLight) -> bool {
        self.steps(light, Steps::Fine) > self.steps(light, Steps::Coarse)
    }

    /// Steps to a bin.
    fn steps(&self, light: &EchoLight, steps: Steps) -> usize {
        let sigma = light.sigma_bins.max(1e-3);
        let fires_once = self.dead.time_bins >= 2.0 * PULSE_REACH * sigma;
        if steps == Steps::Coarse || fires_once && self.dead.time_bins >= 2.0 {
            return STEPS.max((2.0 / self.dead.time_bins).min(16.0).ceil() as usize);
        }
        // Within the pulse SPADs fire again, and each firing is as sharp as the light is strong.
        let rate = 0.4 * light.signal / (self.counting.spads as f64 * sigma);
        let of_dead_time = STEPS_OF_DEAD_TIME / self.dead.time_bins;
        let wanted = of_dead_time.max(STEPS_OF_RATE * rate).min(MOST_STEPS);
        (wanted.ceil() as usize).max(STEPS)
    }

    /// The chances with their slopes with the first K parameters.
    pub(super) fn chances_of<const K: usize>(
        &self,
        light: &EchoLight,
        steps: Steps,
    ) -> Vec<Dual<K>> {
        self.chances_by(light, self.steps(light, steps))
    }

    fn chances_by<const K: usize>(&self, light: &EchoLight, steps_per_bin: usize) -> Vec<Dual<K>> {
        let dual = |value: f64, slopes: [f64; PARAMETERS]| Dual {
            value,
            slope: std::array::from_fn(|parameter| slopes[parameter]),
        };
        let per_spad = 1.0 / self.counting.spads as f64;
        let signal = light.signal * per_spad;
        let background = light.background_per_bin * per_spad;
        let background = dual(background, [0.0, 0.0, background, 0.0]);
        let sigma = light.sigma_bins.max(1e-6);
        let h = 1.0 / steps_per_bin as f64;

        // Light of the pulse on a SPAD until a time.
        let centre = light.position_bins;
        let (starts, ends) = (centre - PULSE_REACH * sigma, centre + PULSE_REACH * sigma);
        let seen = |time: f64| -> Dual<K> {
            if time <= starts || time >= ends {
                let value = if time <= starts { 0.0 } else { signal };
                return dual(value, [0.0, value, 0.0, 0.0]);
            }
            let z = (time - centre) / sigma;
            let (share, density) = share_before(z);
            let (value, by_place) = (signal * share, -signal * density / sigma);
            dual(value, [by_place, value, 0.0, by_place * z * sigma])
        };
        // Before the pulse the SPADs are as the background alone leaves them: nothing happens before it begins.
        let last = self.bins as f64 - 0.5;
        // Of an echo long before the first bin nothing is left.
        let forgotten = -8.0 - 2.0 * self.dead.time_bins - 4.0 * PULSE_REACH * sigma;
        let begin_bin = (starts + 0.5).clamp(forgotten, self.bins as f64).floor();
        let begin = begin_bin - 0.5;
        let mut chances = Vec::with_capacity(self.bins);
        let mut spad = Spad::steady(&self.dead, background, h);
        let steady = {
            let mut of_bin = spad.clone();
            of_bin.begin_bin();
            for _ in 0..steps_per_bin {
                of_bin.step(background * h);
            }
            of_bin.chance(&self.counting)
        };
        for _ in 0..begin_bin.max(0.0) as usize {
            chances.push(steady);
        }
        let steps = ((last - begin) / h).round() as usize;
        let mut seen_before = seen(begin);
        for step in 0..steps {
            let time = begin + (step + 1) as f64 * h;
            if step % steps_per_bin == 0 {
                spad.begin_bin();
            }
            let seen_after = seen(time);
            spad.step(background * h + (seen_after - seen_before));
            seen_before = seen_after;
            if (step + 1) % steps_per_bin == 0 && time > 0.0 {
                chances.push(spad.chance(&self.counting));
            }
        }
        chances
    }
}

// The edge of a Gaussian pulse: the share of it that has come, from a table.
//
// A histogram of 16 bins asks for a hundred of them. Between its points the table is a cubic of the right values and
// slopes, which is right to 3·10⁻⁹ of the pulse, and to 10⁻⁵ of the share itself where that is above 10⁻⁹.

/// Where the table ends, standard deviations either side, and its points to each.
const REACH: f64 = 7.0;
const POINTS: f64 = 32.0;

/// Share and density.
type Point = (f64, f64);

static TABLE: LazyLock<Vec<Point>> = LazyLock::new(|| {
    let points = (2.0 * REACH * POINTS) as usize;
    let at = |i: usize| i as f64 / POINTS - REACH;
    (0..=points + 1)
        .map(|i| (normal_above(-at(i)), normal_density(at(i))))
        .collect()
});

/// Share of the pulse that comes before `z` standard deviations after its centre, and its slope with z.
#[inline]
pub(super) fn share_before(z: f64) -> (f64, f64) {
    let at = (z + REACH) * POINTS;
    if !(0.0..2.0 * REACH * POINTS).contains(&at) {
        return (f64::from(u8::from(z > 0.0)), 0.0);
    }
    let first = at as usize;
    let table = &*TABLE;
    let ((from, slope_from), (to, slope_to)) = (table[first], table[first + 1]);
    let (u, h) = (at - first as f64, 1.0 / POINTS);
    let v = 1.0 - u;
    let rise = to - from;
    let (a, b) = (slope_from * h - rise, rise - slope_to * h);
    let bend = v * a + u * b;
    let share = from + u * (rise + v * bend);
    (share, POINTS * (rise + (v - u) * bend + u * v * (b - a)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::theory::precision::cramer_rao;
    use proptest::prelude::*;

    const PULSE_SIGMA: Time = Time::from_ps(1_911);

    /// In light so little that SPADs never meet, what counts tell of a place is the Cramér-Rao bound of theory.
    #[test]
    fn little_light_tells_as_much_of_its_place_as_theory_has_it() {
        for (clk_hz, signal, background) in [
            (384e6, 2e-3, 3e-3),
            (200e6, 1e-3, 2e-4),
            (800e6, 1e-4, 1e-3),
        ] {
            let config = SensorConfig {
                clk_hz,
                bins: 64,
                ..SensorConfig::default()
            };
            let response = Response::new(&config, 1.0 / clk_hz, PULSE_SIGMA);
            const PHASES: usize = 16;
            let mean = (0..PHASES).map(|phase| {
                let light = EchoLight {
                    position_bins: 32.0 + (phase as f64 + 0.5) / PHASES as f64,
                    signal,
                    background_per_bin: background,
                    sigma_bins: response.pulse_sigma_bins,
                };
                let told: f64 = response.information(&light).iter().map(|bin| bin.1).sum();
                1.0 / told / PHASES as f64
            });
            let bound_ns = mean.sum::<f64>().sqrt() * 1e9 / clk_hz;
            let theory_ns = cramer_rao(1e9 / clk_hz, PULSE_SIGMA.as_ns(), background, signal);
            assert!(
                (bound_ns / theory_ns - 1.0).abs() < 0.01,
                "{bound_ns} {theory_ns}"
            );
        }
    }

    /// Fisher's information of a bin that counts with chance p is (dp/dx)²/(p(1 − p)), also where it counts nearly always.
    #[test]
    fn information_is_that_of_a_bin_that_counts_or_does_not() {
        let config = SensorConfig::default();
        let response = Response::new(&config, 1.0 / config.clk_hz, PULSE_SIGMA);
        for signal in [0.3, 3.0, 30.0] {
            let at = |position_bins: f64| EchoLight {
                position_bins,
                signal,
                background_per_bin: 0.05,
                sigma_bins: response.pulse_sigma_bins,
            };
            let [before, after] =
                [7.3 - 1e-5, 7.3 + 1e-5].map(|place| response.chances(&at(place)));
            for (bin, (chance, told)) in response.information(&at(7.3)).into_iter().enumerate() {
                let slope = (after[bin] - before[bin]) / 2e-5;
                let wanted = slope * slope / (chance * (1.0 - chance));
                assert!(
                    (told - wanted).abs() < 1e-5 + 1e-3 * wanted,
                    "{signal}, bin {bin}: {told} {wanted}"
                );
            }
        }
    }

    /// Under background alone all bins are as those before the first one that is looked at.
    #[test]
    fn the_dark_stands_still() {
        for (dead_time_ns, paralysable, afterpulse_probability, crosstalk_probability) in [
            (8.0, false, 0.0, 0.0),
            (8.0, false, 0.08, 0.0),
            (8.0, true, 0.08, 0.03),
            (1.3, false, 0.08, 0.03),
            (1.3, true, 0.0, 0.03),
            (40.0, false, 0.04, 0.01),
        ] {
            let config = SensorConfig {
                dead_time_ns,
                paralysable,
                afterpulse_probability,
                crosstalk_probability,
                ..SensorConfig::default()
            };
            let response = Response::new(&config, 1.0 / config.clk_hz, PULSE_SIGMA);
            for background_per_bin in [0.01, 0.3, 3.0] {
                let at = |position_bins: f64| EchoLight {
                    position_bins,
                    signal: 1e-9,
                    background_per_bin,
                    sigma_bins: 0.7,
                };
                // Long before all bins, and after them.
                let [stepped, steady] = [-40.0, 60.0].map(|place| response.chances(&at(place)));
                let worst = stepped
                    .iter()
                    .zip(&steady)
                    .map(|(a, b)| (a / b - 1.0).abs())
                    .fold(0.0, f64::max);
                // Rounds of breeding are few: 6.5·10⁻⁷ at most here.
                assert!(
                    worst < 2e-6,
                    "{dead_time_ns} ns, {background_per_bin}: {worst}"
                );
            }
        }
    }

    /// In the dark bins before an echo never count, and those after it tell nothing of its place.
    #[test]
    fn bins_that_never_count_tell_nothing() {
        let config = SensorConfig::default();
        let response = Response::new(&config, 1.0 / config.clk_hz, PULSE_SIGMA);
        let light = EchoLight {
            position_bins: 7.0,
            signal: 0.5,
            background_per_bin: 0.0,
            sigma_bins: response.pulse_sigma_bins,
        };
        let told = response.information(&light);
        assert_eq!(told[0], (0.0, 0.0));
        assert!(told.iter().all(|bin| bin.1.is_finite()) && told[7].1 > 0.0);
    }

    proptest! {
        /// Bins know no place: what an echo does to one, it does a bin later to the next, also where it comes before all bins.
        #[test]
        fn the_mean_histogram_moves_with_its_echo(
            bins_later in 1usize..12,
            position_bins in -9f64..9.0,
            ln_signal in -2f64..7.0,
            background_per_bin in 1e-3f64..0.3,
            width in 1f64..2.5,
            dead_time_ns in prop_oneof![1.0f64..2.6, 2.6f64..40.0],
            paralysable: bool,
            afterpulse_probability in 0f64..0.05,
        ) {
            let config = SensorConfig { bins: 32, dead_time_ns, paralysable, afterpulse_probability, ..SensorConfig::default() };
            let response = Response::new(&config, 1.0 / config.clk_hz, PULSE_SIGMA);
            let sigma_bins = width * response.pulse_sigma_bins;
            let light = EchoLight { position_bins, signal: ln_signal.exp(), background_per_bin, sigma_bins };
            let later = EchoLight { position_bins: position_bins + bins_later as f64, ..light };
            for steps in [Steps::Coarse, Steps::Fine] {
                let [here, later] = [&light, &later].map(|light| response.chances_in(light, steps));
                for (bin, (here, later)) in here.iter().zip(&later[bins_later..]).enumerate() {
                    prop_assert!((here - later).abs() < 1e-7, "{bin} {here} {later}");
                }
            }
        }
    }

    /// By hand: four steps where a SPAD fires once under the pulse, else twelve to a dead time and eight to the time in which
    /// light fires it, at most 96; to find where to look, two to a dead time.
    #[test]
    fn steps_go_by_dead_time_and_rate() {
        let steps = |dead_time_ns: f64, signal: f64, sigma_bins: f64, steps: Steps| {
            let config = SensorConfig {
                dead_time_ns,
                ..SensorConfig::default()
            };
            // Bins of a nanosecond.
            let response = Response::new(&config, 1e-9, PULSE_SIGMA);
            response.steps(
                &EchoLight {
                    position_bins: 7.0,
                    signal,
                    background_per_bin: 0.01,
                    sigma_bins,
                },
                steps,
            )
        };
        // A pulse of half a bin is over in 6.7 bins.
        assert_eq!(
            [6.6, 6.8].map(|dead| steps(dead, 2000.0, 0.5, Steps::Fine)),
            [96, 4]
        );
        // One of a tenth of a bin in 1.34, but within two bins background fires SPADs again.
        assert_eq!(
            [1.9, 2.1].map(|dead| steps(dead, 0.1, 0.1, Steps::Fine)),
            [7, 4]
        );
        // Eight times 0.4 · 80/(16 · 0.5) a bin.
        assert_eq!(steps(6.0, 80.0, 0.5, Steps::Fine), 32);
        assert_eq!(steps(6.0, 0.8, 0.5, Steps::Fine), 4);
        assert_eq!(steps(0.5, 0.8, 0.5, Steps::Fine), 24);
        let coarse = [8.0, 0.5, 0.21, 0.05].map(|dead| steps(dead, 80.0, 0.5, Steps::Coarse));
        assert_eq!(coarse, [4, 4, 10, 16]);
    }

    proptest! {
        /// A SPAD that is blind for the rest of the laser cycle fires once, on the first photon: a closed form, whatever the
        /// width of the echo and its place, also where it comes before all bins or after them.
        #[test]
        fn spads_that_fire_once_follow_the_first_photon(
            position_bins in -8f64..40.0,
            signal in 0.1f64..60.0,
            sigma_bins in prop_oneof![Just(0.0), 0.02f64..0.5, 0.5f64..4.0],
            spads in prop::sample::select(vec![1usize, 2, 4, 8]),
        ) {
            let config = SensorConfig { bins: 32, spad_rows: 1, spad_cols: spads, dead_time_ns: 400.0, ..SensorConfig::default() };
            let response = Response::new(&config, 1.0 / config.clk_hz, PULSE_SIGMA);
            let light = EchoLight { position_bins, signal, background_per_bin: 0.0, sigma_bins };
            let of_spad = signal / config.spads() as f64;
            let dark_until = |edge: f64| libm::exp(-of_spad * normal_above((position_bins - edge) / sigma_bins.max(1e-6)));
            for steps in [Steps::Coarse, Steps::Fine] {
                for (bin, chance) in response.chances_in(&light, steps).into_iter().enumerate() {
                    let fires = dark_until(bin as f64 - 0.5) - dark_until(bin as f64 + 0.5);
                    let wanted = -libm::expm1(config.spads() as f64 * libm::log1p(-fires));
                    prop_assert!((chance - wanted).abs() < 1e-6, "bin {bin}: {chance}, {wanted}");
                }
            }
        }

        #[test]
        fn steps_are_as_fine_as_the_light_needs(
            position_bins in 2f64..12.0,
            ln_signal in -2f64..7.0,
            background_per_bin in 1e-3f64..0.3,
            sigma_bins in 0.2f64..2.5,
            dead_time_ns in prop_oneof![0.3f64..2.6, 2.6f64..40.0],
            paralysable: bool,
        ) {
            let config = SensorConfig { dead_time_ns, paralysable, ..SensorConfig::default() };
            let response = Response::new(&config, 1.0 / config.clk_hz, PULSE_SIGMA);
            let light = EchoLight { position_bins, signal: ln_signal.exp(), background_per_bin, sigma_bins };
            let steps = response.steps(&light, Steps::Fine);
            let [chosen, finer] = [steps, 6 * steps].map(|steps| response.chances_by::<0>(&light, steps));
            let worst = chosen.iter().zip(&finer).map(|(a, b)| (a.value - b.value).abs()).fold(0.0, f64::max);
            // Of 3000 lights: 1.0·10⁻³ below 20 photons; above, 1.4·10⁻³ where a non-paralysable SPAD fires again under the
            // pulse, 1.3·10⁻² where it fires once, 2.0·10⁻² where it
            // is paralysable or would need more than the most steps.
            let fires_again = steps > STEPS && steps < MOST_STEPS as usize && !paralysable;
            let allowed = if light.signal < 20.0 || fires_again { 2e-3 } else { 4e-2 };
            prop_assert!(worst < allowed, "{worst} with {steps} steps");
            prop_assert!(steps <= MOST_STEPS as usize && response.steps(&light, Steps::Coarse) <= steps);
        }
    }

    #[test]
    fn the_table_is_the_normal_distribution() {
        for i in 0..14_000 {
            let z = -7.0 + f64::from(i) * 1e-3 + 3e-4;
            let (share, (found, slope)) = (normal_above(-z), share_before(z));
            let error = (found - share).abs();
            assert!(
                error < 3e-9 && (share < 1e-9 || error < 1e-5 * share),
                "{z}: {error}"
            );
            let error = (slope - normal_density(z)).abs();
            assert!(error < 2e-6, "{z}: slope off by {error}");
        }
        assert_eq!([-7.01, -40.0].map(share_before), [(0.0, 0.0); 2]);
        assert_eq!([7.01, 40.0].map(share_before), [(1.0, 0.0); 2]);
    }
}
