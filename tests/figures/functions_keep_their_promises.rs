//! Numerical stability: how far functions are from references of many digits, at extreme arguments.
//!
//! `vectors/stability/make.py` and the scripts in `vectors/theory` compute the references with mpmath at 34 to 360
//! digits and keep them in files beside them: arguments as exact doubles, references last. [`functions`] lists the
//! functions concerned, each with the largest error that is promised; a function joins by a file there and a line here.

use guided_dtof::chip::{Exposure, Overflow, SensorConfig, WindowLaw, histogram};
use guided_dtof::engine::cohort::{BlindSpad, at_least_hit, none_of};
use guided_dtof::photon::{DeadTimeLaw, NormalSampler, Poisson, pulse_share};
use guided_dtof::ranging::{PeakOptions, interpolate};
use guided_dtof::report::Grid;
use guided_dtof::theory::detection::{self, Detection, DetectionModel, PerCycle, Ties};
use guided_dtof::theory::precision::{cramer_rao, thompson};
use guided_dtof::units::{Frequency, Time};

/// A table in `vectors`; which function of how many it holds.
macro_rules! references {
    ($name:literal) => {
        references!($name, 0 of 1)
    };
    ($name:literal, $function:literal of $functions:literal) => {
        $crate::functions_keep_their_promises::References {
            csv: include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/vectors/", $name, ".csv")),
            functions: $functions,
            function: $function,
        }
    };
}

mod tools;

/// A result to compare.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Value {
    /// A number of whole units: femtoseconds, counts.
    Whole(i64),
    /// A real number; NaN stands for "no result".
    Real(f64),
}

/// What an error is measured against.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Measure {
    /// The reference. Where that is 0, any difference counts as infinite.
    Relative,
    /// One: for probabilities that are kept as fixed-point numbers, and for positions.
    Absolute,
}

/// A table of references: CSV with a header, one case a line.
#[derive(Debug, Clone, Copy)]
struct References {
    csv: &'static str,
    /// Number of functions. Its last columns hold their references, those before are arguments.
    functions: usize,
    /// Which of them is meant.
    function: usize,
}

/// A function and its references.
#[derive(Debug, Clone, Copy)]
struct Function {
    /// Its name in tables.
    name: &'static str,
    /// What range the references cover.
    range: &'static str,
    /// What it is compared with.
    references: References,
    /// The function of one line's arguments.
    compute: fn(&[f64]) -> Value,
    /// How its error is measured.
    measure: Measure,
    /// The largest error it promises.
    promise: f64,
}

/// The worst of a function's errors.
#[derive(Debug, Clone, PartialEq)]
struct Worst {
    /// References compared.
    cases: usize,
    /// Largest error.
    error: f64,
    /// Where it occurs, as `name = value` pairs; empty if there is no error at all.
    at: String,
}

/// Every function in the table.
fn functions() -> Vec<Function> {
    let mut all = tools::functions();
    all.extend(whole());
    all
}

