//! The window law, against the ripple and against every start value.

use super::*;
use crate::chip::PCounter;
use crate::chip::SensorConfig;
use crate::netlist::Corner;
use proptest::prelude::*;

fn law(config: &SensorConfig) -> WindowLaw {
    WindowLaw::new(config, &Exposure::new(config, 520, 1))
}

#[test]
fn the_typical_ripple_is_the_published_one() {
    let ripple = ChipTiming::new(&SensorConfig::default()).ripple();
    assert!((ripple.as_ns() - 1.2).abs() < 0.01, "{ripple}");
}

#[test]
fn at_384_mhz_the_window_ends_one_and_a_half_periods_before_the_start_value() {
    let config = SensorConfig::default();
    let law = law(&config);
    let window = law.window(100).open().unwrap();
    assert_eq!(window.first_edge, 100 - 16);
    let end = law.interval(&window).end;
    let expected = config.clock().half_periods(2 * 99 + 1) - law.timing().spad_to_sampled;
    assert!((end - expected).as_fs().abs() <= 2);
}

#[test]
fn a_start_value_beyond_the_laser_cycle_never_opens() {
    let config = SensorConfig::default();
    let short = WindowLaw::new(&config, &Exposure::new(&config, 100, 1));
    assert!(short.window(98).open().is_some());
    assert_eq!(short.window(99), WindowOutcome::Never);
    assert_eq!(short.window(511), WindowOutcome::Never);
    // The last one serves all that it collects, half a window beyond its centre too.
    let last = short.interval(&short.window(98).open().unwrap());
    assert_eq!(short.start_for(last.end - Time::from_fs(1)), Some(98));
    assert_eq!(short.start_for(last.end), None);
}

#[test]
fn every_p_counter_opens_windows_in_the_sensor_that_suits_it() {
    for p_counter in PCounter::ALL {
        let config = p_counter.sensor();
        let law = WindowLaw::new(&config, &Exposure::new(&config, 512, 3));
        for start in [100, 300] {
            let window = law.window(start);
            assert!(window.open().is_some(), "{p_counter:?} {start}: {window:?}");
        }
    }
}

/// A counter that no reset holds takes the edge for its first, or does not, where CLK rises from [`ROUNDING`] before
/// ENABLE to its shortest high time after it.
#[test]
fn the_edge_at_enable_may_race_from_a_rounding_before_it() {
    let config = PCounter::ALL.map(PCounter::sensor);
    let config = config
        .iter()
        .find(|config| !config.p_counter.row().has_memory)
        .unwrap();
    let enabled = law(config).timing().stop_to_enabled;
    let with_edge_at = |time: Time| {
        let phase = config.clock().half_periods(1) - time;
        let law = law(&SensorConfig {
            stop_phase_ps: phase.as_ns() * 1e3,
            ..config.clone()
        });
        assert_eq!(law.exposure().rising(0), time);
        law.window(100)
    };
    let races = |off_fs: i64| {
        let window = with_edge_at(enabled + Time::from_fs(off_fs));
        matches!(window, WindowOutcome::Race(race) if race.what == Conflict::ClkAtEnable)
    };
    let found: Vec<bool> = (-5..5).map(races).collect();
    let expected: Vec<bool> = (-5..5).map(|off_fs| off_fs >= -ROUNDING.as_fs()).collect();
    assert_eq!(found, expected);
}

#[test]
fn a_macropixel_has_the_clk_of_its_column_and_its_own_delay_lines() {
    for tdc in [Tdc::Clocked, Tdc::DelayLine] {
        for clk_skew_ps in [0.0, 7.0] {
            let config = SensorConfig {
                tdc,
                clk_skew_ps,
                ..SensorConfig::default()
            };
            let sensor = Sensor::from(&config);
            let law = WindowLaw::new(&sensor, &Exposure::new(&config, 520, 1));
            assert_eq!(**law.sensor(), config);
            let window = law.window(101).open().unwrap();
            let of_first = law.edges(&window, 0);
            for number in [0, 1, 63, 64, 4095] {
                let found = law.of_macropixel(number).edges(&window, 0);
                let (number, col) = (number as usize, number as usize % 64);
                let later = sensor.clk_skew(col);
                assert_eq!(later == Time::ZERO, col == 0 || clk_skew_ps == 0.0);
                // The last tap holds what came first.
                let before_freeze = |number: usize| -> Option<Vec<Time>> {
                    let lines = sensor.taps(number)?;
                    Some(lines[101 % lines.len()].iter().rev().copied().collect())
                };
                let own = before_freeze(number).zip(before_freeze(0));
                for (bin, (found, first)) in found.edges().iter().zip(of_first.edges()).enumerate()
                {
                    let longer = own
                        .as_ref()
                        .map_or(Time::ZERO, |(own, first)| own[bin] - first[bin]);
                    assert_eq!(*found, *first + later - longer, "{tdc:?} {number} {bin}");
                }
            }
        }
    }
}

