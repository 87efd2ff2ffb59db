//! What `gdtof timing` says of a clock is what the gates do: the corners and derating factors at which it fails, and one
//! verdict of static timing, window law and the timing checks of the gates.

use guided_dtof::analysis::{TimingVerdict, corner_limits, factor_range, gate_works};
use guided_dtof::chip::race::Conflict;
use guided_dtof::chip::{
    AfterBorrow, Exposure, Limits, Mode, PCounter, SensorConfig, Silicon, WindowLaw, WindowOutcome,
    hslidar_delay_line,
};
use guided_dtof::engine::GateSimulation;
use guided_dtof::kernel::{CheckReport, Policy};
use guided_dtof::netlist::Corner;
use guided_dtof::photon::SpadEvent;
use guided_dtof::units::Time;
use rand::{RngExt, SeedableRng, rngs::StdRng};

use super::clock_period_limits::TYPICAL;

#[test]
fn the_corner_at_which_384_mhz_fails_is_that_of_the_gates() {
    let config = SensorConfig::default();
    for kept in [Limits::Ignored, Limits::Kept] {
        let range = factor_range(&config, &TYPICAL, kept).unwrap();
        assert_eq!((range.fastest, range.moved), (None, 0));
        let at = (config.clock().period(), Time::ZERO);
        let works = |factor| gate_works(&config, &TYPICAL.with_factor(factor), kept, 0)(at);
        let slowest = range.slowest;
        assert!(works(slowest - 1e-5) && !works(slowest + 3e-5), "{slowest}");
    }
    let range = factor_range(&config, &TYPICAL, Limits::Kept);
    let [slow, typical, fast] = corner_limits(range);
    assert!(!slow.works_at_reference && typical.works_at_reference && fast.works_at_reference);
}

/// Where the strobe passes a rising CLK edge, silicon may be too fast as well.
#[test]
fn a_clock_above_the_forbidden_band_fails_with_faster_silicon_as_the_gates_do() {
    let config = at_mhz(500.0);
    let range = factor_range(&config, &TYPICAL, Limits::Kept).unwrap();
    assert_eq!(range.moved, 1);
    let at = (config.clock().period(), Time::ZERO);
    let works = |factor| gate_works(&config, &TYPICAL.with_factor(factor), Limits::Kept, 1)(at);
    let fastest = range.fastest.unwrap();
    assert!(works(fastest + 1e-5) && !works(fastest - 3e-5), "{fastest}");
    // The correlation path limits the other end: the gates have its false edges to spare.
    assert!(
        range.slowest > 1.5 && works(range.slowest - 1e-5),
        "{}",
        range.slowest
    );
    let [_, typical, fast] = corner_limits(Some(range));
    assert!(typical.works_at_reference && typical.fails_above_v > Some(1.1));
    assert!(fast.fails_above_v.is_some() && fast.fails_above_v < typical.fails_above_v);
}

fn at_mhz(mhz: f64) -> SensorConfig {
    SensorConfig {
        rows: 1,
        cols: 1,
        clk_hz: mhz * 1e6,
        ..SensorConfig::default()
    }
}

/// Violations of all limits, SPAD samplers excepted, while two SPADs in turn fire in every other CLK period around the
/// windows of three laser cycles.
fn violations(config: &SensorConfig) -> CheckReport {
    let exposure = Exposure::new(config, 80, 3);
    let pulses: Vec<SpadEvent> = (0..230)
        .map(|edge| SpadEvent {
            time: exposure.rising(edge) - Time::from_fs(exposure.clock.period().as_fs() * 2 / 5),
            spad: (edge % 16) as u8,
        })
        .filter(|pulse| pulse.time >= Time::ZERO && pulse.spad % 3 != 0)
        .collect();
    let mut gate = GateSimulation::new(config, &exposure, (0, 0), (1, 1), &[40], &[&pulses]);
    let mut checks = gate.timing_checks(Policy::ReportOnly);
    gate.run(&mut checks);
    checks.report(gate.netlist())
}

