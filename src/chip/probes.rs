//! Where the nets and cells inside the chip are: the only place that knows their names, besides the files that build the
//! circuits.
//!
//! ```text
//!   Probes::of_macropixel(netlist, row, col) ─┬─► probes.net(Probe::LocalStop)  ─► NetId
//!                                             ├─► probes.bus(Probe::Shift)      ─► NetIds, bit 0 first
//!   LoadProbe::Write.net(netlist)             ├─► probes.bin(3)                 ─► NetIds of a bin's count
//!   SensorPins::of(netlist)                   └─► probes.path(Probe::Strobe)    ─► dotted path, for viewers
//! ```
//!
//! Handles are resolved once, by a hash look-up for each part of a path. A circuit that has only some of a macropixel's
//! blocks (a P-counter on a test bench) has only some of the probes; asking for another is a bug of ours, and panics.

use super::{SPADS, histogram, load_path, sensor};
use crate::netlist::{CellKind, NetId, Netlist};

/// A net or bus of a macropixel that something outside the circuits looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Probe {
    /// CLK.
    Clk,
    /// STOP.
    Stop,
    /// ENABLE, the sensor's RUN.
    Enable,
    /// PIXEL_CLEAR.
    PixelClear,
    /// MEMORY_LOAD of its row.
    MemoryLoad,
    /// MEMORY_RESET.
    MemoryReset,
    /// COUNTER_INIT of its column.
    CounterInit,
    /// SPAD_RAW, one bit a SPAD.
    SpadRaw,
    /// SPAD_TIMED, one bit a SPAD.
    SpadTimed,
    /// SPAD_EVENT.
    SpadEvent,
    /// LOCAL_STOP.
    LocalStop,
    /// COUNTER_CLK.
    CounterClk,
    /// COUNTER_RESET.
    CounterReset,
    /// The part of COUNTER_RESET that STOP's rising edge makes.
    ResetPulse,
    /// What keeps CLK from COUNTER_CLK.
    Block,
    /// The start value; a P-counter without memory has none.
    Memory,
    /// The count.
    CounterOut,
    /// The comparator's result before its flip-flop; only that P-counter has one.
    Equal,
    /// The METDC's shift register, newest event first.
    Shift,
    /// Clock of the HIT flip-flops.
    Strobe,
    /// Reset of the HIT flip-flops.
    HitReset,
    /// HIT, one bit a bin.
    Hit,
}

impl Probe {
    /// Every probe, in the order of their declaration.
    pub const ALL: [Probe; 22] = [
        Probe::Clk,
        Probe::Stop,
        Probe::Enable,
        Probe::PixelClear,
        Probe::MemoryLoad,
        Probe::MemoryReset,
        Probe::CounterInit,
        Probe::SpadRaw,
        Probe::SpadTimed,
        Probe::SpadEvent,
        Probe::LocalStop,
        Probe::CounterClk,
        Probe::CounterReset,
        Probe::ResetPulse,
        Probe::Block,
        Probe::Memory,
        Probe::CounterOut,
        Probe::Equal,
        Probe::Shift,
        Probe::Strobe,
        Probe::HitReset,
        Probe::Hit,
    ];

    /// Block of the macropixel whose inner net it is (none: the macropixel's own), and its name there.
    const fn place(self) -> (Option<&'static str>, &'static str) {
        match self {
            Probe::Clk => (None, "CLK"),
            Probe::Stop => (None, "STOP"),
            Probe::Enable => (None, "ENABLE"),
            Probe::PixelClear => (None, "PIXEL_CLEAR"),
            Probe::MemoryLoad => (None, "MEMORY_LOAD"),
            Probe::MemoryReset => (None, "MEMORY_RESET"),
            Probe::CounterInit => (None, "COUNTER_INIT"),
            Probe::SpadRaw => (None, "SPAD_RAW"),
            Probe::SpadTimed => (None, "SPAD_TIMED"),
            Probe::SpadEvent => (None, "SPAD_EVENT"),
            Probe::LocalStop => (None, "LOCAL_STOP"),
            Probe::CounterClk => (None, "COUNTER_CLK"),
            Probe::CounterReset => (None, "COUNTER_RESET"),
            Probe::ResetPulse => (Some(P_COUNTER_TIMING), "PULSE"),
            Probe::Block => (Some(P_COUNTER_TIMING), "BLOCK"),
            Probe::Memory => (Some(P_COUNTER), "MEMORY"),
            Probe::CounterOut => (Some(P_COUNTER), "COUNTER_OUT"),
            Probe::Equal => (Some(P_COUNTER), "EQUAL"),
            Probe::Shift => (Some(METDC), "SHIFT"),
            Probe::Strobe => (Some(METDC), "STROBE"),
            Probe::HitReset => (Some(METDC), "HIT_RESET"),
            Probe::Hit => (None, "HIT"),
        }
    }

