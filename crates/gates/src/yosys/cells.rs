//! Yosys's generic cells as cells of the library: [`place`] is the one function that knows cell types.

#[cfg(feature = "liberty")]
mod library;

use std::collections::HashMap;
use std::sync::Arc;

use super::{Bit, CellEntry, CellFault, PinFault, YosysError};
use crate::netlist::CellKind::{
    self, And2, Buf, Dffr, Dffsr, Inv, Mux2, Nand2, Nor2, Or2, Xnor2, Xor2,
};
use crate::netlist::{Module, ModuleBuilder, Net, NetlistError};

/// Cells that are one of the library's.
const ALIKE: [(&str, CellKind, &[&str]); 9] = [
    ("$_BUF_", Buf, &["A"]),
    ("$_NOT_", Inv, &["A"]),
    ("$_NAND_", Nand2, &["A", "B"]),
    ("$_NOR_", Nor2, &["A", "B"]),
    ("$_AND_", And2, &["A", "B"]),
    ("$_OR_", Or2, &["A", "B"]),
    ("$_XOR_", Xor2, &["A", "B"]),
    ("$_XNOR_", Xnor2, &["A", "B"]),
    ("$_MUX_", Mux2, &["A", "B", "S"]),
];

/// A module while cells are placed in it.
pub(super) struct Placing<'d> {
    m: ModuleBuilder,
    nets: HashMap<u64, Net>,
    /// An input, of which constants are made.
    tie: Option<Net>,
    inverted: HashMap<Net, Net>,
    constants: [Option<Net>; 2],
    module: &'d str,
    placed: usize,
}

/// One cell as Yosys has it.
struct YosysCell<'d> {
    name: &'d str,
    entry: &'d CellEntry,
    inverses: &'d HashMap<u64, u64>,
}

impl YosysCell<'_> {
    fn inverse_of_q(&self) -> Option<u64> {
        match self.entry.connections.get("Q")?.as_slice() {
            [Bit::Net(q)] => self.inverses.get(q).copied(),
            _ => None,
        }
    }
}

impl<'d> Placing<'d> {
    pub(super) fn new(
        m: ModuleBuilder,
        nets: HashMap<u64, Net>,
        tie: Option<Net>,
        module: &'d str,
    ) -> Self {
        Placing {
            m,
            nets,
            tie,
            inverted: HashMap::new(),
            constants: [None; 2],
            module,
            placed: 0,
        }
    }

    pub(super) fn finish(self) -> Result<Arc<Module>, NetlistError> {
        self.m.finish()
    }

    /// Places what a cell is made of; `inverses` has the nets that are inverses of a flip-flop's Q.
    pub(super) fn cell(
        &mut self,
        name: &str,
        entry: &CellEntry,
        inverses: &HashMap<u64, u64>,
    ) -> Result<(), YosysError> {
        if entry.kind == "$scopeinfo" {
            return Ok(());
        }
        if place(
            self,
            &YosysCell {
                name,
                entry,
                inverses,
            },
        )? {
            Ok(())
        } else {
            Err(YosysError::Cell {
                module: self.module.to_owned(),
                cell: name.to_owned(),
                kind: entry.kind.clone(),
                why: cell_fault(&entry.kind),
            })
        }
    }

    /// The net of a bit; `None` where nothing drives it.
    pub(super) fn net(&mut self, bit: &Bit) -> Option<Net> {
        match bit {
            Bit::Net(n) => self.nets.get(n).copied(),
            Bit::Constant(value) => match value.as_str() {
                "0" | "x" => self.constant(false),
                "1" => self.constant(true),
                _ => None,
            },
        }
    }

    /// A net that is constant once any input is known: the library has no cell for it.
    fn constant(&mut self, value: bool) -> Option<Net> {
        if self.constants[usize::from(value)].is_none() {
            let tie = self.tie?;
            let kind = if value { Xnor2 } else { Xor2 };
            self.constants[usize::from(value)] = Some(self.gate(kind, &[tie, tie]));
        }
        self.constants[usize::from(value)]
    }

    fn add(&mut self, kind: CellKind, inputs: &[Net], outputs: &[Option<Net>]) {
        let name = format!("cell_{}", self.placed);
        self.placed += 1;
        self.m.cell(&name, kind, inputs, outputs);
    }

    pub(super) fn gate_into(&mut self, kind: CellKind, inputs: &[Net], output: Net) {
        self.add(kind, inputs, &[Some(output)]);
    }

    fn gate(&mut self, kind: CellKind, inputs: &[Net]) -> Net {
        let output = self.m.unnamed();
        self.gate_into(kind, inputs, output);
        output
    }

    /// The inverse of a net, of one inverter however often it is wanted.
    fn not(&mut self, net: Net) -> Net {
        if let Some(&inverted) = self.inverted.get(&net) {
            return inverted;
        }
        let inverted = self.gate(Inv, &[net]);
        self.inverted.insert(net, inverted);
        inverted
    }

    /// A net as one that is active high.
    fn high(&mut self, net: Net, is_high: bool) -> Net {
        if is_high { net } else { self.not(net) }
    }

