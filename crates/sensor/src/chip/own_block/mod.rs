//! Blocks of one's own: a netlist that Yosys wrote takes the place of a built-in block.
//!
//! ```text
//!   p_counter_block = "my.json" ─read─► Module ─► held against its contract ─► in the built-in block's place in the macropixel
//!                                          ├─► hidden_state: no state of a P-counter outlives a laser cycle, except its memory
//!                                          └─► CounterLaw: what each COUNTER_INIT does, measured on the gates
//! ```
//!
//! The key `p_counter` still says what is expected of a P-counter: whether COUNTER_RESET brings its start value back (all but
//! `memoryless`). What the counter does besides is measured ([`CounterLaw`]), because nobody wrote it down.
//!
//! What other blocks count, no law says: `gate` and `cycle` run them.

pub(crate) mod block;
mod contract;
mod hidden_state;
mod law;

use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

pub use block::OwnBlock;
pub(crate) use contract::CONTRACTS;
pub use contract::replaceable;
pub use law::{CounterLaw, Uneven};

use super::config::SensorConfig;
use super::p_counter::count_down::CountDownSetup;

/// Laws that have been measured, by netlist and what is expected of it.
type Laws = HashMap<(u64, CountDownSetup), Arc<CounterLaw>>;

/// What is known of the state of netlists, likewise.
type HiddenStates = HashMap<(u64, CountDownSetup), Option<String>>;

impl OwnBlock {
    /// The state that it must not have as the P-counter of this sensor, and the cell that holds it; looked for once a process. It must
    /// have been read.
    fn hidden_state(&self, config: &SensorConfig) -> Option<String> {
        static KNOWN: LazyLock<Mutex<HiddenStates>> = LazyLock::new(Mutex::default);
        let (module, hash) = (self.module()?, self.hash()?);
        let expected = CountDownSetup::of_sensor(config);
        let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        let state = known.entry((hash, expected));
        state
            .or_insert_with(|| hidden_state::hidden_state(module, expected))
            .clone()
    }

    /// What it does as the P-counter of this sensor; measured once a process.
    fn law(&self, config: &SensorConfig) -> Arc<CounterLaw> {
        static LAWS: LazyLock<Mutex<Laws>> = LazyLock::new(Mutex::default);
        let module = self.module().expect("it has been checked");
        let hash = self.hash().expect("it has been checked");
        let expected = CountDownSetup::of_sensor(config);
        let mut laws = LAWS.lock().unwrap_or_else(PoisonError::into_inner);
        let law = laws.entry((hash, expected));
        Arc::clone(law.or_insert_with(|| Arc::new(CounterLaw::measure(module, expected))))
    }
}

impl SensorConfig {
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
    use std::path::PathBuf;

    use crate::chip::config::AfterBorrow;
    use crate::chip::{correlation, front_end, metdc, p_counter};
    use crate::netlist::{CellKind, Direction, Module, ModuleBuilder, Net};

