//! Which photon is counted where in one macropixel: at the edge of a bin, in a full bin, together with others, and twice in a SPAD.

use super::{STOP_PERIODS, config, counts_text, find_window, middle, window};
use crate::chip::{EventType, Exposure, Overflow, SensorConfig, Tdc, correlation, histogram};
use crate::photon::SpadEvent;
use crate::report::Checks;
use crate::testbenches::rig;
use crate::units::Time;

/// What the gates count of pulses in any order; `None` where a bin is unknown.
fn counts(
    config: &SensorConfig,
    exposure: &Exposure,
    start: u16,
    mut pulses: impl AsMut<[SpadEvent]>,
) -> Option<Vec<u16>> {
    pulses.as_mut().sort_unstable();
    rig::counts(config, exposure, (0, 0), start, pulses.as_mut())
}

/// One photon, femtosecond by femtosecond across the edge between two bins.
pub(super) fn bin_edge(checks: &mut Checks) {
    let (config, start, bin) = (config(), 20, 8);
    let exposure = Exposure::new(&config, STOP_PERIODS, 1);
    let (law, window) = window(&config, &exposure, start);
    let edge = law.bin_interval(&window, 0, bin).start;
    for offset_fs in -2..=2 {
        let time = edge + Time::from_fs(offset_fs);
        let pulse = [SpadEvent { time, spad: 7 }];
        let found = counts(&config, &exposure, start, pulse);
        let bins = |counts: &[u16]| -> Vec<usize> {
            (0..counts.len()).filter(|&b| counts[b] > 0).collect()
        };
        checks.equal(
            format!(
                "photon {offset_fs:+} fs from the edge of bins {} and {bin}: bin",
                bin - 1
            ),
            counts_text(&Some([if offset_fs < 0 { bin - 1 } else { bin }])),
            counts_text(&found.map(|counts| bins(&counts))),
        );
    }
}

/// More photons than a small bin can count.
pub(super) fn full_bins(checks: &mut Checks) {
    for overflow in [Overflow::Saturate, Overflow::Wrap] {
        let config = SensorConfig {
            bin_bits: 3,
            overflow,
            ..config()
        };
        let (start, bin) = (20, 5);
        let exposure = Exposure::new(&config, 32, 12);
        let (law, window) = window(&config, &exposure, start);
        let pulses: Vec<SpadEvent> = (0..exposure.laser_cycles)
            .map(|cycle| SpadEvent {
                time: middle(&law, &window, cycle, bin),
                spad: cycle as u8,
            })
            .collect();
        let hits = pulses.len() as u64;
        let found = counts(&config, &exposure, start, pulses);
        checks.equal(
            format!(
                "{hits} photons in a bin of {} bits, overflow = {overflow:?}",
                config.bin_bits
            ),
            counts_text(&Some(histogram::model(
                hits,
                config.bin_bits as u32,
                overflow,
            ))),
            counts_text(&found.map(|counts| counts[bin as usize])),
        );
    }
}

/// Bin b gets b coincident photons, and TYPE and THRESHOLD pick the bins.
pub(super) fn coincidences(
    sensor: &SensorConfig,
    (start, stop_periods): (u16, u32),
    checks: &mut Checks,
) {
    let cases = [
        (EventType::Greater, 0),
        (EventType::Greater, 3),
        (EventType::Equal, 2),
        (EventType::Less, 4),
        (EventType::Greater, 16),
    ];
    for (event_type, threshold) in cases {
        let config = SensorConfig {
            // No more SPADs fire than there are.
            bins: 6.min(sensor.spads() + 1),
            event_type,
            threshold,
            dead_time_ns: 1.0,
            ..sensor.clone()
        };
        // A block of one's own has the bins that it has, and no THRESHOLD exceeds the SPADs.
        if config.check().is_err() {
            continue;
        }
        let exposure = Exposure::new(&config, stop_periods, 1);
        let Some((law, window)) = find_window(&config, &exposure, start) else {
            continue;
        };
        let spads = |bin: usize| (1u64 << bin) - 1;
        let mut pulses = Vec::new();
        for bin in 0..config.bins {
            let time = middle(&law, &window, 0, bin as i64);
            pulses.extend((0..bin as u8).map(|spad| SpadEvent { time, spad }));
        }
        let expected: Vec<u16> = (0..config.bins)
            .map(|bin| match config.tdc {
                // It adds up all SPADs that fire in a CLK period.
                Tdc::Counter => bin as u16,
                _ => correlation::model(spads(bin), event_type, threshold) as u16,
            })
            .collect();
        let found = counts(&config, &exposure, start, pulses);
        checks.equal(
            format!(
                "0 to {} coincident photons, TYPE = {event_type:?} than {threshold}",
                config.bins - 1
            )
            .replace("Equal than", "Equal to"),
            counts_text(&Some(expected)),
            counts_text(&found),
        );
    }
}

/// A toggle front end loses two pulses of one SPAD within one CLK period.
pub(super) fn cancelling_pulses(checks: &mut Checks) {
    let config = SensorConfig {
        dead_time_ns: 0.5,
        ..config()
    };
    let (start, bin) = (20, 6);
    let exposure = Exposure::new(&config, 32, 1);
    let (law, window) = window(&config, &exposure, start);
    let centre = middle(&law, &window, 0, bin);
    let apart = Time::from_ps(500);
    let pulse = |time, spad| SpadEvent { time, spad };
    let bin_start = law.bin_interval(&window, 0, bin).start;
    let cases = [
        ("one pulse of a SPAD", vec![pulse(centre, 3)], 0, 1),
        (
            "two pulses of one SPAD within one CLK period cancel",
            vec![pulse(centre - apart, 3), pulse(centre + apart, 3)],
            0,
            0,
        ),
        (
            "pulses of two SPADs within one CLK period are one event",
            vec![pulse(centre - apart, 3), pulse(centre + apart, 4)],
            0,
            1,
        ),
        (
            "two pulses of one SPAD on either side of a bin's edge",
            vec![pulse(bin_start - apart, 3), pulse(bin_start + apart, 3)],
            1,
            1,
        ),
    ];
    for (what, pulses, before, within) in cases {
        let found = counts(&config, &exposure, start, pulses);
        let bin = bin as usize;
        checks.equal(
            format!("{what}: bins {} and {bin}", bin - 1),
            counts_text(&Some([before, within])),
            counts_text(&found.map(|counts| [counts[bin - 1], counts[bin]])),
        );
    }
}