    /// The signal's name, as in the thesis where that has one.
    pub const fn name(self) -> &'static str {
        self.place().1
    }

    /// Dotted path of the signal in the macropixel at `macropixel` (empty: at the top).
    pub fn path(self, macropixel: &str) -> String {
        let (block, name) = self.place();
        join([macropixel, block.unwrap_or(""), name])
    }
}

const P_COUNTER_TIMING: &str = "p_counter_timing";
const P_COUNTER: &str = "p_counter";
const METDC: &str = "metdc";

/// A dotted path of parts, of which empty ones are left out.
fn join<const N: usize>(parts: [&str; N]) -> String {
    let parts: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).collect();
    parts.join(".")
}

/// Dotted path of the retiming of a SPAD in the macropixel at `macropixel`.
pub fn spad_path(macropixel: &str, spad: usize) -> String {
    join([macropixel, "front_end", &format!("spad_{spad}")])
}

/// Dotted path of a bin's count in the macropixel at `macropixel`.
pub fn bin_path(macropixel: &str, bin: usize) -> String {
    join([macropixel, "histogram", &histogram::bin_name(bin)])
}

/// Handles of one macropixel.
#[derive(Debug, Clone)]
pub struct Probes {
    path: String,
    /// By probe; empty where the circuit has none.
    nets: Vec<Vec<NetId>>,
    /// Toggle flip-flop's output by SPAD.
    toggles: Vec<NetId>,
    bins: Vec<Vec<NetId>>,
}

impl Probes {
    /// Handles of the macropixel at a row and column of an elaborated sensor, or of a part of one.
    ///
    /// # Panics
    /// When the netlist has no such macropixel.
    pub fn of_macropixel(netlist: &Netlist, row: usize, col: usize) -> Self {
        let name = sensor::pixel_name(row, col);
        assert!(netlist.scope(&name).is_some(), "no macropixel {name}");
        Self::at(netlist, &name)
    }

    /// Handles of what there is of a macropixel below the instance at `path`; an empty path is the top itself.
    pub fn at(netlist: &Netlist, path: &str) -> Self {
        Self::resolve(netlist, path, |probe| probe.path(path))
    }

    /// Handles in a netlist whose top is one block of a macropixel, such as a P-counter: its pins and inner nets.
    pub fn of_block(netlist: &Netlist) -> Self {
        Self::resolve(netlist, "", |probe| probe.name().to_owned())
    }

    fn resolve(netlist: &Netlist, path: &str, place: impl Fn(Probe) -> String) -> Self {
        let nets = |probe| netlist.signal(&place(probe)).unwrap_or_default();
        let toggle = |spad| netlist.net(&join([&spad_path(path, spad), "TOGGLE"]));
        let bin = |bin| netlist.signal(&bin_path(path, bin));
        Probes {
            nets: Probe::ALL.into_iter().map(nets).collect(),
            toggles: (0..SPADS).map_while(toggle).collect(),
            bins: (0..).map_while(bin).collect(),
            path: path.to_owned(),
        }
    }

    /// Dotted path of the macropixel.
    pub fn macropixel(&self) -> &str {
        &self.path
    }

    /// Dotted path of a probe.
    pub fn path(&self, probe: Probe) -> String {
        probe.path(&self.path)
    }

    /// Dotted path of a bin's count.
    pub fn bin_path(&self, bin: usize) -> String {
        bin_path(&self.path, bin)
    }

    /// Nets of a probe, bit 0 first, if the circuit has it.
    pub fn find(&self, probe: Probe) -> Option<&[NetId]> {
        let nets = self.nets[probe as usize].as_slice();
        (!nets.is_empty()).then_some(nets)
    }

