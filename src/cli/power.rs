//! `gdtof power`: the power of a macropixel's blocks, from the toggles of a gate-level run.

use clap::Args;

use super::SensorArgs;
use super::voice::{busy, say_json, say_unless_quiet};
use crate::analysis::{Capacitances, MacropixelPower};
use crate::chip::{CellLibrary, Exposure, Mode, PCounter, SensorConfig};
use crate::files::InputError;
use crate::photon::{SpadEvent, apply_dead_time};
use crate::report::Grid;
use crate::request::{self, Spelling};
use crate::units::Time;
use rand_philox::splitmix64;

/// Pulses of the laser a second (thesis, Tables 6 and 14).
const LASER_HZ: f64 = 80e3;

/// Arguments of `gdtof power`.
#[derive(Args)]
pub(super) struct PowerArgs {
    #[command(flatten)]
    sensor: SensorArgs,
    /// CLK periods in a laser cycle [default: as many as 80 kHz allow].
    #[arg(long, value_name = "P")]
    stop_periods: Option<u32>,
    /// Laser cycles to simulate.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..))]
    laser_cycles: u32,
    /// Start value of the P-counter [default: half of the largest].
    #[arg(long, value_name = "CODE")]
    start: Option<u16>,
    /// Counts a second of all SPADs of the macropixel together.
    #[arg(long, value_name = "HZ", default_value_t = 20e6)]
    counts_hz: f64,
    /// Supply voltage, V.
    #[arg(long, value_name = "V", default_value_t = Capacitances::default().supply_v)]
    supply_v: f64,
    /// Capacitance of the gates of a transistor pair, fF.
    #[arg(long, value_name = "FF", default_value_t = 1.0)]
    pair_ff: f64,
    /// Capacitance of the wire to a pin, fF.
    #[arg(long, value_name = "FF", default_value_t = 1.0)]
    wire_ff: f64,
    /// Capacitance of the drains at an output, fF.
    #[arg(long, value_name = "FF", default_value_t = 0.6)]
    drain_ff: f64,
    /// Print JSON instead of the table.
    #[arg(long)]
    json: bool,
}

/// A sensor that is compared, and what it took.
#[derive(serde::Serialize)]
struct Variant {
    p_counter: &'static str,
    mode: Mode,
    p_counter_share: f64,
    cycle_j: f64,
    mean_w: f64,
    #[serde(flatten)]
    power: MacropixelPower,
}

impl Variant {
    fn heading(&self) -> String {
        let mode = match self.mode {
            Mode::Guided => "guided",
            Mode::Conventional => "conventional",
        };
        format!("{}, {mode}", self.p_counter)
    }
}

/// Blocks that the guided mode adds (thesis 4.5).
const P_COUNTER_BLOCKS: [&str; 2] = ["p_counter", "p_counter_timing"];

/// Runs the command.
///
/// # Errors
/// Bad input.
pub(super) fn run(args: &PowerArgs) -> anyhow::Result<()> {
    let config = args.sensor.read()?;
    let capacitances = capacitances(args)?;
    let stop_periods = match args.stop_periods {
        Some(0) => {
            return Err(InputError::new(
                "--stop-periods 0",
                "is not a laser cycle; give 1 or more",
            )
            .into());
        }
        Some(periods) => periods,
        None => (config.clk_hz / LASER_HZ).round() as u32,
    };
    check_length(args, &config, stop_periods)?;
    let start = args.start.unwrap_or(config.largest_start() / 2 + 1);
    if start > config.largest_start() {
        let message = format!(
            "does not fit the {}-bit P-counter; give 0 to {}",
            config.counter_bits,
            config.largest_start()
        );
        return Err(InputError::new(format!("--start {start}"), message).into());
    }
    let busy = busy("counting toggles");
    let mut variants = Vec::new();
    let mut wanted = vec![(config.p_counter, config.mode)];
    for variant in [
        (PCounter::Ripple, Mode::Guided),
        (PCounter::Synchronous, Mode::Guided),
        (PCounter::Ripple, Mode::Conventional),
    ] {
        if !wanted.contains(&variant) {
            wanted.push(variant);
        }
    }
    // The first is the sensor's own; what it is compared with is built in.
    let mut own = config.p_counter_block.clone();
    for (p_counter, mode) in wanted {
        let config = SensorConfig {
            p_counter,
            mode,
            p_counter_block: own.take(),
            ..SensorConfig::clone(&config)
        };
        if config.check().is_err() {
            continue;
        }
        let exposure = Exposure::new(&config, stop_periods, args.laser_cycles);
        let pulses = pulses(&config, &exposure, args.counts_hz);
        let power = MacropixelPower::simulate(&config, &exposure, start, &pulses, &capacitances);
        variants.push(Variant {
            p_counter: match config.p_counter_block {
                Some(_) => "own block",
                None => p_counter.name(),
            },
            mode,
            p_counter_share: power.of_blocks_j(&P_COUNTER_BLOCKS) / power.cycle_j(),
            cycle_j: power.cycle_j(),
            mean_w: power.mean_w(),
            power,
        });
    }
    drop(busy);
    if args.json {
        return say_json(&variants);
    }
    say_unless_quiet(format_args!(
        "Switching energy of a macropixel in a laser cycle of {stop_periods} CLK periods at {} MHz, pJ (share)\n{}",
        config.clk_hz / 1e6,
        table(&variants, config.pixels())
    ))?;
    if let Some(library) = CellLibrary::from_config(&config)
        .ok()
        .and_then(CellLibrary::from_file)
    {
        say_unless_quiet(format_args!(
            "\nArea in the cells of {}, um2 (leakage, nW; energy of a laser cycle within cells + in what they drive, pJ)\n{}",
            library.liberty.name,
            silicon_table(&variants)
        ))?;
    }
    Ok(())
}

