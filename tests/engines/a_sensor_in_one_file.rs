//! Chips that differ from the QuantIC4x4 in every number run on all engines, each from one description: one made up,
//! HSLIDAR, whose windows step by four CLK periods, and the flash lidar's with 32 bins.

use crate::wide8x8::wide8x8;

use guided_dtof::chip::{Exposure, Sensor, SensorConfig, Tdc, WindowLaw, hslidar, vcsel_flash};
use guided_dtof::engine::{
    Cohort, CohortOptions, Cycle, Expose, Gate, LitPixel, Window, full_stream, stream_config,
};
use guided_dtof::photon::{PhotonStream, PixelLight};
use guided_dtof::units::Time;

fn sensors() -> [Sensor; 3] {
    [wide8x8().unwrap(), hslidar(), vcsel_flash()]
}

/// CLK periods of a laser cycle in which every window opens.
fn stop_periods(sensor: &Sensor) -> u32 {
    128 * sensor.step_periods as u32 + 12
}

/// Light on windows all over the laser cycle.
fn pixels(law: &WindowLaw, signal_per_cycle: f64) -> Vec<LitPixel> {
    let middle_bins = 0.4 * law.sensor().bins as f64;
    let largest = law.sensor().largest_start();
    let starts = [0u16, 5, 40, largest * 3 / 5, largest - 1];
    (0..)
        .zip(starts)
        .map(|(number, start)| {
            let window = law.window(start).open().expect("it opens");
            let arrival = law.time_of(&window, middle_bins);
            LitPixel {
                number,
                start,
                light: Some(PixelLight::echo(signal_per_cycle, arrival).with_background(200e6)),
            }
        })
        .collect()
}

#[test]
fn gate_cycle_and_window_count_the_same() {
    for sensor in sensors() {
        let exposure = Exposure::new(&sensor, stop_periods(&sensor), 12);
        let stream = stream_config(&sensor, &exposure, 3, Time::from_ps(1_500));
        let stream = PhotonStream::new(&stream);
        let pixels = pixels(&WindowLaw::new(&sensor, &exposure), 12.0);
        let gate = full_stream(&Gate::new(&sensor, &exposure), &stream, &pixels).unwrap();
        let cycle = full_stream(&Cycle::new(&sensor, &exposure), &stream, &pixels).unwrap();
        let window = Window::new(&sensor, &exposure);
        let window = window.expose(&stream, &pixels).unwrap();
        assert_eq!(gate.histograms, cycle.histograms);
        assert_eq!(gate.histograms, window.histograms);
        assert_eq!(gate.histograms.bins(), sensor.bins);
        let counted: u32 = gate.histograms.counts().iter().map(|&n| u32::from(n)).sum();
        assert!(counted > 60, "{counted} events are few to compare");
    }
}

#[test]
fn windows_of_hslidar_step_by_half_a_window() {
    let sensor = hslidar();
    let exposure = Exposure::new(&sensor, stop_periods(&sensor), 2);
    let law = WindowLaw::new(&sensor, &exposure);
    let seen = |start| law.interval(&law.window(start).open().expect("it opens"));
    for start in 1..=sensor.largest_start() {
        let (before, now) = (seen(start - 1), seen(start));
        assert_eq!(now.start - before.start, Time::from_ns(20));
        assert_eq!(before.end - now.start, Time::from_ns(20));
    }
}

/// Means of 40 seeds, whose standard error is below 0.6 counts where most are counted.
#[test]
fn cohort_counts_the_same_on_average() {
    let [wide8x8, hslidar, vcsel_flash] = sensors();
    // A counter TDC is none for cohorts.
    let shift_register = SensorConfig {
        tdc: Tdc::Clocked,
        ..(*hslidar).clone()
    };
    [wide8x8, shift_register.into(), vcsel_flash]
        .iter()
        .for_each(cohort_agrees);
}

fn cohort_agrees(sensor: &Sensor) {
    const SEEDS: u64 = 40;
    let exposure = Exposure::new(sensor, stop_periods(sensor), 30);
    let pixels = pixels(&WindowLaw::new(sensor, &exposure), 6.0);
    let window = Window::new(sensor, &exposure);
    let cohort = Cohort::new(sensor, &exposure, CohortOptions::default());
    let mut sums = vec![[0.0f64; 2]; pixels.len() * sensor.bins];
    let mut squares = sums.clone();
    for seed in 0..SEEDS {
        let stream = stream_config(sensor, &exposure, seed, Time::from_ps(1_500));
        let stream = PhotonStream::new(&stream);
        let seen = [
            window.expose(&stream, &pixels).unwrap(),
            cohort.expose(&stream, &pixels).unwrap(),
        ];
        for (engine, exposed) in seen.iter().enumerate() {
            for (at, &count) in exposed.histograms.counts().iter().enumerate() {
                sums[at][engine] += f64::from(count);
                squares[at][engine] += f64::from(count).powi(2);
            }
        }
    }
    let seeds = SEEDS as f64;
    for (sums, squares) in sums.iter().zip(&squares) {
        let mean = sums.map(|sum| sum / seeds);
        let variance = |engine: usize| (squares[engine] / seeds - mean[engine].powi(2)).max(0.0);
        let error = ((variance(0) + variance(1)) / seeds).sqrt();
        let off = (mean[0] - mean[1]).abs();
        assert!(off < 5.0 * error + 0.2, "{mean:?} ± {error}");
    }
}