/// Functions that a user of the library meets.
fn whole() -> Vec<Function> {
    vec![
        Function {
            name: "share of a Gaussian pulse",
            range: "edges to 30 sigma, widths 1e-9 to 1e3 sigma, sigma << bin",
            references: references!("stability/pulse_share"),
            compute: |a| Value::Real(pulse_share(a[0], a[1], a[2])),
            measure: Measure::Relative,
            promise: 1e-12,
        },
        Function {
            name: "normal draws of the photon stream",
            range: "tails from 1/2 to 2^-48, in standard deviations",
            references: references!("stability/normal_draws"),
            compute: |a| Value::Real(NormalSampler::new(1.0).draw(a[0] as u64)),
            measure: Measure::Absolute,
            promise: 1e-7,
        },
        Function {
            name: "at least k of 16 SPADs hit",
            range: "1e-15 to 34.5 photons: p within 1e-15 of 0 and 1",
            references: references!("stability/hit_tails"),
            compute: |a| Value::Real(at_least_hit(a[0] as usize, 16, a[1])),
            measure: Measure::Relative,
            promise: 1e-13,
        },
        Function {
            name: "none of n cycles hit",
            range: "n to 1e9, p from 1e-15 to 0.5",
            references: references!("stability/none_hit"),
            compute: |a| Value::Real(none_of(a[0] as u64, a[1], 1.0 - a[1])),
            measure: Measure::Relative,
            promise: 1e-12,
        },
        Function {
            name: "pulses of a SPAD in even light",
            range: "both dead-time laws, 1e-15 to 1e3 photons a step, dead time 1 to 1000 steps",
            references: references!("stability/steady_pulse"),
            compute: |a| {
                let law = match a[0] {
                    0.0 => DeadTimeLaw::NonParalysable,
                    _ => DeadTimeLaw::Paralysable,
                };
                Value::Real(BlindSpad::new(law, a[1]).steady_pulse(a[2]))
            },
            measure: Measure::Relative,
            promise: 1e-11,
        },
        Function {
            name: "Poisson exceedance table",
            range: "means 1e-15 to 64, counts to 150",
            references: references!("stability/poisson_exceedance"),
            compute: |a| Value::Real(Poisson::new(a[0]).exceedance(a[1] as usize)),
            measure: Measure::Absolute,
            promise: 1e-15,
        },
        Function {
            name: "clock edges",
            range: "1 Hz to 1 THz, to half period 2e12",
            references: references!("stability/clock_edges"),
            compute: |a| {
                let edge = Frequency::from_hz(a[0] as u64).half_periods(a[1] as i64);
                Value::Whole(edge.as_fs())
            },
            measure: Measure::Relative,
            promise: 0.0,
        },
        Function {
            name: "window law: edge of a bin",
            range: "start values 0 to 511, laser cycles to 1e9",
            references: references!("stability/window_edges"),
            compute: |a| {
                let config = SensorConfig::default();
                let law = WindowLaw::new(&config, &Exposure::new(&config, 520, u32::MAX));
                let window = law.window(a[0] as u16).open();
                Value::Whole(window.map_or(i64::MIN, |window| {
                    let photons = law.bin_interval(&window, a[1] as i64, a[2] as i64);
                    let edge = photons.end + law.timing().spad_to_sampled - Time::from_fs(1);
                    edge.as_fs()
                }))
            },
            measure: Measure::Relative,
            promise: 0.0,
        },
        Function {
            name: "counters",
            range: "1 to 16 bits at the boundary, to 1e9 hits, saturating and wrapping",
            references: references!("stability/counters"),
            compute: |a| {
                let overflow = match a[1] {
                    0.0 => Overflow::Saturate,
                    _ => Overflow::Wrap,
                };
                Value::Whole(histogram::model(a[2] as u64, a[0] as u32, overflow).into())
            },
            measure: Measure::Relative,
            promise: 0.0,
        },
        Function {
            name: "peak position, bins",
            range: "no counts, even counts, one count, counts to 2^32 - 1",
            references: references!("stability/peak_positions"),
            compute: |a| {
                let counts: Vec<u32> = a.iter().map(|&count| count as u32).collect();
                let peak = interpolate(&counts, &PeakOptions::default());
                Value::Real(peak.map_or(f64::NAN, |peak| peak.position_bins))
            },
            measure: Measure::Absolute,
            promise: 1e-14,
        },
        Function {
            name: "probability of detection (Eq. 17)",
            range: "1e-6 to 1e9 counts a bin, to 1e6 cycles of one hit each, 2 to 4096 bins, every rule of ties",
            references: references!("theory/detection", 0 of 2),
            compute: |a| Value::Real(detection(a).probability),
            measure: Measure::Relative,
            promise: 1e-12,
        },
        Function {
            name: "probability of a miss, its complement",
            range: "the same, down to 1e-290",
            references: references!("theory/detection", 1 of 2),
            compute: |a| Value::Real(detection(a).miss),
            measure: Measure::Relative,
            promise: 1e-12,
        },
        Function {
            name: "the same with Gaussian counts (Eq. 18-19)",
            range: "1e-6 to 1e9 counts a bin, as meant and as printed",
            references: references!("theory/gaussian"),
            compute: |a| {
                let light = PerCycle {
                    signal: a[1],
                    background: a[2],
                    bins: a[3] as u32,
                };
                let model = match a[0] {
                    0.0 => DetectionModel::Gaussian,
                    _ => DetectionModel::GaussianAsPrinted,
                };
                Value::Real(detection::probability(&light, 1, model).probability)
            },
            measure: Measure::Relative,
            promise: 1e-12,
        },
        Function {
            name: "precision after Thompson (Eq. 20)",
            range: "sigma 1e-6 to 1e6 bins, background 0 to 1e9, signal 1e-12 to 1e9",
            references: references!("stability/thompson"),
            compute: |a| Value::Real(thompson(a[0], a[1], a[2], a[3])),
            measure: Measure::Relative,
            promise: 1e-14,
        },
        Function {
            name: "Cramer-Rao bound (Eq. 22)",
            range: "sigma 0.02 to 40 bins, background 0 to 1e9, signal 1e-3 to 1e9",
            references: references!("theory/precision"),
            compute: |a| Value::Real(cramer_rao(a[0], a[1], a[2], a[3])),
            measure: Measure::Relative,
            promise: 1e-12,
        },
    ]
}

/// Of a line of `theory/detection.csv`: law, cycles, signal, background, bins and rule of ties.
fn detection(a: &[f64]) -> Detection {
    let ties = [Ties::Strict, Ties::Random, Ties::Loose][a[5] as usize];
    let light = PerCycle {
        signal: a[2],
        background: a[3],
        bins: a[4] as u32,
    };
    let (model, cycles) = match a[0] {
        0.0 => (DetectionModel::Poisson(ties), 1),
        _ => (DetectionModel::Bernoulli(ties), a[1] as u64),
    };
    detection::probability(&light, cycles, model)
}

