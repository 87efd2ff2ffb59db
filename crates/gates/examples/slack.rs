//! The slack of a pipeline's clock: the flip-flop with the least, and the path that leads to it.

use std::error::Error;

use femtogate::netlist::{
    CellKind, CheckKind, Corner, Library, ModuleBuilder, Netlist, Requirements, StaticTiming,
    Timing,
};
use femtogate::units::Frequency;

fn main() -> Result<(), Box<dyn Error>> {
    // Two registers of four bits, with an exclusive OR of all bits between them.
    let mut m = ModuleBuilder::new("parity");
    let (clk, reset, data) = (m.input("CLK"), m.input("RESET"), m.input_bus("DATA", 4));
    let parity = m.output("PARITY");
    let word = m.wire_bus("WORD", 4);
    for (bit, (&d, &q)) in data.iter().zip(&word).enumerate() {
        m.cell(
            &format!("word{bit}"),
            CellKind::Dffr,
            &[d, clk, reset],
            &[Some(q), None],
        );
    }
    let next = m.tree(CellKind::Xor2, &word);
    m.cell(
        "parity",
        CellKind::Dffr,
        &[next, clk, reset],
        &[Some(parity), None],
    );
    let netlist = Netlist::elaborate(&m.finish()?);

    let clk = netlist.net("CLK").expect("a port");
    let period = Frequency::from_hz(2_000_000_000).period();
    let library = Library::generic_40nm();
    for corner in Corner::ALL {
        let timing = Timing::nominal(&netlist, &library, corner);
        let analysis = StaticTiming::new(&netlist, &timing);
        let asked = Requirements::new(&netlist, &analysis, clk, &[], &library, corner)?;
        let setups = asked.all().iter().filter(|r| r.kind == CheckKind::Setup);
        let least = setups.min_by_key(|r| r.slack(period));
        let least = least.expect("there are flip-flops");
        println!(
            "{}: the least slack is {} of {period}, at the {} of {}",
            corner.name(),
            least.slack(period),
            least.kind.name(),
            netlist.cell_path(least.cell)
        );
        if let Some((path, _)) = asked.paths(least) {
            for step in &path.steps {
                let net = netlist.net_path(step.net);
                println!(
                    "    {:>9}  {}",
                    step.time.to_string(),
                    net.unwrap_or_default()
                );
            }
        }
    }
    Ok(())
}
