//! Every TYPE and mode, windows at both ends of a laser cycle, counters that overflow.

use guided_dtof::chip::{EventType, Mode, Overflow, SensorConfig};
use guided_dtof::photon::PixelLight;
use guided_dtof::units::Time;

use super::comparison::{Case, case};
use super::ways::options;

#[test]
fn coincidences_of_each_type() {
    let light = PixelLight {
        background_hz: 150e6,
        signal_per_cycle: 4.0,
        ..case().light
    };
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
            light,
            options,
            stop_periods: 120,
            laser_cycles: 30,
            ..case()
        }
        .agrees();
    }
}

#[test]
fn windows_at_both_ends_and_in_the_conventional_mode() {
    let light = PixelLight {
        arrival: Time::from_ns(4),
        ..case().light
    };
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
        let light = PixelLight { arrival, ..light };
        Case {
            name,
            start,
            light,
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
