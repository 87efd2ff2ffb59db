//! The comparison of engines finds exact engines exact and the others as far off as they are, and a frame with a
//! depth tolerance keeps it.

use std::process::Command;

use guided_dtof::chip::{Exposure, Sensor, SensorConfig, WindowLaw};
use guided_dtof::engine::{LitPixel, Window, expose, stream_config};
use guided_dtof::photon::{Convention, PhotonStream, PixelLight};
use guided_dtof::ranging::PeakOptions;
use guided_dtof::scene::Scene;
use guided_dtof::system::Tolerance;
use guided_dtof::system::pareto::{Done, Method, ParetoPoint, ParetoSettings, summarise};
use guided_dtof::units::Time;

fn compare(methods: &[Method]) -> Vec<ParetoPoint> {
    // With π times the light the cohort engine refuses the brighter wall: SPADs stay busy from one laser cycle to the next.
    let mut scene = Scene::outdoor();
    scene.lidar.convention = Convention::Thesis;
    let settings = ParetoSettings {
        sensor: Sensor::from(SensorConfig {
            rows: 8,
            cols: 8,
            ..SensorConfig::default()
        }),
        scene,
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
    let (mut walls, mut rows) = (0, Vec::new());
    let told = |done: Done<'_>| match done {
        Done::Wall => walls += 1,
        Done::Method(points) => rows.extend_from_slice(points),
    };
    let points = settings.compare(methods, told).unwrap();
    assert_eq!(settings.cell_count(), 2);
    assert_eq!(points.len(), 2 * methods.len());
    assert_eq!(walls, settings.run_count(methods));
    assert_eq!(rows, points, "rows are told of as they are finished");
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
        Method::Cohort,
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
    for (method, points) in methods.iter().zip(points.chunks(2)) {
        let summary = summarise(points).unwrap();
        assert_eq!(summary.method, *method);
        let rms: Vec<f64> = points.iter().filter_map(|p| p.errors.depth_rms_m).collect();
        let largest = rms.iter().copied().reduce(f64::max);
        assert_eq!(summary.worst.depth_rms_m, largest);
        assert!(summary.depth_rms_m <= largest && summary.speed_up >= summary.worst.speed_up);
        let worst = points.iter().find(|p| p.errors.depth_rms_m == largest);
        if largest > Some(0.0) {
            assert_eq!(
                summary.worst.illuminance_klux,
                worst.map(|p| p.illuminance_klux)
            );
        } else {
            assert_eq!(summary.worst.range_m, None);
        }
    }
    assert_eq!(summarise(&points[6..8]).unwrap().depth_rms_m, Some(0.0));
    assert!(summarise(&points[10..12]).unwrap().depth_rms_m.unwrap() > 0.0);
}

/// Rows come out one after the other, and what each one's difference is stands in it; messages are lines, no bar.
#[test]
fn a_piped_comparison_says_how_far_it_is_and_what_differs() {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_gdtof"))
        .args([
            "pareto",
            "--no-gate",
            "--ranges",
            "20",
            "--klux",
            "0,50",
            "--macropixels",
            "16",
        ])
        .args(["--laser-cycles", "40", "--repeats", "1", "--out", "out"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    let table = String::from_utf8(output.stdout).unwrap();
    for (row, against) in [
        ("cycle ", "the reference"),
        ("window ", "same photons"),
        ("window, another seed", "another seed"),
        ("window, 1/8 of the laser cycles", "1/8 of the photons"),
        ("cohort  ", "own draws  "),
    ] {
        let line = table.lines().find(|line| line.starts_with(row));
        let line = line.unwrap_or_else(|| panic!("no row {row}: {table}"));
        assert!(line.contains(against) && line.contains(" / "), "{line}");
    }
    assert!(!table.lines().any(|line| line.starts_with("gate")));
    let messages = String::from_utf8(output.stderr).unwrap();
    assert_eq!(messages, "");
}

/// A row of macropixels at 384 MHz in ever brighter light, echo in the middle of each window.
fn lit(sensor: &Sensor, exposure: &Exposure) -> (PhotonStream, Vec<LitPixel>) {
    let law = WindowLaw::new(sensor, exposure);
    let stream = stream_config(sensor, exposure, 5, Time::from_ps(1_900));
    let pixels = (0..40).map(|number| {
        let start = 60 + number * 5;
        let window = law.window(start).open().unwrap();
        LitPixel {
            number: number.into(),
            start,
            light: (number % 8 != 7).then(|| {
                PixelLight::echo(
                    0.02 * 1.2f64.powi(number.into()),
                    law.time_of(&window, 6.0 + 0.1 * f64::from(number)),
                )
                .with_background(1e5 * 1.2f64.powi(number.into()))
            }),
        }
    });
    (PhotonStream::new(&stream), pixels.collect())
}

#[test]
fn a_tolerance_is_kept_by_the_cheapest_engine() {
    let sensor = Sensor::default();
    let exposure = Exposure::new(&sensor, 520, 16_000);
    let (stream, pixels) = lit(&sensor, &exposure);
    let peak = PeakOptions::default();
    let within = |tolerance_m| {
        let tolerance = Tolerance {
            tolerance_m,
            sensor: &sensor,
            exposure: &exposure,
            peak: &peak,
        };
        tolerance.expose(&stream, &pixels, |_| ()).unwrap()
    };
    let exact = expose(&Window::new(&sensor, &exposure), &stream, &pixels, |_| ()).unwrap();

    let (strict, kept) = within(0.0);
    assert_eq!(strict.histograms, exact.histograms);
    assert_eq!((kept.bound_m, kept.on_window), (0.0, pixels.len()));

    let mut on_window = pixels.len();
    for tolerance_m in [1e-6, 1e-4, 1e-2] {
        let (exposed, kept) = within(tolerance_m);
        assert!(kept.bound_m <= tolerance_m, "{kept:?}");
        assert_eq!(kept.on_window + kept.on_cohort, pixels.len());
        assert!(kept.on_window <= on_window, "{kept:?}");
        on_window = kept.on_window;
        assert_eq!(exposed.histograms.len(), pixels.len());
        assert!(exposed.work.photons_drawn <= exact.work.photons_drawn);
    }
    // In 16 000 laser cycles `cargo bench --bench prices` finds the window engine cheaper up to 0.3 signal photons and
    // the cohort engine, its bound included, from 2 on: number 15 and number 25 here. The dark ones behind stay, too.
    assert!((19..28).contains(&on_window), "{on_window}");
}