    /// A flip-flop with reset and set, active high, where it has them.
    fn flip_flop(
        &mut self,
        given: &YosysCell<'_>,
        [data, clock]: [Net; 2],
        controls: [Option<Net>; 2],
        [q, qn]: [Option<Net>; 2],
    ) -> Result<(), YosysError> {
        match controls {
            [Some(reset), Some(set)] => self.add(Dffsr, &[data, clock, reset, set], &[q, qn]),
            // The flip-flop here resets to 0: for 1 it holds the inverse.
            [None, Some(set)] => {
                let data = self.not(data);
                self.add(Dffr, &[data, clock, set], &[qn, q]);
            }
            [Some(reset), None] => self.add(Dffr, &[data, clock, reset], &[q, qn]),
            [None, None] => {
                let never = self.constant_for(given, "R", false)?;
                self.add(Dffr, &[data, clock, never], &[q, qn]);
            }
        }
        Ok(())
    }

    /// A constant that a cell needs at a pin.
    fn constant_for(
        &mut self,
        given: &YosysCell<'_>,
        pin: &str,
        value: bool,
    ) -> Result<Net, YosysError> {
        self.constant(value).ok_or_else(|| YosysError::Pin {
            module: self.module.to_owned(),
            cell: given.name.to_owned(),
            kind: given.entry.kind.clone(),
            pin: pin.to_owned(),
            problem: PinFault::NoConstant,
        })
    }

    fn pin(&mut self, given: &YosysCell<'_>, pin: &str) -> Result<Net, YosysError> {
        let problem = match given.entry.connections.get(pin).map(Vec::as_slice) {
            Some([bit]) => match self.net(bit) {
                Some(net) => return Ok(net),
                None => PinFault::Undriven,
            },
            Some([]) | None => PinFault::Open,
            Some(_) => PinFault::Bus,
        };
        Err(YosysError::Pin {
            module: self.module.to_owned(),
            cell: given.name.to_owned(),
            kind: given.entry.kind.clone(),
            pin: pin.to_owned(),
            problem,
        })
    }

    fn pins(
        &mut self,
        given: &YosysCell<'_>,
        pins: &[&'static str],
    ) -> Result<Vec<Net>, YosysError> {
        pins.iter().map(|&pin| self.pin(given, pin)).collect()
    }
}

/// Places the cells that do what a cell of this type does; false where there are none.
fn place(to: &mut Placing<'_>, given: &YosysCell<'_>) -> Result<bool, YosysError> {
    let kind = given.entry.kind.as_str();
    #[cfg(feature = "liberty")]
    if let Some(function) = &given.entry.of_library {
        library::place(to, given, function)?;
        return Ok(true);
    }
    if let Some(flip_flop) = FlipFlop::from_cell_kind(kind) {
        flip_flop.place(to, given)?;
        return Ok(true);
    }
    if let Some((_, kind, pins)) = ALIKE.iter().find(|(name, ..)| *name == kind) {
        let inputs = to.pins(given, pins)?;
        let output = to.pin(given, "Y")?;
        to.gate_into(*kind, &inputs, output);
        return Ok(true);
    }
    let pins: &[&str] = match kind {
        "$_ANDNOT_" | "$_ORNOT_" => &["A", "B"],
        "$_NMUX_" => &["A", "B", "S"],
        "$_AOI3_" | "$_OAI3_" => &["A", "B", "C"],
        "$_AOI4_" | "$_OAI4_" => &["A", "B", "C", "D"],
        _ => return Ok(false),
    };
    let inputs = to.pins(given, pins)?;
    let (a, b) = (inputs[0], inputs[1]);
    let output = to.pin(given, "Y")?;
    let (last, first, second) = match kind {
        "$_ANDNOT_" => (Nor2, to.not(a), b),
        "$_ORNOT_" => (Nand2, to.not(a), b),
        "$_NMUX_" => {
            let chosen = to.gate(Mux2, &inputs);
            to.gate_into(Inv, &[chosen], output);
            return Ok(true);
        }
        "$_AOI3_" => (Nor2, to.gate(And2, &[a, b]), inputs[2]),
        "$_OAI3_" => (Nand2, to.gate(Or2, &[a, b]), inputs[2]),
        "$_AOI4_" => (Nor2, to.gate(And2, &[a, b]), to.gate(And2, &inputs[2..])),
        _ => (Nand2, to.gate(Or2, &[a, b]), to.gate(Or2, &inputs[2..])),
    };
    to.gate_into(last, &[first, second], output);
    Ok(true)
}

/// Why a cell has no counterpart.
fn cell_fault(kind: &str) -> CellFault {
    match kind {
        _ if kind.starts_with("$_DLATCH") || kind.starts_with("$_SR_") || kind == "$dlatch" => {
            CellFault::Latch
        }
        _ if kind.starts_with("$mem") => CellFault::Memory,
        _ if kind.starts_with("$_") => CellFault::Gate,
        _ if kind.starts_with('$') => CellFault::NotMapped,
        _ => CellFault::Unknown,
    }
}

/// What a generic flip-flop has besides D and Q; whether it is active high.
#[derive(Default)]
pub(super) struct FlipFlop {
    clock: bool,
    enable: Option<bool>,
    /// With the value that it makes.
    reset: Option<(bool, bool)>,
    /// As `reset`, with the next clock edge.
    sync_reset: Option<(bool, bool)>,
    /// Whether an enable that is off keeps a reset with the clock off.
    enable_wins: bool,
    set_and_reset: Option<(bool, bool)>,
    /// While it is active, AD is taken.
    load: Option<bool>,
}

impl FlipFlop {
    /// What the name of a cell says, if it is a flip-flop's.
    pub(super) fn from_cell_kind(kind: &str) -> Option<Self> {
        let (family, letters) = kind
            .strip_prefix("$_")?
            .strip_suffix('_')?
            .split_once('_')?;
        let is_high = |letter: &u8| match letter {
            b'P' | b'1' => Some(true),
            b'N' | b'0' => Some(false),
            _ => None,
        };
        let flags: Option<Vec<bool>> = letters.as_bytes().iter().map(is_high).collect();
        let flags = flags?;
        let &clock = flags.first()?;
        let plain = FlipFlop {
            clock,
            ..FlipFlop::default()
        };
        Some(match (family, &flags[1..]) {
            ("DFF", []) => plain,
            ("DFFE", &[e]) => FlipFlop {
                enable: Some(e),
                ..plain
            },
            ("DFF", &[r, to]) => FlipFlop {
                reset: Some((r, to)),
                ..plain
            },
            ("DFFE", &[r, to, e]) => FlipFlop {
                reset: Some((r, to)),
                enable: Some(e),
                ..plain
            },
            ("SDFF", &[r, to]) => FlipFlop {
                sync_reset: Some((r, to)),
                ..plain
            },
            ("SDFFE" | "SDFFCE", &[r, to, e]) => FlipFlop {
                sync_reset: Some((r, to)),
                enable: Some(e),
                enable_wins: family == "SDFFCE",
                ..plain
            },
            ("DFFSR", &[s, r]) => FlipFlop {
                set_and_reset: Some((s, r)),
                ..plain
            },
            ("DFFSRE", &[s, r, e]) => FlipFlop {
                set_and_reset: Some((s, r)),
                enable: Some(e),
                ..plain
            },
            ("ALDFF", &[l]) => FlipFlop {
                load: Some(l),
                ..plain
            },
            ("ALDFFE", &[l, e]) => FlipFlop {
                load: Some(l),
                enable: Some(e),
                ..plain
            },
            _ => return None,
        })
    }

