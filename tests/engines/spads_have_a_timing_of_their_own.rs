//! Jitter, late avalanches and dead times: engines count the same photons, or refuse by name; zero changes nothing.

use guided_dtof::chip::{Exposure, Sensor, SensorConfig, WindowLaw};
use guided_dtof::engine::{
    Cohort, CohortOptions, Cycle, EngineError, Expose, Gate, Histograms, LitPixel, NotModelled,
    Window, expose,
};
use guided_dtof::photon::PixelLight;
use guided_dtof::scene::{GroundTruth, Scene};
use guided_dtof::system::photon_stream;
use guided_dtof::units::{Time, TimeOfFlight};

const RANGE_M: f64 = 20.0;

/// A wall all around before four macropixels in the sun, with these keys of the lidar.
fn scene(lidar: &str) -> Scene {
    let text = format!(
        "[lidar]\nfov_deg = 0.5\npulse_fwhm_ns = 0.5\npulse_energy_uj = 5e-4\n{lidar}\n[[object]]\nname = \"wall\"\nkind = \"sphere\"\ncentre_m = [0, 0, 0]\nradius_m = {RANGE_M}\nreflectivity = 0.5\n"
    );
    Scene::parse("test", &text).unwrap()
}

struct Bench {
    sensor: Sensor,
    exposure: Exposure,
    scene: Scene,
    seed: u64,
}

impl Bench {
    fn new(lidar: &str, laser_cycles: u32, seed: u64) -> Self {
        Self::with_config(SensorConfig::default(), lidar, laser_cycles, seed)
    }

    fn with_config(config: SensorConfig, lidar: &str, laser_cycles: u32, seed: u64) -> Self {
        let config = SensorConfig {
            rows: 2,
            cols: 2,
            ..config
        };
        let exposure = Exposure::new(&config, 80, laser_cycles);
        let sensor = Sensor::new(config).unwrap();
        Bench {
            sensor,
            exposure,
            scene: scene(lidar),
            seed,
        }
    }

    fn counts(&self, engine: &impl Expose) -> Result<Histograms, EngineError> {
        let stream = photon_stream(&self.sensor, &self.exposure, self.seed, &self.scene);
        let truth = GroundTruth::render(&self.scene, 2, 2);
        let law = WindowLaw::new(&self.sensor, &self.exposure);
        let start = law.start_for(Time::of_flight(RANGE_M)).unwrap();
        let lights: Vec<PixelLight> = self.scene.pixel_light(&truth);
        let lit = |(number, light)| LitPixel {
            number,
            start,
            light: Some(light),
        };
        let pixels: Vec<LitPixel> = (0..).zip(lights).map(lit).collect();
        expose(engine, &stream, &pixels, |_| {}).map(|exposed| exposed.histograms)
    }

    fn by_window(&self) -> Histograms {
        self.counts(&Window::new(&self.sensor, &self.exposure))
            .unwrap()
    }
}

const TIMINGS: [&str; 3] = [
    "spad_jitter_fwhm_ps = 3000",
    "spad_tail_share = 0.4\nspad_tail_ps = 2500",
    "spad_jitter_fwhm_ps = 800\nspad_tail_share = 0.1\nspad_tail_ps = 500\npulse = [[0, 0.0], [1, 1.0], [3, 0.0]]",
];

#[test]
fn which_gate_cycle_and_window_count_alike() {
    let usual = Bench::new("", 40, 3).by_window();
    for lidar in TIMINGS {
        let bench = Bench::new(lidar, 40, 3);
        let (sensor, exposure) = (&bench.sensor, &bench.exposure);
        let by_window = bench.by_window();
        assert_ne!(by_window, usual, "{lidar}");
        assert_eq!(
            bench.counts(&Gate::new(sensor, exposure)).unwrap(),
            by_window,
            "{lidar}"
        );
        assert_eq!(
            bench.counts(&Cycle::new(sensor, exposure)).unwrap(),
            by_window,
            "{lidar}"
        );
    }
}

