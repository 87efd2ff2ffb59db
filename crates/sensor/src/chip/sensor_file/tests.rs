//! Sensor files: what they say is read, and what is wrong with them is reported.

use super::*;
use crate::chip::correlation;
use crate::netlist::Corner;
use crate::settings::Range;
use proptest::prelude::*;

#[test]
fn the_default_sensor_loads_in_a_few_hundred_microseconds() {
    let config = SensorConfig::default();
    assert_eq!(config.load_bits(), 36_864);
    assert_eq!(config.histogram_bits(), 4096 * 16 * 14);
    let us = config.load_time().as_s() * 1e6;
    assert!((100.0..400.0).contains(&us), "{us}");
}

#[test]
fn impossible_values_are_refused_with_their_line() {
    for (text, line) in [
        ("cols = 4\nrows = 0", 2),
        ("clk_hz = 0", 1),
        ("clk_hz = nan", 1),
        ("\n\ndead_time_ns = -1.0", 3),
        ("\n\ndead_time_ns = 8e-9", 3),
        ("corner = \"slow\"\ndead_time_ns = 0.15", 2),
        ("stop_phase_ps = 2e3", 1),
        ("threshold = 32", 1),
        ("spad_rows = 2\nspad_cols = 2\nthreshold = 8", 3),
        ("threshold = 16", 1),
        ("threshold = 17\nevent_type = \"equal\"", 1),
        ("event_type = \"less\"\nthreshold = 0", 2),
        ("front_end = \"or_tree\"\nthreshold = 1", 2),
        ("front_end = \"coincidence\"\ncoincident_spads = 17", 2),
        ("coincident_spads = 0", 1),
        ("front_end = \"and_tree\"", 1),
        ("tdc = \"delay_line\"\nfront_end = \"xor_tree\"", 2),
        ("front_end = \"or_tree\"\ndead_time_ns = 0.9", 2),
        ("spad_cols = 3", 1),
        ("step_periods = 5", 1),
        (
            "p_counter = \"memoryless\"\nafter_borrow = \"wrap\"\nstep_periods = 4",
            3,
        ),
        ("tdc = \"delay_line\"\nthreshold = 1", 2),
        (
            "\nevent_type = \"less\"\nthreshold = 3\ntdc = \"delay_line\"",
            2,
        ),
        ("tdc = \"counter\"\nthreshold = 1", 2),
        ("tdc = \"counter\"\nmode = \"conventional\"", 2),
        ("clk_skew_ps = -1", 1),
        ("delay_sigma = -0.1", 1),
        ("colour = 1", 1),
        ("rows = -3", 1),
        ("afterpulse_probability = 1.1", 1),
        ("crosstalk_probability = -0.1", 1),
        ("afterpulse_time_ns = inf", 1),
        ("event_type = \"more\"", 1),
        ("p_counter = \"grey\"", 1),
        ("p_counter = \"comparator\"\ntap = \"msb\"", 2),
        ("\np_counter = \"memoryless\"", 2),
    ] {
        let error = SensorConfig::parse("s.toml", text).unwrap_err();
        assert_eq!(error.line, Some(line), "{text}: {error}");
        assert!(error.message.contains(';'), "no cure: {error}");
    }
}

#[test]
fn a_dead_time_below_what_the_front_end_follows_is_refused_with_what_was_meant() {
    for (text, says) in [
        ("dead_time_ns = 8e-9", "did you mean 8 (ns)?"),
        ("dead_time_ns = 0.01", "did you mean 10 (ns)?"),
        (
            "dead_time_ns = 0.11",
            "give at least 0.1104; did you mean 110 (ns)?",
        ),
    ] {
        let error = SensorConfig::parse("s.toml", text).unwrap_err();
        assert!(error.message.contains(says), "{error}");
    }
    assert!(SensorConfig::parse("s.toml", "dead_time_ns = 0.1104").is_ok());
}

