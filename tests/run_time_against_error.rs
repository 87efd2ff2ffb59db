//! The comparison of engines finds exact engines exact and the others as far off as they are, and a frame with a
//! depth tolerance keeps it.

use guided_dtof::chip::{Exposure, SensorConfig, WindowLaw};
use guided_dtof::engine::{LitPixel, Window, expose, stream_config};
use guided_dtof::photon::{PhotonStream, PixelLight};
use guided_dtof::ranging::PeakOptions;
use guided_dtof::scene::Scene;
use guided_dtof::system::Tolerance;
use guided_dtof::system::pareto::{Method, ParetoSettings, Point, summarise};
use guided_dtof::units::Time;

fn compare(methods: &[Method]) -> Vec<Point> {
    let settings = ParetoSettings {
        sensor: SensorConfig {
            rows: 8,
            cols: 8,
            ..SensorConfig::default()
        },
        scene: Scene::outdoor(),
        stop_periods: 120,
        laser_cycles: 40,
        // The second is out of reach of a laser cycle of 120 CLK periods.
        ranges_m: vec![20.0, 100.0],
        illuminances_klux: vec![0.0, 50.0],
        reflectivity: 0.5,
        macropixels: 32,
        repeats: 1,
        seed: 3,
    };
    let mut runs = 0;
    let points = settings.compare(methods, || runs += 1).unwrap();
    assert_eq!(settings.cell_count(), 2);
    assert_eq!(points.len(), 2 * methods.len());
    assert_eq!(runs, points.len());
    points
}

#[test]
fn engines_that_share_photons_do_not_differ_and_others_do() {
    let methods = [
        Method::Gate,
        Method::Cycle,
        Method::WindowWithoutSkipping,
        Method::Window,
        Method::AnotherSeed,
        Method::FewerCycles(8),
        Method::Cohort(2),
    ];
    let points = compare(&methods);
    for point in &points {
        let errors = &point.errors;
        let exact = methods[..4].contains(&point.method);
        assert_eq!(errors.mismatch == 0.0, exact, "{point:?}");
        assert_eq!(errors.mean_shift == 0.0, exact, "{point:?}");
        // Two exact methods without common photons are √(2 / 32) = 0.25 apart; the echo's bins weigh little.
        assert!(errors.mean_shift < 1.0, "{point:?}");
        assert!(point.run_time_ns > 0.0 && point.speed_up.is_finite());
    }
    let summaries = summarise(&methods, &points);
    assert_eq!(summaries.len(), methods.len());
    assert_eq!(summaries[3].depth_rms_m, Some(0.0));
    assert!(summaries[5].depth_rms_m.unwrap() > 0.0);
}

/// A row of macropixels at 384 MHz in ever brighter light, echo in the middle of each window.
fn lit(config: &SensorConfig, exposure: &Exposure) -> (PhotonStream, Vec<LitPixel>) {
    let law = WindowLaw::new(config, exposure);
    let stream = stream_config(config, exposure, 5, Time::from_ps(1_900));
    let pixels = (0..40).map(|number| {
        let start = 60 + number * 5;
        let window = law.window(start).open().unwrap();
        LitPixel {
            number: number.into(),
            start,
            light: (number % 8 != 7).then(|| PixelLight {
                signal_per_cycle: 0.02 * 1.2f64.powi(number.into()),
                arrival: law.time_of(&window, 6.0 + 0.1 * f64::from(number)),
                background_hz: 1e5 * 1.2f64.powi(number.into()),
            }),
        }
    });
    (PhotonStream::new(&stream), pixels.collect())
}

#[test]
fn a_tolerance_is_kept_by_the_cheapest_engine() {
    let config = SensorConfig::default();
    let exposure = Exposure::new(&config, 520, 16_000);
    let (stream, pixels) = lit(&config, &exposure);
    let peak = PeakOptions::default();
    let within = |tolerance_m| {
        let tolerance = Tolerance {
            tolerance_m,
            config: &config,
            exposure: &exposure,
            peak: &peak,
        };
        tolerance.expose(&stream, &pixels, |_| ()).unwrap()
    };
    let exact = expose(&Window::new(&config, &exposure), &stream, &pixels, |_| ()).unwrap();

    let (strict, kept) = within(0.0);
    assert_eq!(strict.histograms, exact.histograms);
    assert_eq!((kept.bound_m, kept.on_window), (0.0, pixels.len()));

    let mut on_window = pixels.len();
    for tolerance_m in [1e-6, 1e-4, 1e-2] {
        let (exposed, kept) = within(tolerance_m);
        assert!(kept.bound_m <= tolerance_m, "{kept:?}");
        assert_eq!(
            kept.on_window + kept.on_cohort.iter().sum::<usize>(),
            pixels.len()
        );
        assert!(kept.on_window <= on_window, "{kept:?}");
        on_window = kept.on_window;
        assert_eq!(exposed.histograms.len(), pixels.len());
        assert!(exposed.work.photons_drawn <= exact.work.photons_drawn);
    }
    // What has no light stays where it costs nothing; nearly all else has gone.
    assert!((5..15).contains(&on_window), "{on_window}");
}
