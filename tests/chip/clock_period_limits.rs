//! What static timing allows is what the gates can do: CLK and LOAD_CLK periods, the reset pulse, the correlation
//! path; nominal, derated and with mismatch.

use guided_dtof::analysis::{
    CorrelationTiming, LoadTiming, LocalClocks, MacropixelTiming, ReadTiming, gate_works,
    load_works, phases, read_works, reset, ripple, shortest_period, spread,
};
use guided_dtof::chip::{Limits, PCounter, SensorConfig, Silicon, Tap};
use guided_dtof::logic::Logic;
use guided_dtof::netlist::{CellId, CellKind, Corner, Library, Mismatch, ScopeId};
use guided_dtof::units::Time;

const SLOW: Time = Time::from_ns(20);
pub const TYPICAL: Silicon = Silicon::nominal(Corner::Typ);

fn mismatched(seed: u64) -> Silicon {
    Silicon {
        mismatch: Some(Mismatch { sigma: 0.1, seed }),
        ..TYPICAL
    }
}

fn pixel(silicon: &Silicon, limits: Limits) -> MacropixelTiming {
    MacropixelTiming::analyse(&SensorConfig::default(), silicon, limits, (0, 0))
}

/// Shortest period with STOP on CLK's fall, by paths and by gates.
fn limits(silicon: &Silicon, limits: Limits) -> (Time, Time) {
    let config = SensorConfig::default();
    let paths = pixel(silicon, limits);
    let by_paths = shortest_period(SLOW, |p| paths.works(p, Time::ZERO));
    let gates = gate_works(&config, silicon, limits, 0);
    let by_gates = shortest_period(SLOW, |p| gates((p, Time::ZERO)));
    (by_paths.unwrap(), by_gates.unwrap())
}

#[test]
fn the_typical_corner_has_the_published_ripple_and_period() {
    let (captured, by_gates) = limits(&TYPICAL, Limits::Ignored);
    assert_eq!(captured, by_gates);
    let (kept, by_gates) = limits(&TYPICAL, Limits::Kept);
    assert_eq!(kept, by_gates);
    // The hold time, twice, is all that the limits add.
    let hold = Library::generic_40nm().checks(CellKind::Dffr).hold;
    let hold = [hold.rise, hold.fall].map(|limit| limit.in_corner(Corner::Typ));
    let hold = hold[0].max(hold[1]);
    assert!(((kept - captured) - hold * 2).as_fs().abs() <= 1_000);
    for period in [captured, kept] {
        assert!((period.as_ns() - 2.4).abs() < 0.06, "{period}");
    }
    assert!((pixel(&TYPICAL, Limits::Kept).ripple.delay().as_ns() - 1.2).abs() < 0.01);
}

#[test]
fn derated_silicon_scales_every_limit() {
    for (corner, factor) in [(Corner::Slow, 1.0), (Corner::Typ, 1.3)] {
        let silicon = Silicon {
            corner,
            ..TYPICAL.with_factor(factor)
        };
        let (by_paths, by_gates) = limits(&silicon, Limits::Kept);
        assert_eq!(by_paths, by_gates, "{corner:?} {factor}");
    }
}

#[test]
fn paths_are_never_optimistic_under_mismatch() {
    for seed in 0..6 {
        for kept in [Limits::Ignored, Limits::Kept] {
            let (by_paths, by_gates) = limits(&mismatched(seed), kept);
            assert!(by_gates <= by_paths, "seed {seed}: {by_gates} > {by_paths}");
            // A bit that sees no change of its data has no hold to break: gates may do a little better.
            assert!(by_paths - by_gates < Time::from_ps(150), "seed {seed}");
        }
    }
}

#[test]
fn a_stop_phase_buys_a_shorter_period_below_the_forbidden_band() {
    let config = SensorConfig::default();
    let paths = pixel(&TYPICAL, Limits::Kept);
    let (from, to) = paths.forbidden(0);
    let any = |p: Time| phases(p).any(|phase| paths.works(p, phase));
    let gates = gate_works(&config, &TYPICAL, Limits::Kept, 0);
    let any_by_gates = |p: Time| phases(p).any(|phase| gates((p, phase)));
    let ps = Time::from_ps(1);
    for (period, works) in [
        (from - ps, true),
        (from + ps, false),
        (to - ps, false),
        (to + ps, true),
    ] {
        assert_eq!(
            (any(period), any_by_gates(period)),
            (works, works),
            "{period}"
        );
    }
    // Wherever paths promise a phase, the gates keep it.
    for step in 0..8 {
        let period = Time::from_ps(1_250 + 140 * step);
        for phase in phases(period).filter(|&phase| paths.works(period, phase)) {
            assert!(gates((period, phase)), "{period} {phase}");
        }
    }
}

