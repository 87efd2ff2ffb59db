//! A front end of your own: an OR tree over four SPADs with pulse shapers, as gates, simulated with its delays.
//!
//! A pulse shaper lets an edge through for as long as a chain of inverters takes; the OR tree joins them on one wire. Two
//! photons closer than the shaped pulse become one (thesis 2.4.1, Fig. 22a).
//!
//! `cargo run --release --example front_end_of_your_own`

use guided_dtof::kernel::{Drive, Kernel, Recorder, Stimulus};
use guided_dtof::netlist::{
    CellKind, Corner, Library, ModuleBuilder, Netlist, NetlistError, Timing,
};
use guided_dtof::units::Time;

const SPADS: usize = 4;
/// Inverters of a pulse shaper, an odd number.
const CHAIN: usize = 9;

fn main() -> Result<(), NetlistError> {
    let mut m = ModuleBuilder::new("or_tree");
    let raw = m.input_bus("SPAD_RAW", SPADS);
    let event = m.output("EVENT");
    let shaped: Vec<_> = raw
        .iter()
        .map(|&spad| {
            let late = (0..CHAIN).fold(spad, |net, _| m.gate(CellKind::Inv, &[net]));
            m.gate(CellKind::And2, &[spad, late])
        })
        .collect();
    let joined = m.tree(CellKind::Or2, &shaped);
    m.gate_into(CellKind::Buf, &[joined], event);
    let netlist = Netlist::elaborate(&m.finish()?);

    let timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
    let spads = netlist.signal("SPAD_RAW").expect("it was built above");
    let event = netlist.net("EVENT").expect("it was built above");
    for apart_ps in [50, 100, 200, 400] {
        // Two photons on two SPADs; a SPAD's pulse lasts 8 ns.
        let mut drives = Vec::new();
        for (spad, &net) in spads.iter().enumerate() {
            drives.push(Drive::new(Time::ZERO, net, false));
            if spad < 2 {
                let time = Time::from_ns(10) + Time::from_ps(apart_ps * spad as i64);
                drives.push(Drive::new(time, net, true));
                drives.push(Drive::new(time + Time::from_ns(8), net, false));
            }
        }
        let mut kernel = Kernel::new(&netlist, &timing);
        let mut recorder = Recorder::new([event]);
        kernel
            .run(
                &mut Stimulus::sorted(drives),
                Time::from_ns(30),
                &mut recorder,
            )
            .expect("no loop of cells without delay");
        let edges = recorder.rising_edges(event).len();
        println!("photons {apart_ps:3} ps apart: {edges} edge(s) on EVENT");
    }
    Ok(())
}