#[test]
fn only_where_no_start_value_has_a_window_is_aiming_refused() {
    assert_eq!(law(&SensorConfig::default()).refusal(), None);
    let fast = SensorConfig {
        clk_hz: 3e9,
        ..SensorConfig::default()
    };
    let refusal = law(&fast).refusal();
    assert!(matches!(refusal, Some(NoAim::Race(race)) if race.what == Conflict::SlowCorrelation));
}

#[test]
fn a_race_says_what_meets_what_when_and_what_helps() {
    let ps = Time::from_ps;
    let slow = Race::too_slow(Conflict::SlowCounter, ps(1300), ps(1250));
    assert_eq!(
        slow.to_string(),
        "the P-counter is slower than a CLK period (it takes 1.300 ns after CLK's edge, and must not take more than \
         1.250 ns)"
    );
    assert_eq!(slow.slack(), ps(-50));
    // 1300.004 ps.
    assert_eq!(slow.cure.to_string(), "give clk_hz of at most 769.2 MHz");
    let all = ((ps(4000), ps(4000)), ps(1000));
    let both = Race::strobe_at_shift(ps(2600), 1, (ps(4000), ps(100)), (ps(50), ps(20)), all);
    assert_eq!(
        both.to_string(),
        "the strobe meets a change of the shift register (it comes 4.000 ns after CLK falls, and must not from 3.980 ns \
         to 4.050 ns)"
    );
    assert_eq!(both.slack(), ps(-20));
    // (4000 - 100 + 20) / 1.5 ps and (4000 - 100 - 50) / 1.5 ps.
    assert_eq!(
        both.cure.to_string(),
        "give clk_hz of at most 382.6 MHz, or of at least 389.7 MHz"
    );
    let cures = [
        (Some(-400), Some(300)),
        (Some(-400), None),
        (None, Some(300)),
        (None, None),
    ];
    let cures = cures.map(|(most, least)| {
        let [at_most, at_least] = [most, least].map(|ps: Option<i64>| ps.map(Time::from_ps));
        Cure::Phase { at_most, at_least }.to_string()
    });
    let expected = [
        "give stop_phase_ps of at most -400, or of at least 300",
        "give stop_phase_ps of at most -400",
        "give stop_phase_ps of at least 300",
        "give a lower clk_hz",
    ];
    assert_eq!(cures, expected);
}

