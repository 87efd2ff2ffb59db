//! What ranging costs a macropixel: µs of processor time from histogram to place and bound, the best of five runs of each of 256 macropixels.
//!
//! `cargo bench --bench ranging` prints a line a kind of light and chip: the median, the 99th percentile and the longest. Signals and places
//! are spread evenly (signals by their logarithm) by a sequence without randomness; histograms are drawn by `cohort`. With the name of a file
//! every place and bound is written to it, so that two versions can be compared.

use std::fmt::Write;

use cpu_time::ThreadTime;
use guided_dtof_sensor::chip::{Exposure, SensorConfig, WindowLaw};
use guided_dtof_sensor::engine::{Cohort, CohortOptions, LitPixel, expose, stream_config};
use guided_dtof_sensor::photon::{PhotonStream, PixelLight};
use guided_dtof_sensor::ranging::{DepthOptions, EchoFinder};
use guided_dtof_sensor::units::{Time, TimeOfFlight};

const PIXELS: u32 = 256;
const RUNS: usize = 5;

struct LightKind {
    name: &'static str,
    config: SensorConfig,
    /// Standard deviation of the pulse, ps.
    sigma_ps: i64,
    /// Least and most photons of a laser cycle.
    signal: [f64; 2],
    background_hz: f64,
    /// Whether a second surface is in the window, with half of the light.
    is_double: bool,
}

fn kinds() -> Vec<LightKind> {
    let kind = |name, signal, background_hz| LightKind {
        name,
        config: SensorConfig::default(),
        sigma_ps: 1_911,
        signal,
        background_hz,
        is_double: false,
    };
    let with = |name, config, signal, background_hz| LightKind {
        config,
        ..kind(name, signal, background_hz)
    };
    let threshold = |threshold| SensorConfig {
        threshold,
        ..SensorConfig::default()
    };
    let four_bins = SensorConfig {
        bins: 4,
        ..SensorConfig::default()
    };
    let paralysable = SensorConfig {
        paralysable: true,
        ..SensorConfig::default()
    };
    let secondaries = SensorConfig {
        afterpulse_probability: 0.01,
        crosstalk_probability: 0.01,
        ..SensorConfig::default()
    };
    let short = |name, sigma_ps, signal, background_hz| LightKind {
        sigma_ps,
        ..kind(name, signal, background_hz)
    };
    vec![
        kind("0.1 to 3 photons", [0.1, 3.0], 8e6),
        kind("0.1 to 3 photons, in the dark", [0.1, 3.0], 0.0),
        kind("3 to 100 photons", [3.0, 100.0], 8e6),
        kind("1000 to 10 000 photons", [1e3, 1e4], 8e6),
        LightKind {
            is_double: true,
            ..kind("0.5 to 10 photons, two surfaces", [0.5, 10.0], 8e6)
        },
        with(
            "THRESHOLD 3, 3 to 30 photons",
            threshold(3),
            [3.0, 30.0],
            8e6,
        ),
        with(
            "THRESHOLD 3, 30 to 10 000 photons",
            threshold(3),
            [30.0, 1e4],
            8e6,
        ),
        with(
            "4 bins, 0.1 to 3 photons",
            four_bins.clone(),
            [0.1, 3.0],
            8e6,
        ),
        with("4 bins, 3 to 100 photons", four_bins, [3.0, 100.0], 8e6),
        short("pulses of 0.5 ns, 0.1 to 3 photons", 212, [0.1, 3.0], 8e6),
        short("pulses of 0.5 ns, 3 to 100 photons", 212, [3.0, 100.0], 8e6),
        short(
            "pulses of 2 ns, 0.3 to 30 photons, dark",
            849,
            [0.3, 30.0],
            0.0,
        ),
        with(
            "paralysable, 0.1 to 3 photons",
            paralysable.clone(),
            [0.1, 3.0],
            8e6,
        ),
        with(
            "paralysable, 30 to 10 000 photons",
            paralysable,
            [30.0, 1e4],
            8e6,
        ),
        with(
            "1 % secondaries, 0.1 to 10 photons",
            secondaries,
            [0.1, 10.0],
            8e6,
        ),
    ]
}

