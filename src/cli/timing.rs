//! `gdtof timing`: ripple, shortest CLK periods and margins, by static timing and by simulation.

use clap::{Args, ValueEnum};

use super::{SensorArgs, say};
use crate::chip::SensorConfig;
use crate::engine::timing::{MacropixelTiming, gate_works, phases, ripple, shortest_period};
use crate::files::InputError;
use crate::netlist::{Conditions, Library, Mismatch, Netlist, Process, Timing, varied};
use crate::report::Table;
use crate::units::Time;

#[derive(Clone, Copy, ValueEnum)]
enum Silicon {
    Slow,
    Typ,
    Fast,
}

/// Arguments of `gdtof timing`.
#[derive(Args)]
pub struct TimingArgs {
    #[command(flatten)]
    sensor: SensorArgs,
    /// Silicon; like voltage and temperature it scales the delays of the sensor's corner.
    #[arg(long, value_enum, default_value = "typ")]
    process: Silicon,
    /// Supply, V.
    #[arg(long, value_name = "V", default_value_t = 1.1)]
    voltage: f64,
    /// Junction temperature, °C.
    #[arg(
        long,
        value_name = "C",
        default_value_t = 50.0,
        allow_negative_numbers = true
    )]
    temperature: f64,
    /// Random mismatch: standard deviation of an inverter's delay, relative.
    #[arg(long, value_name = "SIGMA", default_value_t = 0.0)]
    mismatch: f64,
    /// Seed of the mismatch.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// JSON instead of tables; times in picoseconds.
    #[arg(long)]
    json: bool,
}

/// Longest period that is tried.
const SLOW: Time = Time::from_ns(20);

/// Runs the command.
///
/// # Errors
/// Bad input.
pub fn run(args: &TimingArgs) -> anyhow::Result<()> {
    let config = args.sensor.read()?;
    let conditions = Conditions {
        process: match args.process {
            Silicon::Slow => Process::Slow,
            Silicon::Typ => Process::Typ,
            Silicon::Fast => Process::Fast,
        },
        voltage_v: args.voltage,
        temperature_c: args.temperature,
    };
    let factor = conditions.delay_factor().ok_or_else(|| {
        let message = "no delays are known there; give -55 to 150 °C and a supply up to 2 V at least 0.2 V above the threshold of about 0.4 V";
        InputError::new("--voltage, --temperature", message)
    })?;
    if !(0.0..=0.5).contains(&args.mismatch) {
        let message = format!("{} is no relative spread; give 0 to 0.5", args.mismatch);
        return Err(InputError::new("--mismatch", message).into());
    }
    let mismatch = (args.mismatch > 0.0).then_some(Mismatch {
        sigma: args.mismatch,
        seed: args.seed,
    });
    let delays = |netlist: &Netlist| -> Timing {
        let nominal = Timing::nominal(netlist, &Library::default(), config.corner);
        varied(netlist, &nominal, factor, mismatch)
    };

    let pixel = MacropixelTiming::of(&config, &delays);
    let any_phase = |works: &dyn Fn(Time, Time) -> bool, period| {
        phases(period).any(|phase| works(period, phase))
    };
    let by_gates = |period, phase| gate_works(&config, &delays, period, phase);
    let by_paths = |period, phase| pixel.works(period, phase);
    // With a free phase the strobe's own crossing is excluded, so the search stays below it.
    let below = pixel.strobe_period() - Time::from_ps(20);
    let rows = [
        ("delay factor of the conditions", Time::ZERO, factor),
        (
            "CLK fall to LOCAL_STOP rise (ripple)",
            pixel.ripple.delay(),
            0.0,
        ),
        ("CLK fall to STROBE rise, longest", pixel.strobe, 0.0),
        ("CLK rise to SHIFT change, shortest", pixel.shift, 0.0),
        ("CLK rise to SPAD_EVENT, longest", pixel.event.delay(), 0.0),
        ("reset pulse width, shortest", pixel.reset_width(), 0.0),
        (
            "reset to next stage's clock, longest",
            pixel.reset_to_stage_clock,
            0.0,
        ),
        (
            "reset to unblocked COUNTER_CLK, longest",
            pixel.reset_to_counter_clk,
            0.0,
        ),
    ];
    let periods = [
        (
            "twice the ripple (thesis 4.6)",
            Some(pixel.ripple.delay() * 2),
            None,
        ),
        (
            "STOP on CLK's fall",
            shortest_period(SLOW, |p| by_paths(p, Time::ZERO)),
            shortest_period(SLOW, |p| by_gates(p, Time::ZERO)),
        ),
        (
            "best STOP phase, beyond the crossing",
            shortest_period(below, |p| any_phase(&by_paths, p)),
            // No pattern of photons is known to excite the longest correlation path, which rules here.
            None,
        ),
        ("correlation path", Some(pixel.correlation_period()), None),
    ];
    let ripples: Vec<(usize, Time, Time)> = (2..=12)
        .map(|bits| {
            let config = SensorConfig {
                counter_bits: bits,
                ..config.clone()
            };
            let (longest, simulated) = ripple(&config, &delays);
            (bits, longest, simulated)
        })
        .collect();

    let ps = |time: Time| time.as_fs() as f64 * 1e-3;
    if args.json {
        let document = serde_json::json!({
            "delay_factor": factor,
            "paths_ps": rows[1..].iter().map(|(name, time, _)| serde_json::json!({"path": name, "ps": ps(*time)})).collect::<Vec<_>>(),
            "periods_ps": periods.iter().map(|(name, paths, gates)| serde_json::json!({
                "limit": name, "static": paths.map(ps), "event_driven": gates.map(ps)})).collect::<Vec<_>>(),
            "ripples_ps": ripples.iter().map(|(stages, a, b)| serde_json::json!({
                "stages": stages, "static": ps(*a), "event_driven": ps(*b)})).collect::<Vec<_>>(),
        });
        say(format_args!("{document:#}\n"))?;
        return Ok(());
    }
    let mut table = Table::new("Paths of a macropixel").row(rows[0].0, format!("{factor:.4}"));
    for (name, time, _) in &rows[1..] {
        table.push(*name, time);
    }
    say(format_args!("{table}\n"))?;
    let show = |time: Option<Time>| time.map_or("-".to_owned(), |t| t.to_string());
    let mut table =
        Table::new("Shortest CLK period, setup and hold not counted: static, event-driven");
    for (name, paths, gates) in periods {
        table.push(name, format!("{}  {:>9}", show(paths), show(gates)));
    }
    say(format_args!("{table}\n"))?;
    let mut table = Table::new("Ripple COUNTER_CLK to LOCAL_STOP by stages: static, event-driven");
    for (bits, longest, simulated) in ripples {
        table.push(bits.to_string(), format!("{longest}  {simulated}"));
    }
    say(table)?;
    Ok(())
}
