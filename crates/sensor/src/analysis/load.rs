//! How fast start values can be loaded: LOAD_CLK against the deserialiser, the row scanner and the memories.
//!
//! MEMORY_LOAD is LOAD_CLK's low half, let through by ROW_DONE and the row's token. Both change after LOAD_CLK's
//! rise and must have arrived when it falls (a gating check); then only the fall makes MEMORY_LOAD rise, and the
//! memories have half a period of setup and half of hold. Nothing here waits for CLK.

use super::gates;
use super::macropixel::worst_path;
use crate::chip::{Limits, LoadPins, LoadProbe, SensorConfig, Silicon, load_path, probes};
use crate::kernel::{Kernel, TimingChecks};
use crate::netlist::{
    CellKind, CheckKind, Edge, NetId, Netlist, Path, Requirement, Requirements, StaticTiming,
};
use crate::stimulus::load_stimulus;
use crate::units::{Frequency, Time};

/// Static timing of the load path.
#[derive(Debug, Clone)]
pub struct LoadTiming {
    /// The netlist that is analysed, which names the flip-flops.
    pub netlist: Netlist,
    /// What the flip-flops behind LOAD_CLK ask of its period.
    pub load_clk: Vec<Requirement>,
    /// The longest path to the data of a flip-flop, by its setup.
    pub longest: Path,
    /// The shortest path to the data of a flip-flop, by its hold.
    pub shortest: Path,
    /// LOAD_CLK rises → ROW_DONE's inverse at WRITE's gate, latest: before LOAD_CLK falls.
    pub row_done: Time,
    /// LOAD_CLK rises → token at MEMORY_LOAD's gate, latest, less LOAD_CLK falls → WRITE rises, earliest: before
    /// LOAD_CLK falls.
    pub token: Time,
}

impl LoadTiming {
    /// Analyses the load path of this sensor with all its memories.
    pub fn analyse(config: &SensorConfig, silicon: &Silicon, limits: Limits) -> Self {
        let (rows, cols, bits) = (config.rows, config.cols, config.counter_bits);
        let netlist = Netlist::elaborate(&load_path::with_memories(rows, cols, bits));
        let timing = silicon.timing(&netlist);
        let library = silicon.limits(limits);
        let analysis = StaticTiming::new(&netlist, &timing);
        let requirements = |cuts: &[NetId]| {
            let corner = silicon.corner;
            let clock = LoadProbe::Clk.net(&netlist);
            Requirements::new(&netlist, &analysis, clock, cuts, &library, corner)
                .expect("the load path has no loop")
        };
        // The inverse of ROW_DONE clocks the tokens and gates WRITE.
        let done = LoadProbe::RowDone.net(&netlist);
        let inverters = netlist.cells().iter().filter(|c| c.kind == CellKind::Inv);
        let mut inverters = inverters.filter(|c| c.input(0) == done);
        let step = inverters.next().expect("ROW_DONE's inverter").outputs[0];
        let step = step.expect("an inverter that is read");
        let select = LoadProbe::Select.bus(&netlist);
        let write = LoadProbe::Write.net(&netlist);
        let loads = LoadProbe::MemoryLoad.bus(&netlist);
        let tokens = requirements(&loads);
        let gated = requirements(&[step]);
        let is_memory =
            |r: &&Requirement| loads.contains(&netlist.cells()[r.cell.index()].input(1));
        let memories = gated.all().iter().filter(is_memory);
        let others = tokens.all().iter().filter(|r| !is_memory(r));
        let latest = |nets: &[NetId]| {
            let windows = nets
                .iter()
                .filter_map(|&n| tokens.arrivals(Edge::Rise).window(n));
            windows.map(|w| w.1).max().expect("LOAD_CLK reaches it")
        };
        let opens = gated.arrivals(Edge::Fall).edge_window(write, Edge::Rise);
        let opens = opens.expect("LOAD_CLK reaches it").0;
        let others: Vec<Requirement> = others.copied().collect();
        let path = |kind| worst_path(&tokens, others.iter(), kind).expect("LOAD_CLK reaches it");
        LoadTiming {
            longest: path(CheckKind::Setup),
            shortest: path(CheckKind::Hold),
            load_clk: others.iter().chain(memories).copied().collect(),
            row_done: latest(&[step]),
            token: latest(&select) - opens,
            netlist,
        }
    }

    /// Shortest LOAD_CLK period; none if no period does.
    pub fn period(&self) -> Option<Time> {
        let gating = self.row_done.max(self.token) * 2;
        Some(super::longest(self.load_clk.iter())?.max(gating))
    }
}

/// Whether the event kernel loads three rows of arbitrary start values right at a LOAD_CLK period and, if limits are to
/// be kept, breaks none. Rows differ only in their token.
pub fn load_works(
    config: &SensorConfig,
    silicon: &Silicon,
    limits: Limits,
) -> impl Fn(Time) -> bool {
    const ROWS: usize = 3;
    let (cols, bits) = (config.cols, config.counter_bits);
    let netlist = Netlist::elaborate(&load_path::with_memories(ROWS, cols, bits));
    let timing = silicon.timing(&netlist);
    // Multiples of an odd number run through all values of any number of bits.
    let starts: Vec<u16> = (0..ROWS * cols)
        .map(|i| (i as u16).wrapping_mul(0x9e37).rotate_left(7) & config.largest_start())
        .collect();
    let stream = load_path::stream(&starts, cols, bits);
    let (library, corner) = (silicon.limits(limits), silicon.corner);
    let memories = probes::memories(&netlist, ROWS, cols);
    move |period| {
        let Ok(clock) = Frequency::from_period(period) else {
            return false;
        };
        let (end, mut stimulus) = load_stimulus(LoadPins::find(&netlist), clock, &stream);
        let mut checks =
            TimingChecks::new(&netlist, &library, corner).not_before(gates::RESET_RELEASED);
        let mut kernel = Kernel::new(&netlist, &timing);
        let settled = end + Time::from_ns(5);
        match limits {
            Limits::Kept => kernel
                .run(&mut stimulus, settled, &mut checks)
                .expect("no loop of cells without delay"),
            Limits::Ignored => kernel
                .run(&mut stimulus, settled, &mut ())
                .expect("no loop of cells without delay"),
        }
        let mut memories = memories.iter().zip(&starts);
        let is_right = memories.all(|(nets, &start)| kernel.number(nets) == Some(start.into()));
        is_right && (limits == Limits::Ignored || checks.report(&netlist).violated() == 0)
    }
}