/// The gap is false: two XORs and an AND of the longest path cannot rise last (`analysis/correlation.rs`).
#[test]
fn the_longest_correlation_path_is_reached_but_for_its_false_edges() {
    let config = SensorConfig::default();
    let library = Library::generic_40nm();
    for corner in Corner::ALL {
        let silicon = Silicon::nominal(corner);
        let lost = |kind| {
            let delay = |to| library.delay(kind, 0, to, corner);
            delay(Logic::One) - delay(Logic::Zero)
        };
        let gap = lost(CellKind::Xor2) * 2 + lost(CellKind::And2);
        for kept in [Limits::Ignored, Limits::Kept] {
            let paths = pixel(&silicon, kept);
            let gates = CorrelationTiming::simulate(&config, &silicon, kept);
            assert_eq!(gates.settled + gap, paths.event.as_ref().unwrap().delay());
            let (by_gates, by_paths) = (gates.period.unwrap(), paths.correlation_period().unwrap());
            assert!(by_gates <= by_paths + Time::from_ps(1));
            assert!(
                by_paths - by_gates <= gap + Time::from_ps(5),
                "{by_paths} {by_gates}"
            );
        }
    }
    for seed in 0..20 {
        let silicon = mismatched(seed);
        let settled = CorrelationTiming::simulate(&config, &silicon, Limits::Ignored).settled;
        assert!(
            settled <= pixel(&silicon, Limits::Ignored).event.unwrap().delay(),
            "seed {seed}"
        );
    }
}

#[test]
fn the_reset_pulse_outlasts_what_it_must_and_is_as_static_timing_says() {
    let config = SensorConfig::default();
    let paths = pixel(&TYPICAL, Limits::Kept);
    let gates = reset(&config, &TYPICAL);
    assert_eq!(gates.width, paths.reset_width());
    assert_eq!(gates.to_stage_clock, paths.reset_to_stage_clock);
    assert_eq!(gates.to_counter_clk, paths.reset_to_counter_clk);
    assert!(paths.reset_width() > paths.reset_need());
    for seed in 0..10 {
        let silicon = mismatched(seed);
        let (paths, gates) = (pixel(&silicon, Limits::Kept), reset(&config, &silicon));
        assert!(paths.reset_width() <= gates.width, "seed {seed}");
        assert!(
            paths.reset_to_stage_clock >= gates.to_stage_clock,
            "seed {seed}"
        );
        assert!(
            paths.reset_to_counter_clk >= gates.to_counter_clk,
            "seed {seed}"
        );
    }
}

#[test]
fn start_values_load_right_down_to_the_shortest_load_clk_period() {
    let config = SensorConfig {
        rows: 4,
        ..SensorConfig::default()
    };
    for silicon in [TYPICAL, mismatched(3)] {
        let by_paths = LoadTiming::analyse(&config, &silicon, Limits::Kept)
            .period()
            .unwrap();
        let works = load_works(&config, &silicon, Limits::Kept);
        let by_gates = shortest_period(Time::from_ns(5), &works).unwrap();
        assert!(
            by_gates <= by_paths + Time::from_ps(1),
            "{by_gates} {by_paths}"
        );
        assert!(
            by_paths - by_gates < Time::from_ps(60),
            "{by_gates} {by_paths}"
        );
        assert!(!works(by_gates - Time::from_ps(1)));
    }
}

#[test]
fn histograms_are_read_right_down_to_the_shortest_read_clk_period() {
    for (bins, readout_pins) in [(16, 8), (3, 64)] {
        let config = SensorConfig {
            bins,
            readout_pins,
            rows: 2,
            ..SensorConfig::default()
        };
        for silicon in [TYPICAL, mismatched(3)] {
            let by_paths = ReadTiming::analyse(&config, &silicon, Limits::Kept).period();
            let by_paths = by_paths.unwrap();
            let works = read_works(&config, &silicon, Limits::Kept);
            let by_gates = shortest_period(Time::from_ns(5), &works).unwrap();
            assert!(
                by_gates <= by_paths + Time::from_ps(1),
                "{by_gates} {by_paths}"
            );
            assert!(
                by_paths - by_gates < Time::from_ps(60),
                "{by_gates} {by_paths}"
            );
            assert!(works(by_paths + Time::from_ps(1)) && !works(by_gates - Time::from_ps(1)));
        }
    }
}