/// Static verdict, window law and the timing checks of the gates say the same about a clock.
#[test]
fn one_verdict_on_every_clock() {
    for mhz in [
        100.0, 300.0, 384.0, 406.0, 408.0, 415.0, 422.0, 425.0, 500.0, 700.0, 860.0,
    ] {
        let config = at_mhz(mhz);
        let verdict = TimingVerdict::analyse(&config, &TYPICAL, (0, 0));
        let law = WindowLaw::new(&config, &Exposure::new(&config, 80, 3));
        let is_race = matches!(law.window(40), WindowOutcome::Race(_));
        assert_eq!(verdict.is_met(), !is_race, "{mhz} MHz: {verdict}");
        let found = violations(&config);
        assert_eq!(
            verdict.is_met(),
            found.violated() == 0,
            "{mhz} MHz: {verdict}\n{found}"
        );
        let said = verdict.to_string();
        if is_race {
            assert!(
                said.contains("the strobe meets a change of the shift register"),
                "{said}"
            );
            assert!(
                said.contains("give clk_hz of at most 407.1 MHz, or of at least 423.4 MHz"),
                "{said}"
            );
            assert!(said.contains("metdc.hit_"), "{said}");
            assert!(
                found
                    .violations
                    .iter()
                    .all(|v| v.cell.contains(".metdc.hit_")),
                "{found}"
            );
        }
        // Past the change of the shift register, a bin later.
        let is_late = verdict
            .notes
            .iter()
            .any(|note| note.contains("the strobe comes after 1 rising"));
        assert_eq!(is_late, mhz > 423.0, "{mhz} MHz: {:?}", verdict.notes);
    }
    // LOCAL_STOP cuts a pulse of COUNTER_CLK short, between periods that the verdict names.
    let mut fails = 0;
    for mhz in (820..=862).step_by(2) {
        let config = at_mhz(f64::from(mhz));
        let verdict = TimingVerdict::analyse(&config, &TYPICAL, (0, 0));
        let found = violations(&config);
        let says = (verdict.is_met(), mhz);
        assert_eq!(says, (found.violated() == 0, mhz), "{verdict}\n{found}");
        if !verdict.is_met() {
            fails += 1;
            let said = verdict.to_string();
            let cure = "too short a piece; give clk_hz below 83";
            assert!(
                said.contains(cure) && said.contains("or above 855."),
                "{said}"
            );
        }
    }
    assert!((5..20).contains(&fails), "{fails}");
    let slow = Silicon {
        factor: 1.3,
        ..TYPICAL
    };
    assert!(TimingVerdict::analyse(&at_mhz(300.0), &slow, (0, 0)).is_met());
    assert!(!TimingVerdict::analyse(&at_mhz(384.0), &slow, (0, 0)).is_met());
    // The library strobes after the change, this silicon before it: right by itself, and not where the law aims.
    let fast = Silicon {
        factor: 0.75,
        ..TYPICAL
    };
    let verdict = TimingVerdict::analyse(&at_mhz(500.0), &fast, (0, 0));
    assert!(
        !verdict.is_met() && verdict.worst().check == "strobe setup",
        "{verdict}"
    );
}

/// Random sensors of all kinds: the verdict is met exactly where the window law finds no race.
#[test]
fn the_verdict_is_that_of_the_window_law_in_every_mode_and_with_every_p_counter() {
    let random = &mut StdRng::seed_from_u64(9);
    let (mut met, mut failed) = (0, 0);
    for case in 0..60 {
        let p_counter = PCounter::ALL[case % PCounter::ALL.len()];
        let is_conventional = random.random_bool(0.4);
        let mhz = random.random_range(300.0..900.0);
        let config = SensorConfig {
            p_counter,
            mode: if is_conventional {
                Mode::Conventional
            } else {
                Mode::Guided
            },
            after_borrow: p_counter.sensor().after_borrow,
            stop_phase_ps: random.random_range(-0.99..0.99) * 0.5e6 / mhz,
            counter_bits: random.random_range(4..10),
            corner: Corner::ALL[random.random_range(0..3)],
            ..at_mhz(mhz)
        };
        assert_eq!(config.check(), Ok(()));
        let verdict = TimingVerdict::analyse(&config, &Silicon::nominal(config.corner), (0, 0));
        let exposure = Exposure::new(&config, 1 << (config.counter_bits + 1), 4);
        let start = config.largest_start() / 4;
        let window = WindowLaw::new(&config, &exposure).window(start);
        let is_race = matches!(window, WindowOutcome::Race(_));
        assert_eq!(
            verdict.is_met(),
            !is_race,
            "{verdict}\n{window:?}\n{config:?}"
        );
        if is_race { failed += 1 } else { met += 1 }
    }
    assert!(met > 10 && failed > 5, "{met} met, {failed} failed");
}