    /// Nets of a probe, bit 0 first.
    ///
    /// # Panics
    /// When the circuit does not have it.
    pub fn bus(&self, probe: Probe) -> &[NetId] {
        let missing = || panic!("the circuit has no {}", self.path(probe));
        self.find(probe).unwrap_or_else(missing)
    }

    /// The net of a probe of one bit, or the first of several.
    ///
    /// # Panics
    /// When the circuit does not have it.
    pub fn net(&self, probe: Probe) -> NetId {
        self.bus(probe)[0]
    }

    /// Output of the toggle flip-flop of each SPAD.
    pub fn toggles(&self) -> &[NetId] {
        &self.toggles
    }

    /// Count of each bin, bin 0 earliest, bit 0 first.
    pub fn bins(&self) -> &[Vec<NetId>] {
        &self.bins
    }

    /// Count of a bin, bit 0 first.
    pub fn bin(&self, bin: usize) -> &[NetId] {
        &self.bins[bin]
    }

    /// The toggle flip-flop of each SPAD.
    pub fn toggle_cells(&self, netlist: &Netlist) -> Vec<usize> {
        let cell = |spad| spad_path(&self.path, spad) + ".toggle";
        cells(netlist, (0..self.toggles.len()).map(cell))
    }

    /// The stages of the METDC's shift register, the first one first.
    pub fn shift_cells(&self, netlist: &Netlist) -> Vec<usize> {
        let cell = |stage| join([&self.path, METDC, &format!("shift_{stage}")]);
        cells(netlist, (0..self.bus(Probe::Shift).len()).map(cell))
    }

    /// The HIT flip-flop of each bin.
    pub fn hit_cells(&self, netlist: &Netlist) -> Vec<usize> {
        let cell = |bin| join([&self.path, METDC, &format!("hit_{bin}")]);
        cells(netlist, (0..self.bus(Probe::Hit).len()).map(cell))
    }

    /// Every cell of the P-counter timing block.
    ///
    /// # Panics
    /// When the circuit has none.
    pub fn timing_block_cells(&self, netlist: &Netlist) -> std::ops::Range<usize> {
        cells_of(netlist, &join([&self.path, P_COUNTER_TIMING]))
    }

    /// The flip-flops of the P-counter, its memory excepted.
    ///
    /// # Panics
    /// When the circuit has no P-counter.
    pub fn counter_cells(&self, netlist: &Netlist) -> Vec<usize> {
        let cells = cells_of(netlist, &self.p_counter());
        let is_flip_flop = |&cell: &usize| netlist.cells()[cell].kind.is_flip_flop();
        cells.filter(is_flip_flop).collect()
    }

    /// Dotted path of the P-counter.
    pub fn p_counter(&self) -> String {
        join([&self.path, P_COUNTER])
    }

    /// The inverse of ENABLE, which resets the P-counter and keeps CLK from it.
    ///
    /// # Panics
    /// When the circuit has no P-counter timing block.
    pub fn disabled(&self, netlist: &Netlist) -> NetId {
        let enable = self.net(Probe::Enable);
        let mut cells = self
            .timing_block_cells(netlist)
            .map(|c| &netlist.cells()[c]);
        let inverter = cells.find(|cell| cell.kind == CellKind::Inv && cell.inputs[0] == enable);
        inverter.expect("ENABLE has an inverter").outputs[0]
    }

    /// What makes COUNTER_RESET besides the pulse at STOP: reset and ENABLE.
    ///
    /// # Panics
    /// When the circuit has no P-counter timing block.
    pub fn counter_clear(&self, netlist: &Netlist) -> NetId {
        let (reset, pulse) = (self.net(Probe::CounterReset), self.net(Probe::ResetPulse));
        let mut drivers = self
            .timing_block_cells(netlist)
            .map(|c| &netlist.cells()[c]);
        let or = drivers.find(|cell| cell.outputs[0] == reset);
        let inputs = or.expect("COUNTER_RESET has a driver").inputs;
        if inputs[0] == pulse {
            inputs[1]
        } else {
            inputs[0]
        }
    }
}

fn cells(netlist: &Netlist, paths: impl Iterator<Item = String>) -> Vec<usize> {
    let cell = |path: String| {
        let cell = netlist.cell(&path);
        cell.unwrap_or_else(|| panic!("the circuit has no {path}"))
    };
    paths.map(cell).collect()
}

