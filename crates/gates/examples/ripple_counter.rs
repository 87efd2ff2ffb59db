//! A ripple counter, from its description to what it counts.
//!
//! ```text
//!   CLK ─►│bit0├─ QN0 ─►│bit1├─ QN1 ─►│bit2├─ …     each bit turns when the one before it falls
//! ```

use std::error::Error;

use femtogate::kernel::{Drive, Kernel, Stimulus, clock};
use femtogate::netlist::{CellKind, Corner, Library, ModuleBuilder, Netlist, Timing};
use femtogate::units::{Frequency, Time};

fn main() -> Result<(), Box<dyn Error>> {
    // The circuit is described once, and flattened.
    let mut m = ModuleBuilder::new("counter");
    let (mut clk, reset, q) = (m.input("CLK"), m.input("RESET"), m.output_bus("Q", 8));
    for (bit, &q) in q.iter().enumerate() {
        let qn = m.wire(&format!("QN{bit}"));
        m.cell(
            &format!("bit{bit}"),
            CellKind::Dffr,
            &[qn, clk, reset],
            &[q, qn],
        );
        clk = qn;
    }
    let netlist = Netlist::elaborate(&m.finish()?);
    let timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);

    // A reset pulse, and a clock of 500 MHz for 100 periods.
    let [clk, reset] = ["CLK", "RESET"].map(|name| netlist.net(name).expect("a port"));
    let pulse = [(0, true), (1, false)];
    let pulse = pulse.map(|(ns, level)| Drive::new(Time::from_ns(ns), reset, level));
    let ticks = clock(clk, Frequency::from_hz(500_000_000), Time::ZERO, 0, 201);
    let mut stimulus = Stimulus::new(pulse).with_drives(ticks);

    // The kernel runs in pieces; between them it can be asked anything.
    let q = netlist.signal("Q").expect("a port");
    let mut kernel = Kernel::new(&netlist, &timing);
    for ns in [0, 50, 100, 202] {
        kernel.run(&mut stimulus, Time::from_ns(ns), &mut ())?;
        match kernel.number(&q) {
            Some(count) => println!("{:>10}: {count}", kernel.now().to_string()),
            None => println!("{:>10}: unknown", kernel.now().to_string()),
        }
    }
    let statistics = kernel.statistics();
    println!(
        "{} changes of {} nets, {} evaluations of {} cells",
        statistics.changes,
        netlist.net_count(),
        statistics.evaluations,
        netlist.cells().len()
    );
    Ok(())
}
