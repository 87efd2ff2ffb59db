//! Whether a small change of a setting costs `window` much time: random sensors before random scenes, and what their light costs.
//!
//! `cargo bench --bench cliffs` draws 60 of them (`-- SEED` others) and prints the five with the highest cost. The cost is processor time of one
//! thread for each photon of the light: what shines on a macropixel in its exposure, drawn or not, and at least one a laser cycle.
//! The last line has the ratio of the highest cost to the median.

use cpu_time::ThreadTime;
use guided_dtof::chip::{EventType, Exposure, SensorConfig, WindowLaw};
use guided_dtof::engine::{LitPixel, Window, expose};
use guided_dtof::photon::PhotonStream;
use guided_dtof::scene::{GroundTruth, Scene};
use guided_dtof::system::photon_stream;
use guided_dtof::units::{Time, TimeOfFlight};
use rand::{RngExt, SeedableRng, rngs::StdRng};

const CASES: usize = 60;
const RUNS: usize = 2;
const PIXELS: usize = 4;
const LASER_CYCLES: u32 = 200;

/// Photons of a macropixel's light beyond which there are fewer laser cycles, but no fewer than [`FEWEST_CYCLES`].
const MOST_PHOTONS: f64 = 3e6;
const FEWEST_CYCLES: u32 = 20;

/// What takes longer is run once.
const LONG_S: f64 = 0.2;

/// A sensor before a scene.
struct Case {
    name: String,
    config: SensorConfig,
    exposure: Exposure,
    stream: PhotonStream,
    pixels: Vec<LitPixel>,
}

/// One of some values, all alike likely.
fn one_of<T: Copy>(random: &mut StdRng, values: &[T]) -> T {
    values[random.random_range(0..values.len())]
}

/// A number between two, its logarithm uniform.
fn between(random: &mut StdRng, from: f64, to: f64) -> f64 {
    from * (to / from).powf(random.random_range(0.0..1.0))
}

impl Case {
    /// Any sensor before the street, in any weather.
    fn random(random: &mut StdRng) -> Self {
        // The fewer macropixels a field of view has, the more light each gets.
        let side = one_of(random, &[16, 64]);
        let (spad_rows, spad_cols) = one_of(random, &[(4, 4), (4, 4), (2, 2), (8, 8), (1, 4)]);
        let secondaries = one_of(random, &[0.0, 0.0, 0.01, 0.05]);
        let config = SensorConfig {
            rows: side,
            cols: side,
            spad_rows,
            spad_cols,
            clk_hz: between(random, 100e6, 450e6).round(),
            dead_time_ns: between(random, 12.0, 200.0),
            paralysable: random.random_bool(0.4),
            afterpulse_probability: secondaries,
            crosstalk_probability: one_of(random, &[0.0, secondaries]),
            bins: one_of(random, &[8, 16, 16, 32]),
            event_type: EventType::Greater,
            threshold: one_of(random, &[0, 0, 1, 2]),
            ..SensorConfig::default()
        };
        let mut scene = Scene::outdoor();
        scene.lidar.pulse_energy_uj = between(random, 2.0, 5e3);
        scene.light.illuminance_klux = between(random, 0.1, 120.0);
        scene.medium.extinction_1_m = one_of(random, &[0.0, 0.0, 0.02, 0.1, 0.2]);
        let laser_cycle_s = between(random, 0.5e-6, 5e-6);
        let stop_periods = (laser_cycle_s * config.clk_hz).ceil() as u32;
        let mut exposure = Exposure::new(&config, stop_periods, LASER_CYCLES);
        let law = WindowLaw::new(&config, &exposure);
        let stream = photon_stream(&(&config).into(), &exposure, 1, &scene);
        let truth = GroundTruth::render(&scene, side as u32, side as u32);
        let spads = &stream.config().spads;
        let lights = scene.light_during(&truth, spads, LASER_CYCLES, stream.config().cycle_s());
        let pixels = (0..PIXELS).filter_map(|pixel| {
            let number = side * side / PIXELS * pixel + random.random_range(0..side);
            let range_m = between(random, 1.5, 60.0);
            Some(LitPixel {
                number: number as u32,
                start: law.start_for(Time::of_flight(range_m))?,
                light: Some(lights[number].clone()),
            })
        });
        let pixels: Vec<LitPixel> = pixels.collect();
        let lights = pixels.iter().filter_map(|pixel| pixel.light.as_ref());
        let of_cycle = lights.map(|light| stream.config().most_photons_per_cycle(light));
        let cycles = MOST_PHOTONS / of_cycle.fold(1.0, f64::max);
        exposure.laser_cycles = (cycles as u32).clamp(FEWEST_CYCLES, LASER_CYCLES);
        let stream = photon_stream(&(&config).into(), &exposure, 1, &scene);
        let name = format!(
            "{:.0} MHz, {} x {spad_rows}x{spad_cols} SPADs, {:.0} ns{}, {} bins, THRESHOLD {}, secondaries {:.2} and {:.2}, \
             {stop_periods} periods, {:.0} uJ, {:.1} klux, extinction {}",
            config.clk_hz / 1e6,
            side * side,
            config.dead_time_ns,
            if config.paralysable {
                " paralysable"
            } else {
                ""
            },
            config.bins,
            config.threshold,
            config.afterpulse_probability,
            config.crosstalk_probability,
            scene.lidar.pulse_energy_uj,
            scene.light.illuminance_klux,
            scene.medium.extinction_1_m,
        );
        Case {
            name,
            config,
            exposure,
            stream,
            pixels,
        }
    }

    /// Processor time for each photon of the light, ns, the least of some runs; `None` where the engine refuses it.
    fn cost_ns(&self) -> Option<f64> {
        let engine = Window::new(&self.config, &self.exposure);
        let lights = self.pixels.iter().filter_map(|pixel| pixel.light.as_ref());
        let of_cycle = |light| self.stream.config().most_photons_per_cycle(light).max(1.0);
        let photons = lights.map(of_cycle).sum::<f64>() * f64::from(self.exposure.laser_cycles);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        pool.expect("a thread").install(|| {
            let mut least_s = f64::INFINITY;
            for _ in 0..RUNS {
                let begin = ThreadTime::now();
                expose(&engine, &self.stream, &self.pixels, |_| ()).ok()?;
                least_s = least_s.min(begin.elapsed().as_secs_f64());
                if least_s > LONG_S {
                    break;
                }
            }
            Some(least_s * 1e9 / photons)
        })
    }
}

fn main() {
    let seed = std::env::args().filter_map(|word| word.parse().ok()).next();
    let random = &mut StdRng::seed_from_u64(seed.unwrap_or(1));
    let mut costs: Vec<(f64, String)> = Vec::new();
    let mut refused = 0;
    while costs.len() < CASES {
        let case = Case::random(random);
        match case.cost_ns() {
            Some(cost_ns) if !case.pixels.is_empty() => costs.push((cost_ns, case.name)),
            _ => refused += 1,
        }
    }
    costs.sort_by(|a, b| b.0.total_cmp(&a.0));
    println!("ns a photon of the light");
    for (cost_ns, name) in &costs[..5] {
        println!("{cost_ns:8.2}  {name}");
    }
    let median = costs[CASES / 2].0;
    println!(
        "{median:8.2}  median; the highest is {:.0} times as much; {refused} more are refused or have no window",
        costs[0].0 / median
    );
}
