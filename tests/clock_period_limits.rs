//! The shortest CLK period that static timing allows is the one at which the gates still count right.

use guided_dtof::chip::SensorConfig;
use guided_dtof::engine::timing::{MacropixelTiming, gate_works, shortest_period};
use guided_dtof::netlist::{Corner, Library, Mismatch, Netlist, Timing, varied};
use guided_dtof::units::Time;

fn delays(mismatch: Option<Mismatch>) -> impl Fn(&Netlist) -> Timing {
    move |netlist| {
        let nominal = Timing::nominal(netlist, &Library::default(), Corner::Typ);
        varied(netlist, &nominal, 1.0, mismatch)
    }
}

/// Shortest period with STOP on CLK's fall, by paths and by gates.
fn limits(mismatch: Option<Mismatch>) -> (Time, Time) {
    let (config, delays) = (SensorConfig::default(), delays(mismatch));
    let pixel = MacropixelTiming::of(&config, &delays);
    let slow = Time::from_ns(20);
    let by_paths = shortest_period(slow, |p| pixel.works(p, Time::ZERO)).unwrap();
    let by_gates = shortest_period(slow, |p| gate_works(&config, &delays, p, Time::ZERO)).unwrap();
    (by_paths, by_gates)
}

#[test]
fn the_typical_corner_has_the_published_ripple_and_period() {
    let (by_paths, by_gates) = limits(None);
    assert_eq!(by_paths, by_gates);
    assert!((by_paths.as_ns() - 2.4).abs() < 0.05, "{by_paths}");
    let pixel = MacropixelTiming::of(&SensorConfig::default(), &delays(None));
    assert!((pixel.ripple.delay().as_ns() - 1.2).abs() < 0.01);
    assert!(pixel.reset_width() > pixel.reset_to_stage_clock.max(pixel.reset_to_counter_clk));
}

#[test]
fn paths_are_never_optimistic_under_mismatch() {
    for seed in 0..6 {
        let (by_paths, by_gates) = limits(Some(Mismatch { sigma: 0.1, seed }));
        assert!(by_gates <= by_paths, "seed {seed}: {by_gates} > {by_paths}");
        assert!(by_paths - by_gates < Time::from_ps(150), "seed {seed}");
    }
}