#[test]
fn a_verdict_notes_photons_that_cancel_and_fails_where_the_front_end_does_not_follow() {
    let short = SensorConfig {
        dead_time_ns: 0.12,
        ..at_mhz(300.0)
    };
    let verdict = TimingVerdict::analyse(&short, &TYPICAL, (0, 0));
    assert!(
        verdict.is_met() && verdict.worst().check == "SPAD_RAW setup",
        "{verdict}"
    );
    assert!(verdict.notes[0].contains("cancel"), "{:?}", verdict.notes);
    let slow = Silicon {
        factor: 1.1,
        ..TYPICAL
    };
    let said = TimingVerdict::analyse(&short, &slow, (0, 0)).to_string();
    assert!(
        said.contains("dead_time_ns = 0.12 is shorter than the front end follows"),
        "{said}"
    );
    assert!(said.contains("give at least 0.1214"), "{said}");
}

/// What samples delay lines also strobes: in the conventional mode it comes with STOP, whenever CLK falls.
#[test]
fn delay_lines_keep_their_limits_in_either_mode() {
    for mode in [Mode::Guided, Mode::Conventional] {
        for mhz in [60.0, 200.0, 300.0] {
            let config = SensorConfig {
                rows: 1,
                cols: 1,
                clk_hz: mhz * 1e6,
                mode,
                ..(*hslidar_delay_line()).clone()
            };
            let verdict = TimingVerdict::analyse(&config, &TYPICAL, (0, 0));
            let found = violations(&config);
            assert_eq!(found.violated(), 0, "{mode:?}, {mhz} MHz: {found}");
            assert!(verdict.is_met(), "{mode:?}, {mhz} MHz: {verdict}");
        }
    }
}

/// What the window law refuses whatever CLK does, the verdict names.
#[test]
fn a_verdict_fails_where_a_load_pulse_or_the_strobe_of_stop_does() {
    let names = |config: &SensorConfig, check: &str| {
        let verdict = TimingVerdict::analyse(config, &TYPICAL, (0, 0));
        let margins = verdict.margins.iter();
        let slack = margins
            .filter(|margin| margin.check.contains(check))
            .map(|margin| margin.slack < Time::ZERO);
        slack.collect::<Vec<bool>>()
    };
    let refused = |config: &SensorConfig, what: Conflict| {
        let law = WindowLaw::new(config, &Exposure::new(config, 512, 1));
        matches!(law.window(40), WindowOutcome::Race(race) if race.what == what)
    };
    for (load_mhz, fails) in [(200.0, false), (1500.0, true)] {
        let config = SensorConfig {
            p_counter: PCounter::Memoryless,
            after_borrow: AfterBorrow::Wrap,
            load_clk_hz: load_mhz * 1e6,
            ..at_mhz(100.0)
        };
        assert_eq!(names(&config, "load pulse"), [fails], "{load_mhz} MHz");
        assert_eq!(refused(&config, Conflict::InitAtLoadPulse), fails);
    }
    assert!(names(&at_mhz(100.0), "load pulse").is_empty());
    for reset_stages in [1, 6] {
        let config = SensorConfig {
            mode: Mode::Conventional,
            reset_stages,
            ..at_mhz(100.0)
        };
        let fails = refused(&config, Conflict::StrobeAtReset);
        assert_eq!(names(&config, "STOP's strobe"), [fails], "{reset_stages}");
    }
}