fn silicon_table(variants: &[Variant]) -> Grid {
    let headings = variants.iter().map(Variant::heading);
    let mut grid = Grid::new(["block".to_owned()].into_iter().chain(headings));
    for block in &variants[0].power.silicon {
        let cell = |variant: &Variant| {
            let mut blocks = variant.power.silicon.iter();
            let found = blocks.find(|other| other.block == block.block);
            found.map_or("-".to_owned(), |of| {
                let (nw, [within, loads]) = (of.leakage_w * 1e9, [of.internal_j, of.loads_j]);
                let (within, loads) = (within * 1e12, loads * 1e12);
                format!("{:.1} ({nw:.4}; {within:.3} + {loads:.3})", of.area)
            })
        };
        let cells = variants.iter().map(cell);
        grid.push([block.block.clone()].into_iter().chain(cells));
    }
    grid
}

fn capacitances(args: &PowerArgs) -> Result<Capacitances, InputError> {
    // The logic of no such chip is fed by 10 V, a pF is a thousand gates, and beyond a count a nanosecond no SPAD recovers.
    let values = [
        ("--supply-v", args.supply_v, 10.0),
        ("--pair-ff", args.pair_ff, 1e3),
        ("--wire-ff", args.wire_ff, 1e3),
        ("--drain-ff", args.drain_ff, 1e3),
        ("--counts-hz", args.counts_hz, 1e9),
    ];
    for (option, value, most) in values {
        if !(0.0..=most).contains(&value) {
            let message = format!("is impossible; give a number from 0 to {most}");
            return Err(InputError::new(format!("{option} {value}"), message));
        }
    }
    Ok(Capacitances {
        supply_v: args.supply_v,
        pair_f: args.pair_ff * 1e-15,
        wire_f: args.wire_ff * 1e-15,
        drain_f: args.drain_ff * 1e-15,
    })
}

/// Pulses at times without a pattern, the same in every run.
/// CLK periods that are simulated at most: 4800 take 6 ms of processor time, so this is two minutes.
const MOST_CLK_PERIODS: u64 = 100_000_000;

/// Pulses that are kept in memory at most, 16 bytes each.
const MOST_PULSES: f64 = 1e8;

/// Refuses what takes too long or too much memory.
///
/// # Errors
/// More CLK periods or pulses than are simulated.
fn check_length(
    args: &PowerArgs,
    config: &SensorConfig,
    stop_periods: u32,
) -> Result<(), InputError> {
    request::exposure(config, stop_periods, args.laser_cycles, Spelling::Options)?;
    let periods = u64::from(args.laser_cycles) * u64::from(stop_periods);
    if periods > MOST_CLK_PERIODS {
        let message = format!(
            "{} laser cycles of {stop_periods} CLK periods are {periods:.1e} CLK periods, of which {MOST_CLK_PERIODS:.0e} are simulated in about two minutes; give fewer laser cycles",
            args.laser_cycles,
            periods = periods as f64,
            MOST_CLK_PERIODS = MOST_CLK_PERIODS as f64,
        );
        return Err(InputError::new("--laser-cycles", message));
    }
    let pulses = args.counts_hz * periods as f64 / config.clk_hz;
    if pulses > MOST_PULSES {
        let message = format!(
            "{pulses:.1e} counts are more than the {MOST_PULSES:.0e} that are simulated; give fewer"
        );
        return Err(InputError::new("--counts-hz", message));
    }
    Ok(())
}

fn pulses(config: &SensorConfig, exposure: &Exposure, counts_hz: f64) -> Vec<SpadEvent> {
    let end_fs = exposure.end().as_fs() as u64;
    let pulses = 0..(counts_hz * exposure.end().as_s()).round() as u64;
    let mut pulses: Vec<SpadEvent> = pulses
        .map(|index| {
            SpadEvent::new(
                Time::from_fs((splitmix64(2 * index) % end_fs) as i64),
                (splitmix64(2 * index + 1) % config.spads() as u64) as u8,
            )
        })
        .collect();
    pulses.sort_unstable();
    apply_dead_time(&mut pulses, &config.spad_model(), 0);
    pulses
}

fn table(variants: &[Variant], pixels: usize) -> Grid {
    let headings = variants.iter().map(Variant::heading);
    let mut grid = Grid::new(["block".to_owned()].into_iter().chain(headings));
    let mut row = |name: &str, cell: &dyn Fn(&Variant) -> String| {
        let cells = variants.iter().map(cell);
        grid.push([name.to_owned()].into_iter().chain(cells));
    };
    let share = |j: f64, variant: &Variant| {
        format!("{:.3} ({:.1} %)", j * 1e12, 100.0 * j / variant.cycle_j)
    };
    for (name, _) in &variants[0].power.blocks_j {
        row(name, &|v| share(v.power.of_blocks_j(&[name]), v));
    }
    row("P-counter and its timing", &|v| {
        share(v.power.of_blocks_j(&P_COUNTER_BLOCKS), v)
    });
    row("macropixel", &|v| format!("{:.3}", v.cycle_j * 1e12));
    row("toggles", &|v| format!("{:.0}", v.power.toggles));
    row("mean power, uW", &|v| format!("{:.3}", v.mean_w * 1e6));
    row(&format!("of {pixels} macropixels, mW"), &|v| {
        format!("{:.2}", v.mean_w * 1e3 * pixels as f64)
    });
    grid
}