    #[test]
    fn ports_are_held_against_the_built_in_ones() {
        let built_in = p_counter::circuit(&SensorConfig::default());
        let mut m = ModuleBuilder::new("mine");
        let init = m.input_bus("COUNTER_INIT", 8);
        m.input("LOCAL_STOP");
        let more = m.output("MORE");
        m.gate_into(CellKind::Inv, &init[..1], more);
        let block = OwnBlock::from_module("mine.json", m.finish().unwrap(), "");
        assert_eq!(
            CONTRACTS[0].holds(&block, &built_in).unwrap_err(),
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
        let own = OwnBlock::from_module("mine.json", m.finish().unwrap(), "");
        CONTRACTS[0].holds(&own, &built_in)
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

    /// Blocks are told apart by their file and what it said; a sensor with one that no law describes has none.
    #[test]
    fn blocks_are_told_apart_by_their_file_and_text() {
        let built_in = front_end::circuit(&SensorConfig::default());
        let block = |file: &str, text: &str| OwnBlock::from_module(file, built_in.clone(), text);
        let same = block("mine.json", "a");
        assert_eq!(same, block("mine.json", "a"));
        assert_ne!(same, block("other.json", "a"));
        assert_ne!(same, block("mine.json", "b"));
        assert_eq!(PathBuf::from(same.clone()), PathBuf::from("mine.json"));
        let plain = SensorConfig::default();
        let own = SensorConfig {
            front_end_block: Some(same.clone()),
            ..SensorConfig::default()
        };
        assert!(plain.own_hashes().iter().all(Option::is_none) && plain.may_have_law());
        assert_eq!(own.own_hashes().iter().flatten().count(), 1);
        assert!(own.own_hashes().contains(&same.hash()) && same.hash().is_some());
        assert_eq!(
            (plain.lawless_block(), own.lawless_block()),
            (None, Some("front_end_block"))
        );
        assert!(!own.may_have_law());
    }

    #[test]
    fn an_event_comes_from_spads() {
        let built_in = correlation::circuit(16);
        let event_of = |bus: usize| {
            let mut m = ModuleBuilder::new("mine");
            let timed = m.input_bus("SPAD_TIMED", 16);
            let event_type = m.input_bus("TYPE", 2);
            m.input_bus("THRESHOLD", 5);
            let event = m.output("SPAD_EVENT");
            m.gate_into(CellKind::Inv, &[[timed, event_type][bus][1]], event);
            let own = OwnBlock::from_module("mine.json", m.finish().unwrap(), "");
            CONTRACTS[1].holds(&own, &built_in)
        };
        assert_eq!(event_of(0), Ok(()));
        assert_eq!(
            event_of(1).unwrap_err(),
            "mine.json: module mine has a SPAD_EVENT that no SPAD_TIMED changes; make it of gates behind them"
        );
    }

    /// Laws that are none: no window, no clean one, one that depends on the last, one that nobody knows, the same for all codes.
    #[test]
    fn what_is_no_law_is_told() {
        let law = |stop: fn(&mut ModuleBuilder, [Net; 4]) -> Net| {
            let mut m = ModuleBuilder::new("mine");
            m.input_bus("COUNTER_INIT", 3);
            m.input("MEMORY_LOAD");
            let pins = ["MEMORY_RESET", "COUNTER_CLK", "COUNTER_RESET"].map(|pin| m.input(pin));
            let [memory_reset, clk, reset] = pins;
            let local_stop = m.output("LOCAL_STOP");
            let one = m.gate(CellKind::Xnor2, &[clk, clk]);
            let stop = stop(&mut m, [one, memory_reset, clk, reset]);
            m.gate_into(CellKind::Buf, &[stop], local_stop);
            let expected = CountDownSetup {
                has_memory: true,
                after_borrow: AfterBorrow::Hold,
                step_periods: 1,
            };
            CounterLaw::measure(&m.finish().unwrap(), expected).uneven()
        };
        fn flip_flop(m: &mut ModuleBuilder, name: &str, inputs: [Net; 3]) -> Net {
            let [q, qn] = ["Q", "QN"].map(|pin| m.wire(&format!("{name}_{pin}")));
            m.cell(name, CellKind::Dffr, &inputs, &[q, qn]);
            q
        }
        let same = law(|m, [one, _, clk, reset]| flip_flop(m, "stop", [one, clk, reset]));
        assert_eq!(same, Some(Uneven::Same(0, 1)));
        let never = law(|m, [one, _, clk, reset]| {
            let zero = m.gate(CellKind::Inv, &[one]);
            flip_flop(m, "stop", [zero, clk, reset])
        });
        assert_eq!(never, Some(Uneven::Never));
        let twice = law(|m, [one, _, clk, reset]| {
            let stop = flip_flop(m, "stop", [one, clk, reset]);
            m.gate(CellKind::And2, &[stop, clk])
        });
        assert_eq!(twice, Some(Uneven::Glitch(0)));
        let forgets = law(|m, [one, memory_reset, clk, reset]| {
            let [odd, even] = ["ODD", "EVEN"].map(|name| m.wire(name));
            m.cell(
                "odd",
                CellKind::Dffr,
                &[even, reset, memory_reset],
                &[odd, even],
            );
            let first = flip_flop(m, "first", [one, clk, reset]);
            let sooner = m.gate(CellKind::Or2, &[first, odd]);
            flip_flop(m, "stop", [sooner, clk, reset])
        });
        assert_eq!(forgets, Some(Uneven::Forgets(0)));
        let unknown = law(|m, [one, _, clk, _]| {
            let zero = m.gate(CellKind::Inv, &[one]);
            let [state, inverse] = ["STATE", "INVERSE"].map(|name| m.wire(name));
            m.cell(
                "stop",
                CellKind::Dffr,
                &[inverse, clk, zero],
                &[state, inverse],
            );
            state
        });
        assert_eq!(unknown, Some(Uneven::Unknown(0)));
    }

    /// Ports are those of the built-in block, and edges go where delays are measured.
    #[test]
    fn a_metdc_a_front_end_and_a_histogram_lead_edges_on() {
        let config = SensorConfig::default();
        let complaint = |name: &str, built_in: Arc<Module>, through: CellKind| {
            // Every output is a gate behind the first input.
            let mut m = ModuleBuilder::new("mine");
            let mut first = None;
            for (direction, port) in built_in.port_signals() {
                let (name, width) = (port.name.as_str(), port.width());
                if direction == Direction::Input {
                    let nets = if port.is_bus {
                        m.input_bus(name, width)
                    } else {
                        vec![m.input(name)]
                    };
                    first = first.or(Some(nets[0]));
                    continue;
                }
                let first = first.unwrap();
                let nets = if port.is_bus {
                    m.output_bus(name, width)
                } else {
                    vec![m.output(name)]
                };
                for net in nets {
                    match through {
                        CellKind::Dffr => m.cell(
                            &format!("of_{net:?}").replace(['(', ')'], "_"),
                            through,
                            &[first; 3],
                            &[Some(net), None],
                        ),
                        _ => m.gate_into(through, &[first], net),
                    }
                }
            }
            let own = OwnBlock::from_module("mine.json", m.finish().unwrap(), "");
            let mut contracts = CONTRACTS.iter();
            let contract = contracts.find(|contract| contract.name == name).unwrap();
            contract.holds(&own, &built_in).unwrap_err()
        };
        for (name, built_in, through, says) in [
            (
                "metdc",
                metdc::circuit(16),
                CellKind::Buf,
                "has a HIT that no flip-flop drives, ",
            ),
            (
                "metdc",
                metdc::circuit(16),
                CellKind::Dffr,
                "has a HIT whose clock never rises when LOCAL_STOP rises; ",
            ),
            (
                "front_end",
                front_end::circuit(&config),
                CellKind::Buf,
                "has a SPAD_RAW[0] that no flip-flop samples; ",
            ),
            (
                "histogram",
                bin_first(),
                CellKind::Buf,
                "has a BIN_0 that no HIT changes; ",
            ),
        ] {
            let said = complaint(name, built_in, through);
            assert!(
                said.starts_with("mine.json: module mine ") && said.contains(says),
                "{said}"
            );
        }
    }

    /// The pins of a histogram, PIXEL_CLEAR first.
    fn bin_first() -> Arc<Module> {
        let mut m = ModuleBuilder::new("histogram");
        let clear = m.input("PIXEL_CLEAR");
        m.input_bus("HIT", 1);
        let bin = m.output("BIN_0");
        m.gate_into(CellKind::Buf, &[clear], bin);
        m.finish().unwrap()
    }
}