/// A number, or which of its like a word is; nothing counts as 0.
fn argument(text: &str) -> f64 {
    match text {
        "" | "poisson" | "strict" | "meant" => 0.0,
        "bernoulli" | "random" | "printed" => 1.0,
        "loose" => 2.0,
        number => number.parse().expect("a number"),
    }
}

impl Function {
    /// Compares the function with all its references.
    fn worst(&self) -> Worst {
        let References {
            csv,
            functions,
            function,
        } = self.references;
        let mut lines = csv.lines();
        let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
        let mut worst = Worst {
            cases: 0,
            error: 0.0,
            at: String::new(),
        };
        for line in lines {
            let fields: Vec<&str> = line.split(',').collect();
            let (texts, references) = fields.split_at(fields.len() - functions);
            let arguments: Vec<f64> = texts.iter().map(|text| argument(text)).collect();
            let error = self.error((self.compute)(&arguments), references[function]);
            worst.cases += 1;
            if error > worst.error {
                worst.error = error;
                let pairs = header.iter().zip(texts.iter().zip(&arguments));
                let pairs: Vec<String> = pairs
                    .filter(|(_, (text, _))| !text.is_empty())
                    .map(|(name, (text, x))| match text.parse::<f64>() {
                        Ok(_) => format!("{name} = {x:e}"),
                        Err(_) => format!("{name} = {text}"),
                    })
                    .collect();
                worst.at = pairs.join(", ");
            }
        }
        worst
    }

    fn error(&self, value: Value, reference: &str) -> f64 {
        let (difference, size) = match value {
            Value::Whole(value) => {
                let reference: i64 = reference.parse().expect("a whole number");
                (value.abs_diff(reference) as f64, reference as f64)
            }
            Value::Real(value) => {
                let reference: f64 = reference.parse().expect("a number");
                if value.is_nan() || reference.is_nan() {
                    let agree = value.is_nan() && reference.is_nan();
                    return if agree { 0.0 } else { f64::INFINITY };
                }
                ((value - reference).abs(), reference)
            }
        };
        match self.measure {
            _ if difference == 0.0 => 0.0,
            Measure::Absolute => difference,
            Measure::Relative => difference / size.abs(),
        }
    }
}

/// The table of all functions, the same for `docs/robustness.md`, and whether every one keeps its promise.
fn table() -> (Grid, String, bool) {
    let mut grid = Grid::new([
        "function", "range", "cases", "error", "worst", "promised", "at",
    ]);
    let mut rows = "| function | range | references | error | worst | promised |\n|---|---|---:|---|---:|---:|\n".to_owned();
    let mut kept = true;
    for function in functions() {
        let worst = function.worst();
        kept &= worst.error <= function.promise;
        let measure = match function.measure {
            Measure::Relative => "relative",
            Measure::Absolute => "absolute",
        };
        let (
            Function {
                name,
                range,
                promise,
                ..
            },
            Worst { cases, error, .. },
        ) = (&function, &worst);
        rows +=
            &format!("| {name} | {range} | {cases} | {measure} | {error:.0e} | {promise:.0e} |\n");
        grid.push([
            function.name.to_owned(),
            function.range.to_owned(),
            worst.cases.to_string(),
            measure.to_owned(),
            format!("{:.1e}", worst.error),
            format!("{:.0e}", function.promise),
            worst.at,
        ]);
    }
    (grid, rows, kept)
}

/// What the table of `docs/robustness.md` says but for the worst errors, whose last digit is this machine's.
fn promises(table: &str) -> Vec<Vec<&str>> {
    let rows = table.lines().filter(|line| !line.starts_with("|--"));
    let rows = rows.map(|line| line.split(" | ").collect());
    rows.map(|row: Vec<&str>| [&row[..4], &row[5..]].concat())
        .collect()
}

/// Set GDTOF_REMAKE to write the table anew (`vectors/remake.sh` does).
#[test]
fn every_function_keeps_its_promise() {
    let (table, rows, kept) = table();
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/robustness.md");
    let mut document = std::fs::read_to_string(path).unwrap();
    let start = document.find("| function | range |").expect("a table");
    let end = start + document[start..].find("\n\n").expect("an end of it") + 1;
    if std::env::var_os("GDTOF_REMAKE").is_some() {
        document.replace_range(start..end, &rows);
        std::fs::write(path, document).unwrap();
    } else {
        assert_eq!(promises(&document[start..end]), promises(&rows));
    }
    println!("{table}");
    assert!(
        kept,
        "a function is further from its reference than it promises: {table}"
    );
}

#[test]
fn a_wrong_function_is_found_out() {
    let functions = functions();
    for function in functions.iter().filter(|f| f.promise > 0.0) {
        let function = Function {
            compute: |_| Value::Real(1.5),
            ..*function
        };
        assert!(
            function.worst().error > function.promise,
            "{}",
            function.name
        );
    }
    for function in functions.iter().filter(|f| f.promise == 0.0) {
        let function = Function {
            compute: |_| Value::Whole(7),
            ..*function
        };
        assert!(function.worst().error > 0.0, "{}", function.name);
    }
}
