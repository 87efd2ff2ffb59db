//! Waveforms of a shift register for GTKWave and Surfer: VCD, FST and files that lay out what to look at.
//!
//! ```text
//!   cargo run --example waveform -- FOLDER
//! ```

use std::error::Error;
use std::fs::File;
use std::path::PathBuf;

use femtogate::Origin;
use femtogate::kernel::{Drive, Kernel, Stimulus, clock};
use femtogate::netlist::{CellKind, Corner, Library, ModuleBuilder, Netlist, Timing};
use femtogate::units::{Frequency, Time};
use femtogate::waves::{Entry, FstWriter, Layout, SignalGroup, VcdWriter, WaveSelection};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args_os().nth(1).map(PathBuf::from);
    let folder = folder.unwrap_or_else(std::env::temp_dir);

    let mut m = ModuleBuilder::new("register");
    let (d, clk, reset) = (m.input("D"), m.input("CLK"), m.input("RESET"));
    let q = m.output_bus("Q", 8);
    for stage in 0..q.len() {
        let data = if stage == 0 { d } else { q[stage - 1] };
        // The second output is left open.
        m.cell(
            &format!("stage{stage}"),
            CellKind::Dffr,
            &[data, clk, reset],
            &[Some(q[stage]), None],
        );
    }
    let netlist = Netlist::elaborate(&m.finish()?);
    let timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);

    let [d, clk, reset] = ["D", "CLK", "RESET"].map(|name| netlist.net(name).expect("a port"));
    let drives = [
        (0, reset, true),
        (0, d, true),
        (1, reset, false),
        (4, d, false),
    ];
    let drives = drives.map(|(ns, net, level)| Drive::new(Time::from_ns(ns), net, level));
    let ticks = clock(clk, Frequency::from_hz(1_000_000_000), Time::ZERO, 0, 40);
    let mut stimulus = Stimulus::new(drives).with_drives(ticks);

    // Two observers of one simulation.
    let (vcd, fst) = (folder.join("register.vcd"), folder.join("register.fst"));
    let selection = WaveSelection::all();
    let mut to_vcd = VcdWriter::new(File::create(&vcd)?, &netlist, &selection)?;
    let fst_file = File::options()
        .read(true)
        .write(true)
        .create(true)
        .truncate(true)
        .open(&fst)?;
    let mut to_fst = FstWriter::new(fst_file, &netlist, &selection)?;
    let mut kernel = Kernel::new(&netlist, &timing);
    let end = Time::from_ns(20);
    kernel.run(&mut stimulus, end, &mut (&mut to_vcd, &mut to_fst))?;
    to_vcd.finish(end)?;
    to_fst.finish(end)?;

    let layout = Layout {
        groups: vec![
            SignalGroup::new("inputs", ["CLK", "RESET", "D"].map(Entry::binary)),
            SignalGroup::new("register", [Entry::hex("Q")]),
        ],
        zoom: (Time::ZERO, end),
        marker: Some(Time::from_ns(4)),
        marks: Vec::new(),
    };
    let mut gtkw = File::create(folder.join("register.gtkw"))?;
    layout.write_gtkw(&mut gtkw, &netlist, "register.vcd", Origin::default())?;
    println!("gtkwave {}", folder.join("register.gtkw").display());
    println!("surfer {}", fst.display());
    Ok(())
}
