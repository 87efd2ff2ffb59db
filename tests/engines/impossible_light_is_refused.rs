//! Light that cannot be, and light that an engine cannot follow, is refused by name.

use guided_dtof::chip::{Exposure, SensorConfig};
use guided_dtof::engine::{
    Cohort, CohortOptions, EngineError, Expose, LitPixel, Window, full_stream, stream_config,
};
use guided_dtof::photon::{
    Echo, LightError, PhotonStream, PixelLight, Profile, PulseShape, SpadModel, SpadSpread,
    StreamConfig,
};
use guided_dtof::units::Time;

#[test]
fn what_an_engine_cannot_follow_it_refuses_by_name() {
    let config = SensorConfig::default();
    let exposure = Exposure::new(&config, 64, 10);
    let stream = PhotonStream::new(&stream_config(&config, &exposure, 1, Time::from_ns(2)));
    let pixels = |light| {
        [LitPixel {
            number: 0,
            start: 40,
            light: Some(light),
        }]
    };
    let light = PixelLight::echo(1.0, Time::from_ns(80));
    let spread = |spads: usize| SpadSpread::new(&vec![0.5; spads], &vec![1e5; spads]).unwrap();
    let cohort = Cohort::new(&config, &exposure, CohortOptions::default());
    let differing = pixels(light.clone().with_spads(spread(16)));
    let refused = cohort.expose(&stream, &differing).unwrap_err();
    assert!(
        refused.to_string().contains("SPADs that differ"),
        "{refused}"
    );
    let alike = LitPixel {
        light: Some(light.clone()),
        ..differing[0].clone()
    };
    let unequal = PhotonStream::new(&StreamConfig {
        spads: SpadModel {
            dead_time_spread: 0.1,
            ..stream.config().spads
        },
        ..stream.config().clone()
    });
    let refused = cohort.expose(&unequal, &[alike]).unwrap_err();
    assert!(
        refused.to_string().contains("SPADs that differ"),
        "{refused}"
    );
    let shape = PulseShape::new(Time::from_ns(1), &[0.0, 1.0]).unwrap();
    let echo = Echo::new(1.0, Time::from_ns(90)).with_shape(shape);
    let measured = pixels(light.clone().with_echo(echo));
    let refused = cohort.expose(&stream, &measured).unwrap_err();
    assert!(refused.to_string().contains("measured"), "{refused}");
    // A macropixel of another chip.
    let window = Window::new(&config, &exposure);
    let foreign = pixels(light.with_spads(spread(4)));
    let error = EngineError::OtherSpads {
        given: 4,
        spads: 16,
    };
    assert_eq!(window.expose(&stream, &foreign).unwrap_err(), error);
    let of_all = full_stream(&window, &stream, &foreign).unwrap_err();
    assert_eq!(of_all, error);
}

#[test]
fn light_that_cannot_be_is_refused() {
    let light = || PixelLight::background(1e6);
    let timeline = |segments: &[u32]| {
        let segments = segments.iter().map(|&cycle| (cycle, light()));
        PixelLight::timeline(segments).unwrap_err()
    };
    assert_eq!(timeline(&[]), LightError::NoSegment);
    assert_eq!(timeline(&[3]), LightError::LateStart(3));
    let order = LightError::Order { before: 5, next: 5 };
    assert_eq!(timeline(&[0, 5, 5]), order);
    let nested = PixelLight::timeline([(0, light()), (2, light())]).unwrap();
    let spread = SpadSpread::new(&[1.0], &[0.0]).unwrap();
    for segment in [nested, light().with_spads(spread)] {
        let refused = PixelLight::timeline([(0, segment)]);
        assert_eq!(refused.unwrap_err(), LightError::Nested);
    }
    let profile = |edges_ns: &[i64], rates: &[f64]| {
        let edges: Vec<Time> = edges_ns.iter().map(|&ns| Time::from_ns(ns)).collect();
        Profile::new(&edges, rates).unwrap_err()
    };
    let pieces = |rates, edges| LightError::Pieces { rates, edges };
    assert_eq!(profile(&[], &[]), pieces(0, 0));
    assert_eq!(profile(&[0, 1], &[1.0, 2.0]), pieces(2, 2));
    assert_eq!(profile(&[0, 4, 4], &[1.0, 2.0]), LightError::Edges);
    assert_eq!(profile(&[-1, 4], &[1.0]), LightError::Edges);
    assert_eq!(profile(&[0, 4], &[-1.0]), LightError::Rate(-1.0));
    assert!(matches!(profile(&[0, 4], &[f64::NAN]), LightError::Rate(hz) if hz.is_nan()));
    let spads = |factors: &[f64], dark: &[f64]| SpadSpread::new(factors, dark).unwrap_err();
    let counts = |factors, dark| LightError::Spads { factors, dark };
    assert_eq!(spads(&[], &[]), counts(0, 0));
    assert_eq!(spads(&[1.0], &[]), counts(1, 0));
    assert_eq!(
        spads(&[1.0, f64::INFINITY], &[0.0; 2]),
        LightError::Spad(f64::INFINITY)
    );
}
