//! Claims 20 and 21: HSLIDAR in its delay-line mode and its calibration (thesis 6.3.1, Equations 28 and 29), on the chip.
//!
//! ```text
//!   picosecond laser, 10 ps steps ─► chip ─► bin profile ─┐
//!   plane at 2.5 m ─► photons ─► chip ─► counts ──────────┴─► Eq. 29 | Eq. 28 without the profile
//! ```
//!
//! Four rows of the array stand for all 32: with 64 columns they have the whole skew of the clock, and 256 macropixels tell a
//! standard deviation to 4 %.

use std::sync::OnceLock;

use super::claim::ClaimRow;
use super::parameters::{demonstrator_photons, sigma_over_fwhm};
use super::thesis::{chart, claim};
use crate::chip::{Exposure, Sensor, SensorConfig, WindowLaw, hslidar_delay_line};
use crate::engine::{Expose, LitPixel, Window, stream_config};
use crate::numerics::intervals::mean_and_sigma;
use crate::photon::{PhotonStream, PixelLight};
use crate::ranging::{BinProfile, PeakOptions, centre_of_mass};
use crate::report::Chart;
use crate::system::{Sweep, calibrate};
use crate::units::{Time, TimeOfFlight};

/// CLK periods of a laser cycle: a little more than the P-counter reaches.
const STOP_PERIODS: u32 = 140;
/// The plane of Fig. 92, m.
const PLANE_M: f64 = 2.5;
/// Laser cycles of the plane's exposure: the demonstrator's 200 ms at 80 kHz.
const LASER_CYCLES: u32 = 16_000;
/// Detected signal photons of the plane in a laser cycle. The thesis does not say; at 89 z⁻² there would be 14, most of which would
/// meet others on the line and cancel.
const PHOTONS_PER_CYCLE: f64 = 0.1;

fn sensor() -> Sensor {
    SensorConfig {
        rows: 4,
        ..(*hslidar_delay_line()).clone()
    }
    .into()
}

/// What the chip gives.
struct ChipRanges {
    calibrated: BinProfile,
    /// Range of the plane by every macropixel with bins that are all alike (Eq. 28), m.
    before_m: Vec<f64>,
    /// The same with the calibrated ones (Eq. 29), m.
    after_m: Vec<f64>,
}

/// Measured once for all that is shown of it.
fn measured() -> &'static ChipRanges {
    static MEASURED: OnceLock<ChipRanges> = OnceLock::new();
    MEASURED.get_or_init(|| {
        let sensor = sensor();
        let calibrated = calibrate(&sensor, STOP_PERIODS, &Sweep::default(), || ());
        let calibrated = calibrated
            .expect("the window engine follows delay lines")
            .profile;
        let exposure = Exposure::new(&sensor, STOP_PERIODS, LASER_CYCLES);
        let ideal = BinProfile::ideal(&sensor, &exposure);
        let arrival = Time::of_flight(PLANE_M);
        let start = WindowLaw::new(sensor.alike(), &exposure).start_for(arrival);
        let start = start.expect("the first windows see it");
        let pulse_sigma = Time::from_s(4.5e-9 * sigma_over_fwhm());
        let stream = PhotonStream::new(&stream_config(&sensor, &exposure, 1, pulse_sigma));
        let pixels: Vec<LitPixel> = (0..sensor.pixels() as u32)
            .map(|number| LitPixel {
                number,
                start,
                light: Some(PixelLight::echo(PHOTONS_PER_CYCLE, arrival)),
            })
            .collect();
        let window = Window::new(&sensor, &exposure);
        let exposed = window.expose(&stream, &pixels);
        let exposed = exposed.expect("the window engine follows delay lines");
        let range_m = |profile: &BinProfile, pixel: usize, counts: &[u16]| {
            let counts: Vec<f64> = counts.iter().map(|&n| n.into()).collect();
            let peak = (0..counts.len()).max_by(|&a, &b| counts[a].total_cmp(&counts[b]));
            let middles_s = profile.middles_s(pixel, start);
            let options = PeakOptions::default();
            let mass = centre_of_mass(&counts, peak.unwrap_or(0), &options, |bin| middles_s[bin]);
            Time::from_s(mass.expect("the plane is seen").place).as_range_m()
        };
        let ranges = |profile: &BinProfile| {
            let histograms = exposed.histograms.iter().enumerate();
            histograms
                .map(|(pixel, counts)| range_m(profile, pixel, counts))
                .collect()
        };
        ChipRanges {
            before_m: ranges(&ideal),
            after_m: ranges(&calibrated),
            calibrated,
        }
    })
}