#[test]
fn unequal_dead_times_count_alike_or_are_refused() {
    let alike = SensorConfig {
        dead_time_ns: 20.0,
        ..SensorConfig::default()
    };
    let paralysable = SensorConfig {
        paralysable: true,
        ..alike.clone()
    };
    let with_secondaries = SensorConfig {
        afterpulse_probability: 0.1,
        crosstalk_probability: 0.1,
        ..alike.clone()
    };
    // Of the sun's light and of an echo that blinds; drawn by laser cycle where it is strong.
    for pulse_energy_uj in [5e-4, 0.02] {
        let bench = |config: SensorConfig| {
            let mut bench = Bench::with_config(config, "", 200, 3);
            bench.scene.lidar.pulse_energy_uj = pulse_energy_uj;
            bench
        };
        for config in [&alike, &paralysable, &with_secondaries] {
            let usual = bench(config.clone()).by_window();
            let spread = |dead_time_seed| {
                bench(SensorConfig {
                    dead_time_spread: 0.2,
                    dead_time_seed,
                    ..config.clone()
                })
            };
            let bench = spread(1);
            let (sensor, exposure) = (&bench.sensor, &bench.exposure);
            let by_window = bench.by_window();
            assert_ne!(by_window, usual);
            assert_ne!(by_window, spread(2).by_window());
            let by_gate = bench.counts(&Gate::new(sensor, exposure)).unwrap();
            assert_eq!(by_gate, by_window);
            let by_cycle = bench.counts(&Cycle::new(sensor, exposure)).unwrap();
            assert_eq!(by_cycle, by_window);
            let cohort = Cohort::new(sensor, exposure, CohortOptions::default());
            let refusal = EngineError::NotInCohorts(NotModelled::SpadsThatDiffer);
            assert_eq!(bench.counts(&cohort).unwrap_err(), refusal);
        }
    }
}

#[test]
fn which_cohort_follows_or_refuses() {
    for (lidar, follows) in TIMINGS.into_iter().zip([true, false, false]) {
        let bench = Bench::new(lidar, 4000, 5);
        let cohort = Cohort::new(&bench.sensor, &bench.exposure, CohortOptions::default());
        match bench.counts(&cohort) {
            Ok(drawn) => {
                assert!(follows, "{lidar}");
                // Sums of four macropixels, five standard deviations of a difference.
                let [drawn, counted] = [drawn, bench.by_window()].map(|histograms| {
                    let mut sums = [0u32; 16];
                    for counts in histograms.iter() {
                        let bins = sums.iter_mut().zip(counts);
                        bins.for_each(|(sum, &count)| *sum += u32::from(count));
                    }
                    sums
                });
                for (a, b) in drawn.into_iter().zip(counted) {
                    let most = 5.0 * f64::from(a + b).sqrt() + 5.0;
                    assert!(f64::from(a.abs_diff(b)) < most, "{drawn:?} {counted:?}");
                }
            }
            Err(refusal) => {
                assert!(!follows, "{lidar}");
                let expected = EngineError::NotInCohorts(NotModelled::MeasuredPulse);
                assert_eq!(refusal, expected);
            }
        }
    }
}

#[test]
fn which_is_none_by_default() {
    let zero = "spad_jitter_fwhm_ps = 0\nspad_tail_share = 0\nspad_tail_ps = 0\npulse_energy_drift_1_k = 0";
    let [given, usual] = [zero, ""].map(|lidar| Bench::new(lidar, 200, 7));
    assert_eq!(given.scene, usual.scene);
    let stream = |bench: &Bench| {
        let stream = photon_stream(&bench.sensor, &bench.exposure, 7, &bench.scene);
        stream.config().clone()
    };
    assert_eq!(stream(&given), stream(&usual));
    assert_eq!(stream(&usual).pulse_shape, None);
}
