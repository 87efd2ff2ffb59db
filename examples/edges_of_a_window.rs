//! A window's edges: which photon times each start value's bins collect.
//!
//! `cargo run --release --example edges_of_a_window`

use guided_dtof::chip::{Exposure, SensorConfig, WindowLaw, WindowOutcome};

fn main() {
    let config = SensorConfig::default();
    let exposure = Exposure::new(&config, 520, 1000);
    let law = WindowLaw::new(&config, &exposure);
    println!("start   opens after STOP       closes             strobe's slack");
    for start in [0, 1, 16, 100, 511] {
        match law.window(start) {
            WindowOutcome::Open(window) => {
                let seen = law.interval(&window);
                println!(
                    "{start:5}   {:<20} {:<20} {}",
                    seen.start, seen.end, window.slack
                );
            }
            WindowOutcome::Never => println!("{start:5}   LOCAL_STOP does not come"),
            WindowOutcome::Irregular(why) => println!("{start:5}   {why}"),
            WindowOutcome::Race(race) => println!("{start:5}   {race}"),
        }
    }
    let window = law.window(100).open().expect("it is open");
    let edges = law.edges(&window, 0);
    for bin in [0, 1, 15] {
        let collected = edges.bin(bin);
        println!(
            "start 100, bin {bin:2}: {} to {}",
            collected.start, collected.end
        );
    }
}
