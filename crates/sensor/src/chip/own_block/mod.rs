//! Blocks of one's own: a netlist that Yosys wrote takes the place of a built-in block.
//!
//! ```text
//!   p_counter_block = "my.json" ─read─► Module ─ports─► held against the built-in block's ─► in its place in the macropixel
//!                                          └─► CounterLaw: what each COUNTER_INIT does, measured on the gates
//! ```
//!
//! The key `p_counter` still says what is expected of a P-counter: whether COUNTER_RESET brings its start value back (all but
//! `memoryless`). What the counter does besides is measured ([`CounterLaw`]), because nobody wrote it down.
//!
//! What another correlation block counts, no law says: `gate` and `cycle` run it.

pub(crate) mod block;
mod law;

use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

pub use block::OwnBlock;
use law::Expected;
pub use law::{CounterLaw, Uneven};

use super::config::SensorConfig;
use super::probes::{Probe, Probes};
use super::timing::silicon::Silicon;
use crate::netlist::{Corner, Direction, Edge, Module, NetId, Netlist, StaticTiming};

/// Laws that have been measured, by netlist and what is expected of it.
type Laws = HashMap<(u64, Expected), Arc<CounterLaw>>;

impl OwnBlock {
    /// What it does as the P-counter of this sensor; measured once a process.
    fn law(&self, config: &SensorConfig) -> Arc<CounterLaw> {
        static LAWS: LazyLock<Mutex<Laws>> = LazyLock::new(Mutex::default);
        let module = self.module().expect("it has been checked");
        let hash = self.hash().expect("it has been checked");
        let expected = Expected {
            has_memory: config.p_counter.row().has_memory,
            after_borrow: config.after_borrow,
            step_periods: config.step_periods,
        };
        let mut laws = LAWS.lock().unwrap_or_else(PoisonError::into_inner);
        let law = laws.entry((hash, expected));
        Arc::clone(law.or_insert_with(|| Arc::new(CounterLaw::measure(module, expected))))
    }

    /// Whether it can be a P-counter in the place of `built_in`.
    ///
    /// # Errors
    /// What is missing, what is too much, and what differs.
    pub(super) fn check_counter(&self, built_in: &Module) -> Result<(), String> {
        self.check(built_in, |netlist, paths| {
            let probes = Probes::of_block(netlist);
            let clk = probes.net(Probe::CounterClk);
            let after = paths.arrivals(&[(clk, Edge::Rise)], &[]);
            let after = after.expect("there is no loop");
            let counts = netlist.cells().iter().any(|cell| {
                cell.kind.is_flip_flop()
                    && cell.inputs[1] == clk
                    && after.window(cell.inputs[0]).is_some()
            });
            let stops = after.edge_window(probes.net(Probe::LocalStop), Edge::Rise).is_some();
            let reset = probes.net(Probe::CounterReset);
            let mut flip_flops = netlist.cells().iter().filter(|cell| cell.kind.is_flip_flop());
            if flip_flops.any(|cell| cell.inputs[1] == reset) {
                return Some("clocks a flip-flop with COUNTER_RESET; reset it by that instead");
            }
            let flaw = "does not count rising edges of COUNTER_CLK up to LOCAL_STOP; clock it with posedge COUNTER_CLK";
            (!counts || !stops).then_some(flaw)
        })
    }

    /// Whether it can be a correlation block in the place of `built_in`.
    ///
    /// # Errors
    /// As [`OwnBlock::check_counter`].
    pub(super) fn check_correlation(&self, built_in: &Module) -> Result<(), String> {
        self.check(built_in, |netlist, paths| {
            let probes = Probes::of_block(netlist);
            let timed = probes.bus(Probe::SpadTimed).iter();
            let starts = timed.flat_map(|&n| Edge::BOTH.map(|e| (n, e)));
            let starts: Vec<(NetId, Edge)> = starts.collect();
            let after = paths.arrivals(&starts, &[]).expect("there is no loop");
            let event = probes.net(Probe::SpadEvent);
            let flaw = "has a SPAD_EVENT that no SPAD_TIMED changes; make it of gates behind them";
            after.window(event).is_none().then_some(flaw)
        })
    }