#[test]
fn every_flip_flop_of_the_chip_is_asked() {
    let config = SensorConfig {
        rows: 2,
        cols: 2,
        ..SensorConfig::default()
    };
    let paths = pixel(&TYPICAL, Limits::Kept);
    let local = LocalClocks::analyse(&SensorConfig::default(), &TYPICAL);
    let asked = paths
        .clk
        .iter()
        .chain(&paths.hits)
        .chain(&local.counts)
        .chain(&local.toggles);
    let asked: Vec<CellId> = asked
        .filter(|r| r.kind.concerns_data())
        .map(|r| r.cell)
        .collect();
    let left_out = |netlist: &guided_dtof::netlist::Netlist, asked: &[CellId]| -> Vec<String> {
        let cells = netlist.cells_below(ScopeId::TOP).zip(netlist.cells());
        let flip_flops = cells.filter(|(_, c)| c.kind.is_flip_flop());
        let unasked = flip_flops.filter(|(cell, _)| !asked.contains(cell));
        unasked.map(|(cell, _)| netlist.cell_path(cell)).collect()
    };
    for cell in left_out(&paths.netlist, &asked) {
        // Samplers of SPADs, of ENABLE by STOP, and what LOAD_CLK and READ_CLK move.
        let known = [
            ".first",
            "quantic4x4.run",
            ".memory_",
            "deserialiser",
            "row_scanner",
            "readout_scanner",
            "serialiser",
        ];
        assert!(known.iter().any(|name| cell.contains(name)), "{cell}");
    }
    let load = LoadTiming::analyse(&config, &TYPICAL, Limits::Kept);
    let asked: Vec<CellId> = load.load_clk.iter().map(|r| r.cell).collect();
    // The first stage takes its bit from the tester.
    let left = left_out(&load.netlist, &asked);
    assert!(
        left.iter()
            .all(|cell| cell.ends_with("deserialiser.shift_0")),
        "{left:?}"
    );
    let read = ReadTiming::analyse(&config, &TYPICAL, Limits::Kept);
    let asked: Vec<CellId> = read.read_clk.iter().map(|r| r.cell).collect();
    assert_eq!(left_out(&read.netlist, &asked), [""; 0]);
}

#[test]
fn a_macropixels_mismatch_is_its_own_and_the_spread_is_that_of_its_cells() {
    let config = SensorConfig {
        rows: 12,
        cols: 16,
        ..SensorConfig::default()
    };
    let silicon = mismatched(1);
    let found = spread(&config, &silicon, || ());
    // Independent cells: the variance of the ripple is the sum of theirs.
    let library = Library::generic_40nm();
    let variance = |kind: CellKind, pin, count: f64| {
        let delay = library.delay(kind, pin, Logic::One, Corner::Typ).as_s();
        count * (0.1 * delay).powi(2) * 2.0 / kind.transistors() as f64
    };
    let expected = variance(CellKind::Nor2, 0, 1.0)
        + variance(CellKind::Dffr, 1, 10.0)
        + variance(CellKind::Mux2, 0, 9.0);
    let count = found.pixels.len() as f64;
    // Five standard deviations of a standard deviation and of a mean.
    let relative = found.sigma_s / expected.sqrt() - 1.0;
    assert!(relative.abs() < 5.0 / (2.0 * count).sqrt(), "{relative}");
    let nominal = pixel(&TYPICAL, Limits::Kept).ripple.delay().as_s();
    assert!((found.mean_s - nominal).abs() < 5.0 * (expected / count).sqrt());
    let one = MacropixelTiming::analyse(&config, &silicon, Limits::Kept, (3, 5));
    assert_eq!(found.pixels[3 * 16 + 5].ripple, one.ripple.delay());
    assert_eq!(found, spread(&config, &silicon, || ()));
}

#[test]
fn the_ripple_is_reached_for_every_number_of_stages() {
    for p_counter in PCounter::ALL {
        for counter_bits in 2..=12 {
            let config = SensorConfig {
                counter_bits,
                tap: Tap::Borrow,
                ..p_counter.sensor()
            };
            for silicon in [TYPICAL, mismatched(counter_bits as u64)] {
                let found = ripple(&config, &silicon);
                assert_eq!(
                    found.longest_path, found.latest,
                    "{p_counter:?}, {counter_bits} stages"
                );
            }
        }
    }
}
