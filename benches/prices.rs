//! What a macropixel costs on the window engine and on the cohort engine in ever more light, beside the prices with which
//! `gdtof frame --tolerance` chooses between them (`crates/lidar/src/system/price.rs`).
//!
//! `cargo bench --bench prices` prints a line a light: processor time of one thread in microseconds a macropixel, the least
//! of some runs of some macropixels; `cohort` is its bound on the depth error and its histogram.

use cpu_time::ThreadTime;
use guided_dtof::chip::{Exposure, SensorConfig, WindowLaw};
use guided_dtof::engine::{Cohort, CohortOptions, Expose, LitPixel, Window, stream_config};
use guided_dtof::photon::{PhotonStream, PixelLight};
use guided_dtof::system::price;
use guided_dtof::units::Time;

const RUNS: usize = 3;
const PIXELS: u16 = 16;

/// CLK periods of a laser cycle, and laser cycles. The first is hardly longer than a window: all of it is drawn.
const EXPOSURES: [(u32, u32); 3] = [(24, 1_000), (520, 1_000), (520, 16_000)];
const BACKGROUNDS_HZ: [f64; 7] = [1e5, 1e6, 8e6, 30e6, 100e6, 400e6, 1600e6];
const SIGNALS: [f64; 6] = [0.0, 0.02, 0.3, 2.0, 10.0, 60.0];

/// Least processor time of `run`, µs a macropixel.
fn least_us(mut run: impl FnMut()) -> f64 {
    let times = (0..RUNS).map(|_| {
        let begin = ThreadTime::now();
        run();
        begin.elapsed().as_secs_f64() * 1e6 / f64::from(PIXELS)
    });
    times.fold(f64::INFINITY, f64::min)
}

fn main() {
    let config = SensorConfig::default();
    println!("periods cycles Mcounts/s signal |   window  estimate |  bound  histogram  estimate");
    for (stop_periods, laser_cycles) in EXPOSURES {
        let exposure = Exposure::new(&config, stop_periods, laser_cycles);
        let stream = stream_config(&config, &exposure, 1, Time::from_ps(1_900));
        let stream = PhotonStream::new(&stream);
        let law = WindowLaw::new(&config, &exposure);
        let window = Window::new(&config, &exposure);
        let with_error = |error| {
            let options = CohortOptions {
                error,
                ..CohortOptions::default()
            };
            Cohort::new(&config, &exposure, options)
        };
        let cohort = with_error(CohortOptions::default().error);
        let exact = with_error(0.001);
        for background_hz in BACKGROUNDS_HZ {
            for signal_per_cycle in SIGNALS {
                let pixels: Vec<LitPixel> = (0..PIXELS)
                    .map(|number| {
                        let start = ((stop_periods as u16 - 17) / PIXELS * number).min(510);
                        let open = law.window(start).open().expect("a window that opens");
                        let light = PixelLight::echo(
                            signal_per_cycle,
                            law.time_of(&open, 7.0 + f64::from(number) / 16.0),
                        )
                        .with_background(background_hz);
                        LitPixel {
                            number: number.into(),
                            start,
                            light: Some(light),
                        }
                    })
                    .collect();
                let lit = || {
                    let lit = pixels.iter().map(|pixel| (pixel, pixel.light.as_ref()));
                    lit.map(|(pixel, light)| (pixel, light.expect("lit above")))
                };
                let window_us = least_us(|| {
                    window.expose(&stream, &pixels).expect("no refusal");
                });
                let window_ns: f64 = lit()
                    .map(|(pixel, light)| price::window_ns(&window, &config, &stream, pixel, light))
                    .sum();
                let estimate_us = window_ns / 1e3 / f64::from(PIXELS);
                print!(
                    "{stop_periods:7} {laser_cycles:6} {:9} {signal_per_cycle:6} | {window_us:8.1}  {estimate_us:8.1} |",
                    background_hz / 1e6
                );
                let prices_ns = lit()
                    .map(|(pixel, light)| price::cohort_ns(&cohort, &stream, pixel.start, light));
                let Ok(prices_ns) = prices_ns.collect::<Result<Vec<f64>, _>>() else {
                    println!(" refused");
                    continue;
                };
                let bound_us = least_us(|| {
                    for (pixel, light) in lit() {
                        for cohort in [&cohort, &exact] {
                            let _ = cohort.expected(stream.config(), pixel.start, light);
                        }
                    }
                });
                let draw_us = least_us(|| {
                    for (pixel, light) in lit() {
                        let _ = cohort.draw(stream.config(), pixel.number, pixel.start, light);
                    }
                });
                let estimate_us = prices_ns.iter().sum::<f64>() / 1e3 / f64::from(PIXELS);
                println!(" {bound_us:6.1}   {draw_us:8.1}  {estimate_us:8.1}");
            }
        }
    }
}