/// The calibration of the four rows.
pub(super) fn calibrated() -> &'static BinProfile {
    &measured().calibrated
}

/// The calibration of four rows whose elements are all alike, made once.
pub(super) fn calibrated_alike() -> &'static BinProfile {
    static ALIKE: OnceLock<BinProfile> = OnceLock::new();
    ALIKE.get_or_init(|| {
        let alike: Sensor = SensorConfig {
            delay_sigma: 0.0,
            ..(*sensor()).clone()
        }
        .into();
        let calibrated = calibrate(&alike, STOP_PERIODS, &Sweep::default(), || ());
        calibrated
            .expect("the window engine follows delay lines")
            .profile
    })
}

/// Lengths of all bins that the sweep found, ns.
pub(super) fn lengths_ns() -> Vec<f64> {
    let lines = measured().calibrated.macropixels.iter().flatten();
    lines
        .flat_map(|line| line.length_s.iter().map(|s| s * 1e9))
        .collect()
}

/// Claim 20: the delay lines and the plane of Fig. 92.
pub(super) fn rows() -> Vec<ClaimRow> {
    let claim = claim(20);
    let (mean_ns, spread_ns) = mean_and_sigma(&lengths_ns());
    let (_, before_m) = mean_and_sigma(&measured().before_m);
    let (mean_m, after_m) = mean_and_sigma(&measured().after_m);
    vec![
        claim.row("mean", mean_ns),
        claim.row("spread", spread_ns),
        claim.row("plane_before", before_m),
        claim.row("plane_after", after_m),
        claim.row("gain", before_m / after_m),
        claim.row("plane_mean", mean_m),
    ]
}

/// What Fig. 94 shows.
struct CountedLight {
    /// Background counts a second.
    background_hz: f64,
    /// Signal counts a laser cycle times z², fitted over all distances, and at the last one.
    signal_m2: f64,
    signal_at_30_m: f64,
}