/// Histograms of the macropixels, and what finds their echoes.
fn exposed(kind: &LightKind) -> (EchoFinder, Vec<Vec<u32>>) {
    let config = SensorConfig {
        rows: 16,
        cols: 16,
        ..kind.config.clone()
    };
    let exposure = Exposure::new(&config, 520, 1000);
    let law = WindowLaw::new(&config, &exposure);
    let sigma = Time::from_ps(kind.sigma_ps);
    let start = law.start_for(Time::of_flight(60.0)).expect("a start value");
    let open = law.window(start).open().expect("a window that opens");
    let pixels: Vec<LitPixel> = (0..PIXELS)
        .map(|number| {
            let spread = |by: f64| (f64::from(number) * by).fract();
            let [least, most] = kind.signal;
            let signal = least * libm::pow(most / least, spread(0.618_033_988_749_894_9));
            let middle = (config.bins as f64 - 1.0) / 2.0;
            let place = middle * (0.5 + spread(0.754_877_666_246_692_7));
            let echo = PixelLight::echo(signal, law.time_of(&open, place));
            let mut light = echo.with_background(kind.background_hz);
            if kind.is_double {
                let behind = law.time_of(&open, place + 5.0);
                light =
                    light.with_echo(guided_dtof_sensor::photon::Echo::new(0.5 * signal, behind));
            }
            LitPixel {
                number,
                start,
                light: Some(light),
            }
        })
        .collect();
    let stream = PhotonStream::new(&stream_config(&config, &exposure, 1, sigma));
    let engine = Cohort::new(&config, &exposure, CohortOptions::default());
    let exposed = expose(&engine, &stream, &pixels, |_| ()).expect("no refusal");
    let real = |counts: &[u16]| counts.iter().copied().map(u32::from).collect();
    let counts = exposed.histograms.iter().map(real).collect();
    let finder = EchoFinder::new(&law, sigma, &DepthOptions::default()).expect("equal bins");
    (finder, counts)
}

fn main() {
    let file = std::env::args().skip(1).find(|word| !word.starts_with('-'));
    let mut places = String::new();
    println!(
        "{:42} {:>8} {:>8} {:>8}  with a bound",
        "us a macropixel", "median", "99 %", "longest"
    );
    for kind in kinds() {
        let (finder, histograms) = exposed(&kind);
        let mut times = vec![f64::INFINITY; histograms.len()];
        let mut sightings = vec![None; histograms.len()];
        // Each run goes through all of them: what ranging keeps of the last histogram is of no use for the next one.
        for _ in 0..RUNS {
            for (number, counts) in histograms.iter().enumerate() {
                let begin = ThreadTime::now();
                sightings[number] = std::hint::black_box(finder.find(counts));
                times[number] = times[number].min(begin.elapsed().as_secs_f64() * 1e6);
            }
        }
        let mut bounded = 0;
        for (number, sighting) in sightings.iter().enumerate() {
            let place = sighting.map(|s| (s.position_bins, s.bound_bins, s.walk_left));
            bounded += usize::from(place.is_some_and(|place| place.1.is_some()));
            writeln!(places, "{};{number};{place:?}", kind.name).expect("text");
        }
        times.sort_by(f64::total_cmp);
        let quantile = |share: f64| times[(share * (times.len() - 1) as f64) as usize];
        println!(
            "{:42} {:8.1} {:8.1} {:8.1}  {bounded}",
            kind.name,
            quantile(0.5),
            quantile(0.99),
            quantile(1.0)
        );
    }
    if let Some(file) = file {
        std::fs::write(file, places).expect("a file to write");
    }
}