#[test]
fn a_threshold_that_can_never_be_met_is_refused_with_those_that_can() {
    for (text, says) in [
        (
            "threshold = 16",
            "threshold = 16 with event_type = \"greater\" asks for more than 16, which 16 SPADs can never be; give 0 to 15",
        ),
        (
            "threshold = 17\nevent_type = \"equal\"",
            "asks for exactly 17, which 16 SPADs can never be; give 0 to 16",
        ),
        (
            "threshold = 0\nevent_type = \"less\"",
            "asks for fewer than 0, which 16 SPADs can never be; give 1 to 31",
        ),
        (
            "threshold = 1\nfront_end = \"xor_tree\"",
            "which the one line of front_end = \"xor_tree\" can never be; give 0",
        ),
    ] {
        let error = SensorConfig::parse("s.toml", text).unwrap_err();
        assert!(error.message.ends_with(says), "{error}");
    }
    // Every other condition is one that some number of SPADs meets.
    let types = [EventType::Less, EventType::Equal, EventType::Greater];
    for (event_type, threshold) in types.into_iter().flat_map(|t| (0..36).map(move |n| (t, n))) {
        let config = SensorConfig {
            event_type,
            threshold,
            ..SensorConfig::default()
        };
        let is_met = |spads: u32| correlation::model((1 << spads) - 1, event_type, threshold);
        // The register of the threshold has five bits.
        let may_be = threshold < 32 && (0..=16).any(is_met);
        assert_eq!(config.check().is_ok(), may_be, "{config:?}");
    }
}

#[test]
fn delay_files_names_of_corners_are_understood() {
    for (name, corner) in [
        ("min", Corner::Fast),
        ("typ", Corner::Typ),
        ("max", Corner::Slow),
    ] {
        let config = SensorConfig::parse("s.toml", &format!("corner = {name:?}")).unwrap();
        assert_eq!(config.corner, corner);
        assert_eq!(name.parse(), Ok(corner));
        let again = format!("corner = {:?}", corner.name());
        assert_eq!(SensorConfig::parse("s.toml", &again).unwrap(), config);
        assert!(toml::to_string(&config).unwrap().contains(&again));
    }
}

#[test]
fn a_printed_configuration_reads_back() {
    let config = SensorConfig::default();
    let text = toml::to_string(&config).unwrap();
    assert_eq!(SensorConfig::parse("default", &text).unwrap(), config);
    assert_eq!(
        SensorConfig::parse("default", &config.commented()).unwrap(),
        config
    );
}

#[test]
fn every_key_is_explained_and_has_its_range() {
    let text = SensorConfig::default().commented();
    let table = toml::Table::try_from(SensorConfig::default()).unwrap();
    for key in SensorConfig::KEYS {
        assert!(
            !key.what.is_empty() && !key.source.is_empty(),
            "{}",
            key.name
        );
        let Some(value) = table.get(key.name) else {
            let has_none = key.name.ends_with("_block") || key.name == "temperature_c";
            assert!(has_none, "{}", key.name);
            continue;
        };
        let line = format!("{} = {value}", key.name);
        assert!(text.lines().any(|l| l == line), "{line}");
        // Units stand in names, too, and are understood.
        let suffix = format!("_{}", key.unit.to_lowercase());
        assert!(
            key.unit.is_empty() || key.name.ends_with(&suffix),
            "{}",
            key.name
        );
        assert!(key.plain(&format!("1 {}", key.unit).into()).is_ok());
        let parse = |value: &str| SensorConfig::parse("s", &format!("{} = {value}", key.name));
        if let Range::OneOf(words) = key.range {
            for word in words {
                let text = format!("after_borrow = \"wrap\"\n{} = \"{word}\"", key.name);
                let text = if key.name == "after_borrow" {
                    &text[22..]
                } else {
                    &text[..]
                };
                // Fewer than none are never.
                let met = if key.name == "event_type" {
                    "\nthreshold = 1"
                } else {
                    ""
                };
                SensorConfig::parse("s", &format!("{text}{met}")).unwrap();
            }
            assert!(parse("\"other\"").is_err(), "{}", key.name);
        }
        if let Range::Within(least, most) = key.range {
            // The slowest clock allows every phase.
            // The most SPADs allow every threshold, and fewer than the largest there are always.
            let with = |value: f64| {
                let clk = match key.name {
                    "clk_hz" => "",
                    "threshold" if value > 0.0 => {
                        "spad_rows = 8\nspad_cols = 8\nevent_type = \"less\"\n"
                    }
                    _ => "clk_hz = 1e6\n",
                };
                SensorConfig::parse("s", &format!("{clk}{} = {value}", key.name))
            };
            for value in [least, most] {
                with(value).unwrap();
            }
            for value in [least - 1.0, most + 1.0] {
                assert!(with(value).is_err(), "{} = {value}", key.name);
            }
        }
    }
}

