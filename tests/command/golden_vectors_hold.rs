//! Recorded stimuli in `vectors/replay` still give the recorded histograms, on every engine, and the delays of every
//! P-counter's macropixel are those in `vectors/timing`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use guided_dtof::chip::{AfterBorrow, ChipTiming, PCounter, SensorConfig, Tap};
use guided_dtof::netlist::Corner;
use guided_dtof::units::Time;

fn vectors() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("vectors/replay")
}

#[test]
fn on_every_engine() {
    let golden = std::fs::read_to_string(vectors().join("histograms.csv")).unwrap();
    let counts: Vec<u32> = golden
        .lines()
        .skip(1)
        .map(|line| line.rsplit(',').next().unwrap().parse().unwrap())
        .collect();
    assert_eq!(counts.len(), 2 * 3 * 8);
    assert!(counts.contains(&15), "no bin saturates");
    assert!(
        counts[5 * 8..].iter().all(|&n| n == 0),
        "a start value beyond the laser cycle counted"
    );
    for engine in ["gate", "cycle", "window"] {
        let output = Command::new(env!("CARGO_BIN_EXE_gdtof"))
            .args(["replay", "--sensor", "sensor.toml", "--inits", "inits.csv"])
            .args([
                "--events",
                "events.csv",
                "--stop-periods",
                "80",
                "--laser-cycles",
                "40",
            ])
            .args(["--engine", engine])
            .current_dir(vectors())
            .output()
            .unwrap();
        assert!(output.status.success(), "{output:?}");
        assert_eq!(
            String::from_utf8(output.stdout).unwrap(),
            golden,
            "{engine}"
        );
    }
}

/// Name and value, fs, of every delay and limit; a path that a P-counter does not have is left empty.
fn delays(timing: &ChipTiming) -> [(&'static str, Option<Time>); 27] {
    let counter = &timing.counter;
    [
        ("spad_to_sampled", Some(timing.spad_to_sampled)),
        ("pulse_width", Some(timing.pulses.width)),
        ("pulses_apart", Some(timing.pulses.apart)),
        ("clk_to_counter_clk", Some(timing.clk_to_counter_clk)),
        ("clk_to_local_stop", Some(counter.clk_to_local_stop)),
        ("reset_to_local_stop", counter.reset_to_local_stop),
        ("counter_release", Some(counter.release)),
        ("counter_settle", Some(counter.settle)),
        ("counter_period", Some(counter.period)),
        ("counter_recovery", Some(counter.recovery)),
        ("counter_removal", Some(counter.removal)),
        ("counter_clock_high", Some(counter.clock_high)),
        ("local_stop_to_strobe", Some(timing.local_stop_to_strobe)),
        ("stop_to_strobe", Some(timing.stop_to_strobe)),
        ("strobe_to_hit", Some(timing.strobe_to_hit)),
        ("clk_to_shift", Some(timing.clk_to_shift)),
        ("stop_to_reset", Some(timing.stop_to_reset)),
        ("stop_to_reset_release", Some(timing.stop_to_reset_release)),
        ("stop_to_hit_reset", Some(timing.stop_to_hit_reset)),
        ("stop_to_hit_release", Some(timing.stop_to_hit_release)),
        ("stop_to_enabled", Some(timing.stop_to_enabled)),
        ("clk_to_event", Some(timing.clk_to_event)),
        ("setup", Some(timing.setup)),
        ("hold", Some(timing.hold)),
        ("recovery", Some(timing.recovery)),
        ("removal", Some(timing.removal)),
        ("ripple", Some(timing.ripple())),
    ]
}

/// The default sensor with every P-counter, tap, behaviour after the borrow and corner.
fn sensors() -> Vec<SensorConfig> {
    let mut sensors = Vec::new();
    for p_counter in PCounter::ALL {
        for tap in Tap::ALL {
            for after_borrow in AfterBorrow::ALL {
                for corner in Corner::ALL {
                    sensors.push(SensorConfig {
                        p_counter,
                        tap,
                        after_borrow,
                        corner,
                        ..SensorConfig::default()
                    });
                }
            }
        }
    }
    sensors.retain(|sensor| sensor.check().is_ok());
    sensors
}

/// Set GDTOF_REMAKE to write the file anew (`vectors/remake.sh` does) after a deliberate change of the cell library or of
/// a circuit.
#[test]
fn in_the_delays_of_every_p_counter() {
    let mut found = "p_counter,tap,after_borrow,corner".to_owned();
    for (name, _) in delays(&ChipTiming::new(&SensorConfig::default())) {
        write!(found, ",{name}_fs").unwrap();
    }
    for sensor in sensors() {
        let SensorConfig {
            p_counter,
            tap,
            after_borrow,
            corner,
            ..
        } = sensor;
        let corner = corner.name();
        let variant = format!("{p_counter:?},{tap:?},{after_borrow:?},{corner}");
        write!(found, "\n{variant}").unwrap();
        for (_, time) in delays(&ChipTiming::new(&sensor)) {
            let time = time.map(|time| time.as_fs().to_string());
            write!(found, ",{}", time.unwrap_or_default()).unwrap();
        }
    }
    found.push('\n');
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("vectors/timing/paths.csv");
    if std::env::var_os("GDTOF_REMAKE").is_some() {
        std::fs::write(&file, &found).unwrap();
    }
    assert_eq!(found, std::fs::read_to_string(&file).unwrap());
}