    /// Whether its ports are those of `built_in`, and its gates make no loop and have no `flaw`.
    fn check(
        &self,
        built_in: &Module,
        flaw: impl Fn(&Netlist, &StaticTiming<'_>) -> Option<&'static str>,
    ) -> Result<(), String> {
        let file = self.file().display();
        let Some(module) = self.module() else {
            return Err(format!(
                "{file} has not been read; give it in a sensor file"
            ));
        };
        let name = module.name();
        let faults = misfits(module, built_in);
        if !faults.is_empty() {
            return Err(format!(
                "{file}: module {name} has other ports than {}: {}",
                built_in.name(),
                faults.join(", ")
            ));
        }
        let netlist = Netlist::elaborate(module);
        let timing = Silicon::nominal(Corner::Typ).timing(&netlist);
        let paths = StaticTiming::new(&netlist, &timing);
        let inputs = netlist.inputs().into_iter();
        let starts: Vec<(NetId, Edge)> = inputs.flat_map(|n| Edge::BOTH.map(|e| (n, e))).collect();
        if let Err(found) = paths.arrivals(&starts, &[]) {
            return Err(format!(
                "{file}: module {name} has a loop of gates at {}, where time cannot be added up; break it with a flip-flop",
                found.net
            ));
        }
        match flaw(&netlist, &paths) {
            None => Ok(()),
            Some(flaw) => Err(format!("{file}: module {name} {flaw}")),
        }
    }
}

/// What is wrong with the ports of `own` in the place of `built_in`.
fn misfits(own: &Module, built_in: &Module) -> Vec<String> {
    let word = |direction| match direction {
        Direction::Input => "input",
        Direction::Output => "output",
    };
    let bits = |width| {
        if width == 1 {
            "1 bit".to_owned()
        } else {
            format!("{width} bits")
        }
    };
    let mut faults = Vec::new();
    for (direction, wanted) in built_in.port_signals() {
        let mut ports = own.port_signals();
        let (name, width) = (&wanted.name, wanted.width());
        match ports.find(|(_, port)| port.name == *name) {
            None => faults.push(format!(
                "{} {name} of {} is missing",
                word(direction),
                bits(width)
            )),
            Some((found, _)) if found != direction => {
                faults.push(format!(
                    "{name} is an {} instead of an {}",
                    word(found),
                    word(direction)
                ));
            }
            Some((_, port)) if port.width() != width => {
                faults.push(format!(
                    "{name} has {} instead of {width}",
                    bits(port.width())
                ));
            }
            Some(_) => {}
        }
    }
    for (direction, port) in own.port_signals() {
        if !built_in
            .port_signals()
            .any(|(_, wanted)| wanted.name == port.name)
        {
            faults.push(format!("{} {} is too much", word(direction), port.name));
        }
    }
    faults
}

impl SensorConfig {
    /// Keys of blocks of one's own, with those that there are.
    pub(super) fn own_blocks(&mut self) -> [(&'static str, &mut Option<OwnBlock>); 2] {
        [
            ("p_counter_block", &mut self.p_counter_block),
            ("correlation_block", &mut self.correlation_block),
        ]
    }

    /// What tells the netlists of its own blocks apart.
    pub fn own_hashes(&self) -> [Option<u64>; 2] {
        [&self.p_counter_block, &self.correlation_block]
            .map(|block| block.as_ref().and_then(OwnBlock::hash))
    }

    /// What a P-counter of one's own does; `None` for the built-in ones. The configuration must have passed [`SensorConfig::check`].
    pub fn counter_law(&self) -> Option<Arc<CounterLaw>> {
        Some(self.p_counter_block.as_ref()?.law(self))
    }

    /// What is loaded into the P-counters for these start values. The configuration must have passed [`SensorConfig::check`].
    pub fn load_codes(&self, starts: &[u16]) -> Vec<u16> {
        match self.counter_law() {
            None => starts.to_vec(),
            Some(law) => starts.iter().map(|&start| law.code(start)).collect(),
        }
    }

    /// The start value that is loaded as `code`. The configuration must have passed [`SensorConfig::check`].
    pub fn start_of_code(&self, code: u16) -> u16 {
        self.counter_law().map_or(code, |law| law.start(code))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::p_counter;
    use crate::netlist::{CellKind, ModuleBuilder};

    #[test]
    fn ports_are_held_against_the_built_in_ones() {
        let built_in = p_counter::circuit(&SensorConfig::default());
        assert_eq!(misfits(&built_in, &built_in), [""; 0]);
        let mut m = ModuleBuilder::new("mine");
        let init = m.input_bus("COUNTER_INIT", 8);
        m.input("LOCAL_STOP");
        let more = m.output("MORE");
        m.gate_into(CellKind::Inv, &init[..1], more);
        let block = OwnBlock::of("mine.json", m.finish().unwrap(), "");
        assert_eq!(
            block.check_counter(&built_in).unwrap_err(),
            "mine.json: module mine has other ports than p_counter: COUNTER_INIT has 8 bits instead of 9, \
             input MEMORY_LOAD of 1 bit is missing, input MEMORY_RESET of 1 bit is missing, input COUNTER_CLK of 1 bit is missing, \
             input COUNTER_RESET of 1 bit is missing, LOCAL_STOP is an input instead of an output, output MORE is too much"
        );
    }

    /// A module with the ports of a P-counter, with LOCAL_STOP clocked by `clock` and, beside it, a loop of gates if asked for.
    fn counter(clock: &str, loops: bool) -> Result<(), String> {
        let built_in = p_counter::circuit(&SensorConfig::default());
        let mut m = ModuleBuilder::new("mine");
        m.input_bus("COUNTER_INIT", 9);
        for pin in ["MEMORY_LOAD", "MEMORY_RESET"] {
            m.input(pin);
        }
        let [clk, reset] = ["COUNTER_CLK", "COUNTER_RESET"].map(|pin| m.input(pin));
        let (stop, not) = (m.output("LOCAL_STOP"), m.wire("NOT"));
        let clk = if clock == "COUNTER_CLK" { clk } else { reset };
        m.cell("stop", CellKind::Dffr, &[not, clk, reset], &[stop, not]);
        if loops {
            let [a, b] = ["A", "B"].map(|name| m.wire(name));
            m.gate_into(CellKind::Nand2, &[clk, b], a);
            m.gate_into(CellKind::Buf, &[a], b);
        }
        OwnBlock::of("mine.json", m.finish().unwrap(), "").check_counter(&built_in)
    }

    #[test]
    fn a_counter_counts_clk_and_has_no_loop_of_gates() {
        assert_eq!(counter("COUNTER_CLK", false), Ok(()));
        assert_eq!(
            counter("COUNTER_RESET", false).unwrap_err(),
            "mine.json: module mine does not count rising edges of COUNTER_CLK up to LOCAL_STOP; clock it with posedge COUNTER_CLK"
        );
        let looping = counter("COUNTER_CLK", true).unwrap_err();
        assert!(
            looping.starts_with("mine.json: module mine has a loop of gates at "),
            "{looping}"
        );
    }
}