#[test]
fn numbers_may_have_units_and_all_faults_are_told() {
    let config = SensorConfig::parse("s", "clk_hz = \"300 MHz\"\ndead_time_ns = \"9500 ps\"");
    let config = config.unwrap();
    assert_eq!((config.clk_hz, config.dead_time_ns), (300e6, 9.5));
    let text = "rows = 0\nclk_hz = \"8 ns\"\ncolour = 1\nbins = 2.5\nmode = 3\n";
    let error = SensorConfig::parse("s.toml", text).unwrap_err();
    let told = error.to_string();
    let lines: Vec<&str> = told.lines().collect();
    assert_eq!(lines.len(), 5, "{told}");
    for (line, says) in [
        "s.toml:1: rows = 0 is impossible; give 1 to 256",
        "s.toml:2: clk_hz = \"8 ns\" is a time; give a frequency",
        "s.toml:3: unknown key `colour`",
        "s.toml:4: bins = 2.5 is impossible; give a whole number, 1 to 64",
        "s.toml:5: mode: a word belongs here; give guided, conventional",
    ]
    .iter()
    .enumerate()
    {
        assert!(lines[line].starts_with(says), "{told}");
    }
}

proptest! {
    #[test]
    fn garbage_never_panics(text in "\\PC{0,200}") {
        let _ = SensorConfig::parse("garbage", &text);
    }

    #[test]
    fn any_numbers_are_accepted_or_refused(clk: f64, phase: f64, dead: f64, rows: u16) {
        let text = format!("rows = {rows}\nclk_hz = {clk:e}\nstop_phase_ps = {phase:e}\ndead_time_ns = {dead:e}");
        if let Ok(config) = SensorConfig::parse("numbers", &text) {
            config.clock();
            config.dead_time();
            config.stop_phase();
        }
    }
}

/// Release of trapped carriers: slower in the cold, with more of them left after the dead time.
#[test]
fn afterpulses_follow_the_temperature_of_the_junction() {
    let afterpulses = |activation_ev: f64, temperature_c: Option<f64>| {
        let config = SensorConfig {
            afterpulse_probability: 0.02,
            afterpulse_activation_ev: activation_ev,
            temperature_c,
            ..SensorConfig::default()
        };
        config.afterpulses()
    };
    for same in [
        afterpulses(0.0, Some(-40.0)),
        afterpulses(0.3, None),
        afterpulses(0.3, Some(50.0)),
    ] {
        assert_eq!(same, (0.02, 5.0 * 1e-9));
    }
    let (cold, time_s) = afterpulses(0.15, Some(0.0));
    let longer = f64::exp(0.15 / 8.617_333_262e-5 * (1.0 / 273.15 - 1.0 / 323.15));
    assert!((time_s / (5e-9 * longer) - 1.0).abs() < 1e-9, "{time_s}");
    let trapped = 0.02 * f64::exp(8.0 / 5.0);
    let left = trapped * f64::exp(-8.0 / (5.0 * longer));
    assert!((cold / left - 1.0).abs() < 1e-9, "{cold} {left}");
    assert!(afterpulses(0.15, Some(120.0)).0 < 0.02);
    // In the deepest cold time constants have an end.
    assert_eq!(afterpulses(2.0, Some(-55.0)).1, 1e-3);
}