/// Fig. 94 as it was measured: a target moves away, the chip counts with its laser on and off.
///
/// `signal_m2` and `background_hz` are the photons that SPADs would detect if they were always ready. Nine macropixels, 20 acquisitions of
/// 4000 laser cycles each, from 10 to 30 m. That tells counts to 0.3 %.
fn counted_light(signal_m2: f64, background_hz: f64) -> CountedLight {
    const ACQUISITIONS: u64 = 20;
    const CYCLES: u32 = 4_000;
    let sensor = sensor();
    let exposure = Exposure::new(&sensor, STOP_PERIODS, CYCLES);
    let law = WindowLaw::new(&sensor, &exposure);
    let window = Window::new(&sensor, &exposure);
    let pulse_sigma = Time::from_s(4.5e-9 * sigma_over_fwhm());
    // Counts of nine macropixels in a laser cycle on average, and the length of their windows, s.
    let counted = |range_m: f64, signal: f64, seed: u64| {
        let arrival = Time::of_flight(range_m);
        let stream = PhotonStream::new(&stream_config(&sensor, &exposure, seed, pulse_sigma));
        let pixels: Vec<LitPixel> = (0..9)
            .map(|number| LitPixel {
                number,
                start: law
                    .of_macropixel(number)
                    .start_for(arrival)
                    .expect("in reach"),
                light: Some(PixelLight::echo(signal, arrival).with_background(background_hz)),
            })
            .collect();
        let lengths = pixels.iter().map(|pixel| {
            let law = law.of_macropixel(pixel.number);
            let seen = law.interval(&law.window(pixel.start).open().expect("it opens"));
            (seen.end - seen.start).as_s()
        });
        let exposed = window
            .expose(&stream, &pixels)
            .expect("the window engine follows delay lines");
        let counts = exposed.histograms.counts().iter().map(|&n| f64::from(n));
        let cycles = f64::from(CYCLES);
        (counts.sum::<f64>() / cycles, lengths.sum::<f64>())
    };
    let ranges_m = [10.0, 15.0, 20.0, 25.0, 30.0];
    let mut background = (0.0, 0.0);
    let (mut moment, mut square, mut farthest) = (0.0, 0.0, 0.0);
    for range_m in ranges_m {
        let mut signal = 0.0;
        for seed in 0..ACQUISITIONS {
            let (off, length_s) = counted(range_m, 0.0, seed);
            let (on, _) = counted(
                range_m,
                signal_m2 / (range_m * range_m),
                seed + ACQUISITIONS,
            );
            background = (background.0 + off, background.1 + length_s);
            signal += (on - off) / (9.0 * ACQUISITIONS as f64);
        }
        // Least squares through the origin of 1/z².
        let inverse_square = 1.0 / (range_m * range_m);
        moment += signal * inverse_square;
        square += inverse_square * inverse_square;
        farthest = signal / inverse_square;
    }
    CountedLight {
        background_hz: background.0 / background.1,
        signal_m2: moment / square,
        signal_at_30_m: farthest,
    }
}

/// Claim 21: the demonstrator's light on its chip.
pub(super) fn light_rows() -> Vec<ClaimRow> {
    let claim = claim(21);
    let arriving = demonstrator_photons(60.0).link;
    let counted = counted_light(arriving.signal, arriving.background_hz);
    vec![
        claim.row("background_counted", counted.background_hz / 1e6),
        claim.row("signal_counted", counted.signal_m2),
        claim.row("signal_at_30_m", counted.signal_at_30_m),
        claim.row("background_arriving", arriving.background_hz / 1e6),
        claim.row("signal_arriving", arriving.signal),
    ]
}

/// Fig. 90: the fullest bin of every column at some delays of the laser.
pub(super) fn figure_90() -> Chart {
    let ChipRanges { calibrated, .. } = measured();
    let cols = calibrated.sensor.cols;
    let first_ns = calibrated.macropixels[0][0].middle_s[0] * 1e9;
    let mut chart = chart(90);
    for step in 0..4 {
        let delay_ns = first_ns + 4.0 + 4.0 * f64::from(step);
        let nearest_bin = |pixel: usize| {
            let middles = &calibrated.macropixels[pixel][0].middle_s;
            let off = |bin: &usize| (middles[*bin] * 1e9 - delay_ns).abs();
            let bins = 0..middles.len();
            bins.min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0) as f64
        };
        let rows = calibrated.sensor.rows;
        let mean = |col: usize| {
            (0..rows)
                .map(|row| nearest_bin(row * cols + col))
                .sum::<f64>()
                / rows as f64
        };
        let points: Vec<(f64, f64)> = (0..cols).map(|col| (col as f64, mean(col))).collect();
        chart = chart.line(format!("{delay_ns:.0} ns"), points);
    }
    chart
}

/// Fig. 91: bin intervals.
pub(super) fn figure_91() -> Chart {
    chart(91).bars("", histogram(&lengths_ns(), 1.0, 4.2, 64))
}

/// Fig. 92: the plane, by column.
pub(super) fn figure_92() -> Chart {
    let ChipRanges {
        calibrated,
        before_m,
        after_m,
    } = measured();
    let cols = calibrated.sensor.cols;
    let points = |ranges: &[f64]| -> Vec<(f64, f64)> {
        let places = ranges.iter().enumerate();
        places
            .map(|(pixel, &m)| ((pixel % cols) as f64, m))
            .collect()
    };
    chart(92)
        .points("before calibration (Eq. 28)", points(before_m))
        .points("after (Eq. 29)", points(after_m))
}