fn cells_of(netlist: &Netlist, path: &str) -> std::ops::Range<usize> {
    let scope = netlist.scope(path);
    netlist.cells_of(scope.unwrap_or_else(|| panic!("the circuit has no {path}")))
}

/// A net or bus of the load path, in a sensor or in [`load_path::with_memories`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LoadProbe {
    /// LOAD_CLK.
    Clk,
    /// LOAD_ENABLE.
    Enable,
    /// COUNTER_INITS, the serial bits.
    Serial,
    /// COUNTER_INIT_ROW, the deserialised row.
    Row,
    /// ROW_DONE.
    RowDone,
    /// The bit counter of the deserialiser.
    Bit,
    /// The row scanner's token, one bit a row.
    Select,
    /// What lets the selected row's MEMORY_LOAD pass.
    Write,
    /// MEMORY_LOAD, one bit a row.
    MemoryLoad,
}

impl LoadProbe {
    /// Dotted path below the top.
    pub const fn path(self) -> &'static str {
        match self {
            LoadProbe::Clk => "LOAD_CLK",
            LoadProbe::Enable => "LOAD_ENABLE",
            LoadProbe::Serial => "COUNTER_INITS",
            LoadProbe::Row => "COUNTER_INIT_ROW",
            LoadProbe::RowDone => "ROW_DONE",
            LoadProbe::Bit => "deserialiser.BIT",
            LoadProbe::Select => "row_scanner.SELECT",
            LoadProbe::Write => "row_scanner.WRITE",
            LoadProbe::MemoryLoad => "MEMORY_LOAD",
        }
    }

    /// Its nets, bit 0 first.
    ///
    /// # Panics
    /// When the netlist has no load path.
    pub fn bus(self, netlist: &Netlist) -> Vec<NetId> {
        top_bus(netlist, self.path())
    }

    /// Its net, or the first of several.
    ///
    /// # Panics
    /// When the netlist has no load path.
    pub fn net(self, netlist: &Netlist) -> NetId {
        self.bus(netlist)[0]
    }
}

/// Dotted path of the start value at a row and column of [`load_path::with_memories`].
pub fn memory_path(row: usize, col: usize) -> String {
    join([&load_path::memory_name(row, col), Probe::Memory.name()])
}

/// Start values of [`load_path::with_memories`], row-major, bit 0 first.
///
/// # Panics
/// When the netlist is another.
pub fn memories(netlist: &Netlist, rows: usize, cols: usize) -> Vec<Vec<NetId>> {
    let all = (0..rows).flat_map(|row| (0..cols).map(move |col| (row, col)));
    all.map(|(row, col)| top_bus(netlist, &memory_path(row, col)))
        .collect()
}

/// The pins that start values come in through.
#[derive(Debug, Clone, Copy)]
pub struct LoadPins {
    /// RESETB.
    pub resetb: NetId,
    /// LOAD_CLK.
    pub clk: NetId,
    /// LOAD_ENABLE.
    pub enable: NetId,
    /// COUNTER_INITS.
    pub serial: NetId,
}

impl LoadPins {
    /// Finds the pins of an elaborated load path or sensor.
    ///
    /// # Panics
    /// When the netlist is neither.
    pub fn of(netlist: &Netlist) -> Self {
        LoadPins {
            resetb: top_bus(netlist, "RESETB")[0],
            clk: LoadProbe::Clk.net(netlist),
            enable: LoadProbe::Enable.net(netlist),
            serial: LoadProbe::Serial.net(netlist),
        }
    }
}

/// The sensor's pins.
#[derive(Debug, Clone)]
pub struct SensorPins {
    /// Those of the load path.
    pub load: LoadPins,
    /// CLK.
    pub clk: NetId,
    /// STOP.
    pub stop: NetId,
    /// ENABLE.
    pub enable: NetId,
    /// HISTOGRAM_CLEAR.
    pub histogram_clear: NetId,
    /// CONVENTIONAL.
    pub conventional: NetId,
    /// TYPE, bit 0 first.
    pub event_type: Vec<NetId>,
    /// THRESHOLD, bit 0 first.
    pub threshold: Vec<NetId>,
    /// SPAD_RAW, [`SPADS`] nets a macropixel, row-major.
    pub spad_raw: Vec<NetId>,
    /// LOCAL_STOP, a net a macropixel, row-major.
    pub local_stop: Vec<NetId>,
}

