//! Every TYPE and mode, windows at both ends of a laser cycle, counters that overflow.

use guided_dtof::chip::{
    EventType, Exposure, Mode, Overflow, SensorConfig, WindowLaw, hslidar_delay_line,
};
use guided_dtof::engine::{Cohort, CohortOptions, EngineError, NotModelled, stream_config};
use guided_dtof::photon::PixelLight;
use guided_dtof::units::Time;

use super::comparison::{Case, case};
use super::ways::options;

#[test]
fn coincidences_of_each_type() {
    let light = PixelLight::echo(4.0, case().light.arrival()).with_background(150e6);
    for (event_type, threshold, neglect) in [
        (EventType::Greater, 1, 0.0),
        (EventType::Greater, 1, 1.0),
        (EventType::Equal, 1, 0.0),
        (EventType::Less, 2, 0.0),
        (EventType::Less, 1, 1.0),
    ] {
        let sensor = SensorConfig {
            event_type,
            threshold,
            ..SensorConfig::default()
        };
        let name = format!("{event_type:?} {threshold}, neglect {neglect}");
        let options = options(neglect);
        Case {
            name: &name,
            sensor,
            light: light.clone(),
            options,
            stop_periods: 120,
            laser_cycles: 30,
            ..case()
        }
        .agrees();
    }
}

#[test]
fn macropixels_of_other_sizes() {
    for (side, threshold, signal, neglect) in [
        (2, 0, 1.0, 0.0),
        (2, 1, 1.0, 1.0),
        (8, 0, 1.0, 1.0),
        (8, 2, 8.0, 0.0),
        (1, 0, 0.2, 1.0),
    ] {
        let sensor = SensorConfig {
            spad_rows: side,
            spad_cols: side,
            threshold,
            ..SensorConfig::default()
        };
        let name = format!("{side}x{side} SPADs, THRESHOLD {threshold}, neglect {neglect}");
        let light = PixelLight::echo(signal, case().light.arrival())
            .with_background(1e6 * (side * side) as f64);
        Case {
            name: &name,
            sensor,
            light,
            options: options(neglect),
            stop_periods: 120,
            laser_cycles: 30,
            ..case()
        }
        .agrees();
    }
}

/// Bins of unequal lengths, of which an odd number of SPADs counts.
#[test]
fn delay_lines() {
    let sensor = hslidar_delay_line();
    let exposure = Exposure::new(&sensor, 140, 60);
    let law = WindowLaw::new(&sensor, &exposure).of_macropixel(5);
    for (start, signal, background_hz, neglect) in [
        (20, 0.8, 8e6, 1.0),
        (21, 0.8, 8e6, 0.0),
        (77, 3.0, 60e6, 0.0),
        (90, 5.0, 20e6, 1.0),
        (1, 0.5, 100e6, 0.0),
    ] {
        let window = law.window(start).open().unwrap();
        let light = PixelLight::echo(signal, law.time_of(&window, 3.3));
        Case {
            name: &format!("delay line, start value {start}, {signal} photons, {background_hz} Hz"),
            sensor: (*sensor).clone(),
            stop_periods: 140,
            start,
            light: light.with_background(background_hz),
            options: options(neglect),
            ..case()
        }
        .agrees();
    }
}

/// Two pulses within an XOR's delay leave no edge, which is left out: where that shows, it is refused.
#[test]
fn light_in_which_pulses_meet_on_a_photon_line_is_refused() {
    let sensor = hslidar_delay_line();
    let exposure = Exposure::new(&sensor, 140, 16_000);
    let cohort = Cohort::new(&sensor, &exposure, CohortOptions::default());
    let stream = stream_config(&sensor, &exposure, 1, Time::from_ps(1_900));
    let in_light = |hz| cohort.draw(&stream, 0, 40, &PixelLight::background(hz));
    assert!(in_light(3e7).is_ok());
    let refused = in_light(1e9).unwrap_err();
    assert_eq!(
        refused,
        EngineError::NotInCohorts(NotModelled::Meetings { bin: 0 })
    );
}

#[test]
fn windows_at_both_ends_and_in_the_conventional_mode() {
    let light = case().light.with_arrival(Time::from_ns(4));
    let conventional = SensorConfig {
        mode: Mode::Conventional,
        event_type: EventType::Less,
        threshold: 1,
        ..SensorConfig::default()
    };
    for (name, start, arrival, sensor) in [
        (
            "first window",
            0,
            Time::from_ns(160),
            SensorConfig::default(),
        ),
        (
            "window across STOP",
            9,
            Time::from_ns(4),
            SensorConfig::default(),
        ),
        (
            "window after an echo",
            22,
            Time::from_ns(9),
            SensorConfig::default(),
        ),
        (
            "last window",
            62,
            Time::from_ns(160),
            SensorConfig::default(),
        ),
        ("conventional", 0, Time::from_ns(140), conventional),
    ] {
        let light = light.clone().with_arrival(arrival);
        Case {
            name,
            start,
            light: light.clone(),
            sensor,
            laser_cycles: 12,
            ..case()
        }
        .agrees();
    }
}

#[test]
fn counters_saturate_and_wrap_alike() {
    for overflow in [Overflow::Saturate, Overflow::Wrap] {
        let sensor = SensorConfig {
            bin_bits: 4,
            overflow,
            ..SensorConfig::default()
        };
        let name = format!("{overflow:?}");
        Case {
            name: &name,
            sensor,
            ..case()
        }
        .agrees();
    }
}