/// Fig. 93: the plane before and after calibration.
pub(super) fn figure_93() -> Chart {
    let outline = |values: &[f64]| histogram(values, 1.8, 3.2, 140);
    chart(93)
        .bars("before calibration (Eq. 28)", outline(&measured().before_m))
        .line("after (Eq. 29)", outline(&measured().after_m))
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

    /// The sweep against the law, which the gates are held to. Near an edge five counts of a step decide by chance which bin is the
    /// fullest, with a jitter of 30 ps: a length has two such edges, and is found to ten steps; a middle has half of that.
    #[test]
    fn the_sweep_finds_every_bin() {
        let sensor = sensor();
        let law = WindowLaw::new(&sensor, &Exposure::new(&sensor, STOP_PERIODS, 16));
        let ChipRanges { calibrated, .. } = measured();
        for pixel in (0..sensor.pixels()).step_by(7) {
            for (parity, &start) in calibrated.starts.iter().enumerate() {
                let law = law.of_macropixel(pixel as u32);
                let edges = law.edges(&law.window(start).open().unwrap(), 0);
                let line = &calibrated.macropixels[pixel][parity];
                for bin in 0..sensor.bins {
                    let length_ps = edges.width(bin).as_s() * 1e12;
                    let middle_ps = edges.bin(bin).start.as_s() * 1e12 + 0.5 * length_ps;
                    let found_ps = line.length_s[bin] * 1e12;
                    assert!(
                        (found_ps - length_ps).abs() < 100.0,
                        "{found_ps} {length_ps}"
                    );
                    let found_ps = line.middle_s[bin] * 1e12;
                    assert!(
                        (found_ps - middle_ps).abs() < 60.0,
                        "{found_ps} {middle_ps}"
                    );
                }
            }
        }
    }

    /// By how much each edge of a line is found too late on average, ps: where each bin begins, and where the last one ends.
    fn bias_ps(sensor: &Sensor, profile: &BinProfile) -> Vec<f64> {
        let law = WindowLaw::new(sensor, &Exposure::new(sensor, STOP_PERIODS, 16));
        let mut late_ps = vec![0.0; sensor.bins + 1];
        for pixel in 0..sensor.pixels() {
            let law = law.of_macropixel(pixel as u32);
            for &start in &profile.starts {
                let edges = law.edges(&law.window(start).open().unwrap(), 0);
                let found_s = profile.edges_s(pixel, start);
                for ((late_ps, edge), found_s) in late_ps.iter_mut().zip(edges.edges()).zip(found_s)
                {
                    *late_ps += (found_s - edge.as_s()) * 1e12 / (2 * sensor.pixels()) as f64;
                }
            }
        }
        late_ps
    }

    /// Where the fullest bin decides, the first and the last bin are 28 ps too long, and 81 ps with 200 laser cycles.
    #[test]
    fn the_sweep_has_no_bias() {
        let few_columns = Sensor::from(SensorConfig {
            cols: 8,
            ..(*sensor()).clone()
        });
        let longer = Sweep {
            laser_cycles: 200,
            ..Sweep::default()
        };
        let of_longer = calibrate(&few_columns, STOP_PERIODS, &longer, || ()).unwrap();
        for (found, laser_cycles) in [
            (bias_ps(&sensor(), calibrated()), 16),
            (bias_ps(&few_columns, &of_longer.profile), 200),
        ] {
            assert!(
                found.iter().all(|late_ps| late_ps.abs() < 4.0),
                "{found:?} ps, {laser_cycles} laser cycles"
            );
        }
    }

    #[test]
    fn calibration_pays() {
        let (before, after) = (
            mean_and_sigma(&measured().before_m).1,
            mean_and_sigma(&measured().after_m).1,
        );
        assert!(after < 0.5 * before, "{before} {after}");
    }
}
