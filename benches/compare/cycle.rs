//! Our side of `verilator.sh`: draws a stimulus for 64×64 macropixels, writes it for the other simulator, and
//! prints the seconds of the cycle engine's logic on all threads and on one, and of sorting the photons.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::time::Instant;

use guided_dtof::chip::{Exposure, SensorConfig};
use guided_dtof::engine::Cycle;
use guided_dtof::photon::SpadEvent;
use guided_dtof::units::Time;
use rand::{RngExt, SeedableRng, rngs::StdRng};

fn main() -> std::io::Result<()> {
    let arguments: Vec<String> = std::env::args().filter(|a| a != "--bench").collect();
    let [_, directory, periods, cycles] = &arguments[..] else {
        eprintln!("cycle_compare is run by benches/compare/verilator.sh");
        return Ok(());
    };
    let number = |text: &String| text.parse::<u32>().expect("a number");
    let (periods, cycles) = (number(periods), number(cycles));
    let config = SensorConfig::default();
    let exposure = Exposure::new(&config, periods, cycles);
    let random = &mut StdRng::seed_from_u64(1);
    let starts: Vec<u16> = (0..config.pixels())
        .map(|_| random.random_range(0..512))
        .collect();

    // 10 Mcounts/s of background and one signal photon in each laser cycle, near the end of the window.
    let edges = periods * cycles;
    let background = (10e6 / config.clk_hz * f64::from(edges)) as usize;
    let mut events = Vec::new();
    for (pixel, &start) in starts.iter().enumerate() {
        let signal = (0..cycles).map(|c| (c * periods + u32::from(start) + edges - 8) % edges);
        let mut taken: Vec<(u32, u16)> = (0..background)
            .map(|_| random.random_range(0..edges))
            .collect::<Vec<_>>()
            .into_iter()
            .chain(signal)
            .map(|edge| (edge, random.random_range(0..16)))
            .collect();
        taken.sort_unstable();
        taken.dedup();
        events.push((pixel as u16, taken));
    }
    let half = Time::from_fs(config.clock().period().as_fs() / 2);
    let pulses: Vec<Vec<SpadEvent>> = events
        .iter()
        .map(|(_, taken)| {
            let pulse = |&(edge, spad): &(u32, u16)| SpadEvent {
                time: exposure.rising(i64::from(edge)) - half,
                spad: spad as u8,
            };
            taken.iter().map(pulse).collect()
        })
        .collect();
    write_stimulus(Path::new(directory), &starts, &events)?;

    let pulses: Vec<&[SpadEvent]> = pulses.iter().map(Vec::as_slice).collect();
    let engine = Cycle::new(&config, &exposure);
    assert_eq!(engine.unlevelled(), None);
    let (mut sorting, mut all, mut one) = (f64::MAX, f64::MAX, f64::MAX);
    let single = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread");
    let mut histograms = Vec::new();
    let mut packed = engine.pack(&starts, &pulses);
    for _ in 0..5 {
        let start = Instant::now();
        packed = engine.pack(&starts, &pulses);
        sorting = sorting.min(start.elapsed().as_secs_f64());
        let start = Instant::now();
        histograms = engine.run(&starts, &packed).expect("it is levelised");
        all = all.min(start.elapsed().as_secs_f64());
        let start = Instant::now();
        single
            .install(|| engine.run(&starts, &packed))
            .expect("it is levelised");
        one = one.min(start.elapsed().as_secs_f64());
    }
    let mut out = BufWriter::new(File::create(Path::new(directory).join("ours.bin"))?);
    for count in histograms.concat() {
        out.write_all(&count.to_le_bytes())?;
    }
    out.flush()?;
    println!("{all} {one} {sorting}");
    drop(packed);
    Ok(())
}

fn write_stimulus(
    directory: &Path,
    starts: &[u16],
    events: &[(u16, Vec<(u32, u16)>)],
) -> std::io::Result<()> {
    let mut out = BufWriter::new(File::create(directory.join("starts.bin"))?);
    for start in starts {
        out.write_all(&start.to_le_bytes())?;
    }
    out.flush()?;
    let mut all: Vec<(u32, u16, u16)> = events
        .iter()
        .flat_map(|(pixel, taken)| taken.iter().map(move |&(edge, spad)| (edge, *pixel, spad)))
        .collect();
    all.sort_unstable();
    let mut out = BufWriter::new(File::create(directory.join("pulses.bin"))?);
    for (edge, pixel, spad) in all {
        out.write_all(&edge.to_le_bytes())?;
        out.write_all(&pixel.to_le_bytes())?;
        out.write_all(&spad.to_le_bytes())?;
    }
    out.flush()
}
