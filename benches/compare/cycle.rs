//! Our side of `verilator.sh`: draws a stimulus for 64×64 macropixels, writes it for the other simulators, and prints the
//! processor seconds of the cycle engine on one thread, a line a run: its logic, and packing the photons for it.
//!
//! | stimulus | |
//! |---|---|
//! | `street` | 10 Mcounts/s a macropixel, and a signal photon in each laser cycle, near the end of the window |
//! | `bright` | 100 Mcounts/s a SPAD behind a dead time of 8 ns: a pulse in one CLK period of 7 |
//! | `every` | every SPAD in every CLK period |

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use cpu_time::ProcessTime;
use guided_dtof::chip::{Exposure, SensorConfig};
use guided_dtof::engine::{Cycle, Histograms};
use guided_dtof::photon::SpadEvent;
use guided_dtof::units::Time;
use rand::{RngExt, SeedableRng, rngs::StdRng};

/// Rising CLK edge and SPAD.
type StimulusPulses = Vec<(u32, u16)>;

fn main() -> std::io::Result<()> {
    let arguments: Vec<String> = std::env::args().filter(|a| a != "--bench").collect();
    let [_, directory, stimulus, periods, cycles, runs] = &arguments[..] else {
        eprintln!("cycle_compare is run by benches/compare/verilator.sh");
        return Ok(());
    };
    let number = |text: &String| text.parse::<u32>().expect("a number");
    let (periods, cycles) = (number(periods), number(cycles));
    let config = SensorConfig::default();
    let exposure = Exposure::new(&config, periods, cycles);
    let random = &mut StdRng::seed_from_u64(1);
    // Windows that the laser cycle is long enough for.
    let largest = 512.min(periods - 2) as u16;
    let starts: Vec<u16> = (0..config.pixels())
        .map(|_| random.random_range(0..largest))
        .collect();
    let taken: Vec<StimulusPulses> = starts
        .iter()
        .map(|&start| match stimulus.as_str() {
            "bright" => bright(random, &config, periods * cycles),
            "every" => (0..periods * cycles)
                .flat_map(|edge| (0..16u16).map(move |spad| (edge, spad)))
                .collect(),
            _ => street(random, &config, periods, cycles, start),
        })
        .collect();
    write_stimulus(Path::new(directory), &starts, &taken)?;

    let half = Time::from_fs(config.clock().period().as_fs() / 2);
    let pulses: Vec<Vec<SpadEvent>> = taken
        .iter()
        .map(|taken| {
            let pulse = |&(edge, spad): &(u32, u16)| SpadEvent {
                time: exposure.rising(i64::from(edge)) - half,
                spad: spad as u8,
            };
            taken.iter().map(pulse).collect()
        })
        .collect();
    drop(taken);
    let pulses: Vec<&[SpadEvent]> = pulses.iter().map(Vec::as_slice).collect();
    let engine = Cycle::new(&config, &exposure);
    assert_eq!(engine.unlevelled(), None);
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    single.expect("a thread").install(|| {
        let mut histograms = Histograms::new(config.bins);
        for _ in 0..number(runs) {
            let clock = ProcessTime::now();
            let packed = engine.pack(&starts, &pulses);
            let packing = clock.elapsed().as_secs_f64();
            let clock = ProcessTime::now();
            histograms = engine
                .replay_packed(&starts, &packed)
                .expect("it is levelised");
            println!("{:.9} {packing:.9}", clock.elapsed().as_secs_f64());
        }
        let counts = histograms.counts().iter().flat_map(|n| n.to_le_bytes());
        std::fs::write(
            Path::new(directory).join("ours.bin"),
            counts.collect::<Vec<u8>>(),
        )
    })
}

fn street(
    random: &mut StdRng,
    config: &SensorConfig,
    periods: u32,
    cycles: u32,
    start: u16,
) -> StimulusPulses {
    let edges = periods * cycles;
    let background = (10e6 / config.clk_hz * f64::from(edges)) as usize;
    let signal = (0..cycles).map(|c| (c * periods + u32::from(start) + edges - 8) % edges);
    let mut taken: StimulusPulses = (0..background)
        .map(|_| random.random_range(0..edges))
        .collect::<Vec<_>>()
        .into_iter()
        .chain(signal)
        .map(|edge| (edge, random.random_range(0..16u16)))
        .collect();
    taken.sort_unstable();
    taken.dedup();
    taken
}

fn bright(random: &mut StdRng, config: &SensorConfig, edges: u32) -> StimulusPulses {
    // Dead for 8 ns, then 100 Mcounts/s: 18 ns from pulse to pulse.
    let (dead, chance) = ((8e-9 * config.clk_hz).ceil() as u32, 100e6 / config.clk_hz);
    let mut taken = StimulusPulses::new();
    for spad in 0..16u16 {
        let mut edge = 0;
        while edge < edges {
            if random.random_bool(chance) {
                taken.push((edge, spad));
                edge += dead;
            } else {
                edge += 1;
            }
        }
    }
    taken.sort_unstable();
    taken
}

fn write_stimulus(
    directory: &Path,
    starts: &[u16],
    taken: &[StimulusPulses],
) -> std::io::Result<()> {
    let file = |name: &str| File::create(directory.join(name)).map(BufWriter::new);
    let mut out = file("starts.bin")?;
    for start in starts {
        out.write_all(&start.to_le_bytes())?;
    }
    out.flush()?;
    let (mut pulses, mut lengths) = (file("pulses.bin")?, file("lengths.bin")?);
    for taken in taken {
        lengths.write_all(&(taken.len() as u32).to_le_bytes())?;
        for &(edge, spad) in taken {
            pulses.write_all(&(edge << 4 | u32::from(spad)).to_le_bytes())?;
        }
    }
    lengths.flush()?;
    pulses.flush()
}
