//! Every TYPE and mode, windows at both ends of a laser cycle, counters that overflow.

use guided_dtof::chip::{EventType, Mode, Overflow, SensorConfig};
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
