//! Claims 20 and 21: HSLIDAR's delay lines and their calibration (thesis 6.3.1, Equations 28 and 29).
//!
//! ```text
//!   window start ─►[τ₁]─►[τ₂]─► … ─►[τ₈]     bin i is open while the edge runs through element i
//! ```
//!
//! A model of the delay lines alone, not of the chip: 64 × 32 macropixels of eight elements whose delays are normal
//! and independent. The calibration is the thesis's: a picosecond pulse moves in 10 ps steps, and the bin that peaks
//! gives each bin's width and mid-point. Then a plane is measured, once with equal bins (Eq. 28) and once with the
//! calibrated mid-points (Eq. 29).

use rayon::prelude::*;

use super::claim::{Published::*, Row};
use super::penalty::sigma_over_fwhm;
use crate::numerics::normal_above;
use crate::photon::{Poisson, Purpose, normal, random_stream};
use crate::report::{Axis, Chart, Style};
use crate::units::SPEED_OF_LIGHT_M_PER_S;

const PIXELS: u32 = 64 * 32;
const BINS: usize = 8;
/// Mean and spread of an element's delay, ns (Fig. 91).
const MEAN_NS: f64 = 2.6;
const SPREAD_NS: f64 = 0.4;
/// Step of the calibrating sweep, ns.
const SWEEP_NS: f64 = 0.01;
/// σ of the demonstrator's laser pulse, ns.
fn pulse_sigma_ns() -> f64 {
    4.5 * sigma_over_fwhm()
}
/// Time of flight to the plane of Fig. 92 at 2.5 m, in the first window, ns.
fn plane_ns() -> f64 {
    1e9 * 2.0 * 2.5 / SPEED_OF_LIGHT_M_PER_S
}
/// Signal photons of the plane in one exposure: its peak bin, which takes half of them, fills 12 bits.
const PHOTONS: f64 = 8_000.0;

/// One macropixel's delay line, by the edges of its bins, ns from the start of its window.
struct DelayLine {
    edges_ns: [f64; BINS + 1],
}

impl DelayLine {
    fn of(pixel: u32) -> Self {
        let mut random = random_stream(20, Purpose::Photons, pixel, 0);
        let mut edges_ns = [0.0; BINS + 1];
        for bin in 0..BINS {
            // Four standard deviations below the mean an element would still delay by a nanosecond.
            let delay_ns = MEAN_NS + SPREAD_NS * normal(&mut random).clamp(-4.0, 4.0);
            edges_ns[bin + 1] = edges_ns[bin] + delay_ns;
        }
        DelayLine { edges_ns }
    }

    /// Width and mid-point of every bin as the sweep finds them, ns.
    fn calibrated(&self) -> [(f64, f64); BINS] {
        let steps = (self.edges_ns[BINS] / SWEEP_NS).ceil() as usize;
        let mut found = [(0usize, 0.0); BINS];
        for step in 0..steps {
            let time_ns = (step as f64 + 0.5) * SWEEP_NS;
            let bin = self.edges_ns[1..].partition_point(|&edge| edge <= time_ns);
            if let Some((count, sum)) = found.get_mut(bin) {
                *count += 1;
                *sum += time_ns;
            }
        }
        found.map(|(count, sum)| (count as f64 * SWEEP_NS, sum / count as f64))
    }

    /// Photon counts of an echo at `time_ns`.
    fn histogram(&self, pixel: u32, time_ns: f64) -> [f64; BINS] {
        let mut random = random_stream(21, Purpose::Photons, pixel, 0);
        let below = |edge: f64| normal_above((time_ns - edge) / pulse_sigma_ns());
        std::array::from_fn(|bin| {
            let share = below(self.edges_ns[bin + 1]) - below(self.edges_ns[bin]);
            Poisson::new(PHOTONS * share).draw(&mut random) as f64
        })
    }
}

/// What the delay lines give.
struct Sweep {
    /// Calibrated widths of all bins of all pixels, ns.
    widths_ns: Vec<f64>,
    /// Range of the plane by Eq. 28 with the mean bin, m.
    before_m: Vec<f64>,
    /// Range of the plane by Eq. 29, m.
    after_m: Vec<f64>,
}

/// Peak position by Eq. 28 or 29, over the bins within two of the peak, with `place` the place of each bin.
fn centroid(counts: &[f64; BINS], place: impl Fn(usize) -> f64) -> f64 {
    let peak = (0..BINS)
        .max_by(|&a, &b| counts[a].total_cmp(&counts[b]))
        .unwrap_or(0);
    let near = peak.saturating_sub(2)..=(peak + 2).min(BINS - 1);
    let (weighted, sum) = near.fold((0.0, 0.0), |(w, s), bin| {
        (w + counts[bin] * place(bin), s + counts[bin])
    });
    weighted / sum
}

fn metres(time_ns: f64) -> f64 {
    1e-9 * time_ns * SPEED_OF_LIGHT_M_PER_S / 2.0
}