    fn place(&self, to: &mut Placing<'_>, given: &YosysCell<'_>) -> Result<(), YosysError> {
        let mut data = to.pin(given, "D")?;
        let q = to.pin(given, "Q")?;
        let qn = given.inverse_of_q().and_then(|n| to.nets.get(&n).copied());
        let clock = to.pin(given, "C")?;
        let clock = to.high(clock, self.clock);
        let is_enabled_first = !self.enable_wins;
        if is_enabled_first {
            data = self.enabled(to, given, data, q)?;
        }
        if let Some((is_high, value)) = self.sync_reset {
            let reset = to.pin(given, "R")?;
            data = if value {
                let reset = to.high(reset, is_high);
                to.gate(Or2, &[data, reset])
            } else {
                let keeps = to.high(reset, !is_high);
                to.gate(And2, &[data, keeps])
            };
        }
        if !is_enabled_first {
            data = self.enabled(to, given, data, q)?;
        }
        let active = |to: &mut Placing<'_>, pin, is_high| {
            let net = to.pin(given, pin)?;
            Ok::<Net, YosysError>(to.high(net, is_high))
        };
        if let Some(is_high) = self.load {
            let load = active(to, "L", is_high)?;
            let value = to.pin(given, "AD")?;
            let zero = to.not(value);
            let set = to.gate(And2, &[load, value]);
            let reset = to.gate(And2, &[load, zero]);
            return to.flip_flop(
                given,
                [data, clock],
                [Some(reset), Some(set)],
                [Some(q), qn],
            );
        }
        let (mut reset, mut set) = (None, None);
        if let Some((set_high, reset_high)) = self.set_and_reset {
            set = Some(active(to, "S", set_high)?);
            reset = Some(active(to, "R", reset_high)?);
        } else if let Some((is_high, value)) = self.reset {
            let net = active(to, "R", is_high)?;
            *(if value { &mut set } else { &mut reset }) = Some(net);
        }
        to.flip_flop(given, [data, clock], [reset, set], [Some(q), qn])
    }

    /// D, or Q where an enable is off.
    fn enabled(
        &self,
        to: &mut Placing<'_>,
        given: &YosysCell<'_>,
        data: Net,
        q: Net,
    ) -> Result<Net, YosysError> {
        let Some(is_high) = self.enable else {
            return Ok(data);
        };
        let enable = to.pin(given, "E")?;
        let choice = if is_high {
            [q, data, enable]
        } else {
            [data, q, enable]
        };
        Ok(to.gate(Mux2, &choice))
    }
}