proptest! {
    #[test]
    fn a_cure_keeps_the_two_signals_apart(
        clk_mhz in 150f64..900.0,
        phase in -1f64..1.0,
        corner in prop::sample::select(Corner::ALL.to_vec()),
        mode in prop::sample::select(vec![Mode::Guided, Mode::Conventional]),
        p_counter in prop::sample::select(PCounter::ALL.to_vec()),
    ) {
        let after_borrow = p_counter.sensor().after_borrow;
        let config = SensorConfig {
            clk_hz: clk_mhz * 1e6,
            stop_phase_ps: phase * 0.5e6 / clk_mhz,
            corner,
            mode,
            p_counter,
            after_borrow,
            ..SensorConfig::default()
        };
        let window = |config: &SensorConfig| {
            WindowLaw::new(config, &Exposure::new(config, 1024, 1)).window(100)
        };
        if let WindowOutcome::Race(race) = window(&config) {
            prop_assert!(race.slack() <= ROUNDING, "{race}");
            // A cure is no larger than it must be: 40 fs less of it, ten times the rounding of an edge, leaves a race.
            let less = Time::from_fs(40);
            let (mut cured, mut not_cured) = (Vec::new(), Vec::new());
            let mut push = |ends: [Option<(Time, Time)>; 2], change: &dyn Fn(&mut SensorConfig, Time)| {
                let with = |value: Time| {
                    let mut config = config.clone();
                    change(&mut config, value);
                    config
                };
                for (enough, too_little) in ends.into_iter().flatten() {
                    cured.push(with(enough));
                    not_cured.push(with(too_little));
                }
            };
            let above = |t: Time| (t, t - less);
            let below = |t: Time| (t, t + less);
            // Cures lie on either side of what the sensor has.
            let brackets = |at_most: Option<Time>, present: Time, at_least: Option<Time>| {
                at_most.is_none_or(|t| t < present + less) && at_least.is_none_or(|t| present - less < t)
            };
            match race.cure {
                Cure::Period { at_least, at_most } => {
                    prop_assert!(brackets(at_most, config.clock().period(), Some(at_least)), "{race}; {}", race.cure);
                    push([Some(above(at_least)), at_most.map(below)], &|config, t| config.clk_hz = 1.0 / t.as_s());
                }
                Cure::Phase { at_most, at_least } => {
                    prop_assert!(brackets(at_most, config.stop_phase(), at_least), "{race}; {}", race.cure);
                    push([at_most.map(below), at_least.map(above)], &|config, t| config.stop_phase_ps = t.as_ns() * 1e3);
                }
                Cure::LoadPeriod(at_least) => {
                    push([Some(above(at_least)), None], &|config, t| config.load_clk_hz = 1.0 / t.as_s());
                }
                Cure::LaserCycle | Cure::Tap | Cure::ResetChain | Cure::Cells => {}
            }
            for config in not_cured {
                let again = window(&config);
                prop_assert!(matches!(again, WindowOutcome::Race(_)), "{race}; less than {}: {again:?}", race.cure);
            }
            for config in cured {
                let again = window(&config);
                let is_same = matches!(again, WindowOutcome::Race(r) if r.what == race.what);
                prop_assert!(!is_same, "{race}; {}: {again:?}", race.cure);
            }
        }
    }

    /// A P-counter without memory whose load pulse is as long as COUNTER_INIT stays.
    #[test]
    fn start_values_load_before_counter_init_changes(load_mhz in 50f64..1500.0, start in 0u16..512) {
        let config = |load_clk_hz| SensorConfig {
            p_counter: PCounter::Memoryless,
            after_borrow: AfterBorrow::Wrap,
            clk_hz: 100e6,
            load_clk_hz,
            ..SensorConfig::default()
        };
        let window = |config: &SensorConfig| WindowLaw::new(config, &Exposure::new(config, 512, 1)).window(start);
        let fast = config(load_mhz * 1e6);
        let pulse = ChipTiming::new(&fast).counter.load_pulse;
        let is_over = pulse.is_some_and(|pulse| pulse * 2 < fast.load_clock().period());
        match window(&fast) {
            WindowOutcome::Race(Race { what: Conflict::InitAtLoadPulse, cure: Cure::LoadPeriod(at_least), .. }) => {
                prop_assert!(!is_over);
                let cured = window(&config(1.0 / at_least.as_s()));
                let is_same = matches!(cured, WindowOutcome::Race(Race { what: Conflict::InitAtLoadPulse, .. }));
                prop_assert!(!is_same);
            }
            _ => prop_assert!(is_over),
        }
    }

    #[test]
    fn bins_tile_time(start in 0u16..512, cycle in 0i64..1000, clk_mhz in 100f64..420.0) {
        let config = SensorConfig { clk_hz: clk_mhz * 1e6, ..SensorConfig::default() };
        let law = law(&config);
        if let Some(window) = law.window(start).open() {
            for bin in 0..15 {
                let here = law.bin_interval(&window, cycle, bin);
                let next = law.bin_interval(&window, cycle, bin + 1);
                prop_assert_eq!(here.end, next.start);
                let width = here.end - here.start;
                prop_assert!((width - config.clock().period()).as_fs().abs() <= 1);
            }
        }
    }

    #[test]
    fn the_chosen_start_value_is_the_best_of_all(
        ns in 0.0f64..1400.0,
        clk_mhz in 200f64..400.0,
        step in 0u32..4,
    ) {
        let config = SensorConfig {
            clk_hz: clk_mhz * 1e6,
            step_periods: 1 << step,
            ..SensorConfig::default()
        };
        let law = law(&config);
        let time = Time::from_s(ns * 1e-9);
        let centre_distance = |start| {
            let interval = law.interval(&law.window(start).open()?);
            interval.contains(&time).then(|| {
                let centre = (interval.start.as_fs() + interval.end.as_fs()) / 2;
                ((centre - time.as_fs()).abs(), start)
            })
        };
        let best = (0..512).filter_map(centre_distance).min();
        let chosen = law.start_for(time);
        prop_assert_eq!(chosen.is_some(), best.is_some());
        if let (Some(chosen), Some((distance, _))) = (chosen, best) {
            let got = centre_distance(chosen).unwrap().0;
            prop_assert!(got <= distance + 1, "{got} {distance}");
        }
    }
}