impl Sweep {
    /// All pixels, the plane at `time_ns` after the start of their window.
    fn at(time_ns: f64) -> Self {
        let pixels: Vec<([f64; BINS], f64, f64)> = (0..PIXELS)
            .into_par_iter()
            .map(|pixel| {
                let line = DelayLine::of(pixel);
                let bins = line.calibrated();
                let counts = line.histogram(pixel, time_ns);
                let before = centroid(&counts, |bin| (bin as f64 + 0.5) * MEAN_NS);
                let after = centroid(&counts, |bin| bins[bin].1);
                (bins.map(|b| b.0), metres(before), metres(after))
            })
            .collect();
        Sweep {
            widths_ns: pixels.iter().flat_map(|p| p.0).collect(),
            before_m: pixels.iter().map(|p| p.1).collect(),
            after_m: pixels.iter().map(|p| p.2).collect(),
        }
    }
}

fn mean_and_sigma(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
    (mean, variance.sqrt())
}

/// Claim 20: the delay lines and the plane of Fig. 92.
pub(super) fn rows() -> Vec<Row> {
    let sweep = Sweep::at(plane_ns());
    let (mean_ns, spread_ns) = mean_and_sigma(&sweep.widths_ns);
    let (_, before_m) = mean_and_sigma(&sweep.before_m);
    let (_, after_m) = mean_and_sigma(&sweep.after_m);
    let unknown = "Delay lines alone, at the published spread; the clock's delay across the sensor (Fig. 90), the even and odd windows and the exposure behind the published numbers are not known.";
    vec![
        Row::holds(
            "mean bin interval found by the 10 ps sweep",
            "ns",
            Exactly("2.6"),
            mean_ns,
        )
        .given("The elements' mean is put in; the sweep finds it again in 16 384 bins."),
        Row::holds(
            "spread of the bin intervals",
            "ns",
            Exactly("0.4"),
            spread_ns,
        )
        .given("Put in as well."),
        Row::holds(
            "spread of a plane at 2.5 m before calibration",
            "m",
            Exactly("0.175"),
            before_m,
        )
        .differs(unknown),
        Row::holds("spread after calibration", "m", Exactly("0.029"), after_m).differs(unknown),
        Row::ours("factor that calibration gains", "", before_m / after_m)
            .remark("0.175 over 0.029 is 6.0."),
    ]
}

/// Fig. 91: bin intervals.
pub(super) fn figure_91() -> Vec<Chart> {
    let widths = Sweep::at(plane_ns()).widths_ns;
    vec![
        Chart::new(
            "Bin intervals of 64 × 32 simulated delay lines, found by a 10 ps sweep",
            Axis::linear("bin interval (ns)"),
            Axis::linear("bins"),
        )
        .with("", Style::Bars, histogram(&widths, 1.0, 4.2, 64)),
    ]
}

/// Fig. 93: the plane before and after calibration.
pub(super) fn figure_93() -> Vec<Chart> {
    let sweep = Sweep::at(plane_ns());
    let outline = |values: &[f64]| histogram(values, 1.8, 3.2, 140);
    vec![
        Chart::new(
            "A plane at 2.5 m through simulated delay lines",
            Axis::linear("measured range (m)"),
            Axis::linear("pixels"),
        )
        .with(
            "before calibration (Eq. 28)",
            Style::Bars,
            outline(&sweep.before_m),
        )
        .with("after (Eq. 29)", Style::Line, outline(&sweep.after_m)),
    ]
}

/// Counts of `values` in `bins` equal bins from `from` to `to`, at the bins' middles.
fn histogram(values: &[f64], from: f64, to: f64, bins: usize) -> Vec<(f64, f64)> {
    let width = (to - from) / bins as f64;
    let mut counts = vec![0.0; bins];
    for value in values {
        let bin = ((value - from) / width).floor();
        if bin >= 0.0 && bin < bins as f64 {
            counts[bin as usize] += 1.0;
        }
    }
    let middle = |bin: usize| from + (bin as f64 + 0.5) * width;
    counts
        .into_iter()
        .enumerate()
        .map(|(bin, n)| (middle(bin), n))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sweep_finds_every_bin_to_its_step() {
        for pixel in 0..50 {
            let line = DelayLine::of(pixel);
            for (bin, (width, middle)) in line.calibrated().into_iter().enumerate() {
                let (low, high) = (line.edges_ns[bin], line.edges_ns[bin + 1]);
                assert!((width - (high - low)).abs() <= 1.01 * SWEEP_NS, "{width}");
                assert!((middle - 0.5 * (low + high)).abs() <= SWEEP_NS, "{middle}");
            }
        }
    }

    #[test]
    fn calibration_pays() {
        let sweep = Sweep::at(10.0);
        let (before, after) = (
            mean_and_sigma(&sweep.before_m).1,
            mean_and_sigma(&sweep.after_m).1,
        );
        assert!(after < 0.5 * before, "{before} {after}");
    }
}