impl SensorPins {
    /// Finds the pins of an elaborated sensor.
    ///
    /// # Panics
    /// When the netlist is no sensor.
    pub fn of(netlist: &Netlist) -> Self {
        let bus = |name| top_bus(netlist, name);
        let pin = |name| bus(name)[0];
        SensorPins {
            load: LoadPins::of(netlist),
            clk: pin("CLK"),
            stop: pin("STOP"),
            enable: pin("ENABLE"),
            histogram_clear: pin("HISTOGRAM_CLEAR"),
            conventional: pin("CONVENTIONAL"),
            event_type: bus("TYPE"),
            threshold: bus("THRESHOLD"),
            spad_raw: bus("SPAD_RAW"),
            local_stop: bus("LOCAL_STOP"),
        }
    }
}

fn top_bus(netlist: &Netlist, path: &str) -> Vec<NetId> {
    let nets = netlist.signal(path);
    nets.unwrap_or_else(|| panic!("the netlist has no {path}"))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::path::{Path, PathBuf};

    use super::*;
    use crate::chip::{PCounter, SensorConfig, p_counter};

    fn config(p_counter: PCounter) -> SensorConfig {
        SensorConfig {
            rows: 2,
            cols: 3,
            p_counter,
            ..SensorConfig::default()
        }
    }

    #[test]
    fn a_macropixel_has_every_probe_but_those_of_other_p_counters() {
        for p_counter in PCounter::ALL {
            let config = config(p_counter);
            let netlist = Netlist::elaborate(&sensor::circuit(&config));
            let probes = Probes::of_macropixel(&netlist, 1, 2);
            for probe in Probe::ALL {
                let expected = match probe {
                    Probe::Memory => p_counter != PCounter::Memoryless,
                    Probe::Equal => p_counter == PCounter::Comparator,
                    _ => true,
                };
                assert_eq!(probes.find(probe).is_some(), expected, "{probe:?}");
                if expected {
                    assert_eq!(
                        netlist.signal(&probes.path(probe)).unwrap(),
                        probes.bus(probe)
                    );
                }
            }
            assert_eq!(probes.toggles().len(), SPADS);
            assert_eq!(probes.bins().len(), config.bins);
            assert_eq!(
                probes.net(Probe::LocalStop),
                SensorPins::of(&netlist).local_stop[5]
            );
        }
    }

    #[test]
    fn cells_drive_the_nets_that_they_are_named_after() {
        let config = config(PCounter::Ripple);
        let netlist = Netlist::elaborate(&sensor::circuit(&config));
        let probes = Probes::of_macropixel(&netlist, 0, 1);
        let outputs = |cells: Vec<usize>| -> Vec<NetId> {
            let output = |cell: usize| netlist.cells()[cell].outputs[0];
            cells.into_iter().map(output).collect()
        };
        assert_eq!(outputs(probes.toggle_cells(&netlist)), probes.toggles());
        assert_eq!(
            outputs(probes.shift_cells(&netlist)),
            probes.bus(Probe::Shift)
        );
        assert_eq!(outputs(probes.hit_cells(&netlist)), probes.bus(Probe::Hit));
        // The borrow is a flip-flop more.
        assert_eq!(
            probes.counter_cells(&netlist).len(),
            config.counter_bits + 1
        );
        let clear = probes.counter_clear(&netlist);
        assert!(clear != probes.net(Probe::ResetPulse) && clear.is_some());
    }

    #[test]
    fn a_block_alone_has_its_own_probes() {
        let netlist = Netlist::elaborate(&p_counter::circuit(&config(PCounter::Ripple)));
        let probes = Probes::of_block(&netlist);
        assert_eq!(probes.bus(Probe::CounterOut).len(), 9);
        assert!(probes.find(Probe::CounterClk).is_some());
        assert!(probes.find(Probe::Strobe).is_none() && probes.bins().is_empty());
    }

    /// String literals of a line of Rust, without escapes.
    fn literals(line: &str) -> impl Iterator<Item = &str> {
        line.split('"').skip(1).step_by(2)
    }

    /// Every Rust file below a folder of the project.
    fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                sources(&path, found);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                found.push(path);
            }
        }
    }

    /// Signals of every circuit: those that are inside the sensor, and those that are no block's pin either.
    fn inner_names() -> (BTreeSet<String>, BTreeSet<String>) {
        let (mut inner, mut hidden) = (BTreeSet::new(), BTreeSet::new());
        let (mut pins, mut ports) = (BTreeSet::new(), BTreeSet::new());
        for p_counter in PCounter::ALL {
            let netlist = Netlist::elaborate(&sensor::circuit(&config(p_counter)));
            for (index, scope) in netlist.scopes().iter().enumerate() {
                for (_, signal) in scope.module.port_signals() {
                    ports.insert(signal.name.clone());
                    if index == 0 {
                        pins.insert(signal.name.clone());
                    }
                }
                let named = scope.module.signals().iter().filter(|s| s.is_named);
                inner.extend(named.map(|signal| signal.name.clone()));
            }
        }
        inner.retain(|name| !pins.contains(name));
        hidden.extend(inner.difference(&ports).cloned());
        // Every flip-flop has outputs of these names, in whatever circuit a test builds.
        hidden.retain(|name| !["Q", "QN"].contains(&name.as_str()));
        (inner, hidden)
    }

    /// The part of a literal that would look up one of `names`: the literal itself, or the end of a dotted path in it.
    fn names_a_net<'n>(literal: &str, names: &'n BTreeSet<String>) -> Option<&'n String> {
        let path = literal.split('[').next().unwrap_or_default();
        let (scope, name) = path.rsplit_once('.').unwrap_or(("", path));
        let is_path = |c: char| c.is_ascii_alphanumeric() || "_.{}".contains(c);
        names.get(name).filter(|_| scope.chars().all(is_path))
    }

    /// Files that build circuits name their own nets, tests of a block the block's pins.
    #[test]
    fn nobody_else_names_an_inner_net() {
        let (inner, hidden) = inner_names();
        assert!(inner.contains("COUNTER_RESET") && hidden.contains("STROBE"));
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut wrong = Vec::new();
        for (folder, names) in [
            ("src", &inner),
            ("benches", &inner),
            ("testbenches", &hidden),
            ("tests", &hidden),
        ] {
            let mut files = Vec::new();
            sources(&root.join(folder), &mut files);
            // What lies below the chip knows circuits of its own tests only.
            files.retain(|file| {
                let below = file.strip_prefix(root.join("src")).unwrap_or(file);
                let is_below_chip = |room: &&str| below.starts_with(room);
                !["netlist", "kernel", "waves"]
                    .iter()
                    .any(|room| is_below_chip(&room))
                    && !below.ends_with("chip/probes.rs")
            });
            for file in files {
                let text = std::fs::read_to_string(&file).unwrap();
                let builds_circuits = folder == "src" && text.contains("ModuleBuilder");
                if builds_circuits {
                    continue;
                }
                for (number, line) in text.lines().enumerate() {
                    for literal in literals(line).filter(|l| names_a_net(l, names).is_some()) {
                        wrong.push(format!("{}:{}: {literal}", file.display(), number + 1));
                    }
                }
            }
        }
        assert!(wrong.is_empty(), "{wrong:#?}");
        assert!(names_a_net("{pixel}.metdc.STROBE", &inner).is_some());
        assert!(names_a_net("mp_r0_c0.COUNTER_OUT[3]", &inner).is_some());
        assert!(names_a_net("HIT has no time to fall", &inner).is_none());
    }

    #[test]
    fn the_load_path_is_found_with_and_without_its_macropixels() {
        let config = config(PCounter::Ripple);
        let sensor = Netlist::elaborate(&sensor::circuit(&config));
        let (rows, cols, bits) = (config.rows, config.cols, config.counter_bits);
        let load = Netlist::elaborate(&load_path::with_memories(rows, cols, bits));
        for netlist in [&sensor, &load] {
            assert_eq!(LoadProbe::Select.bus(netlist).len(), rows);
            assert_eq!(LoadProbe::Row.bus(netlist).len(), cols * bits);
            assert!(LoadProbe::Write.net(netlist).is_some());
        }
        assert_eq!(memories(&load, rows, cols).len(), config.pixels());
    }
}
