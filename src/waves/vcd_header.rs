//! The head of a value change dump: scopes, variables and their identifier codes, and the first values.
//!
//! What is the same has one code: a net that ports carry through several scopes, and buses of the same nets in
//! the same order. Viewers then store it once, and know it as one.

use std::collections::HashMap;
use std::io::{self, BufWriter, Write};

use vcd::{IdCode, ReferenceIndex, SimulationCommand, TimescaleUnit, VarType};

use super::selection::{Coverage, Selection};
use crate::netlist::Netlist;

/// Bytes collected before they are handed to the underlying writer.
pub(super) const BLOCK: usize = 1 << 16;

/// Marks a net that is not shown as a scalar.
pub(super) const NO_SCALAR: u32 = u32::MAX;

/// The line of a scalar change: value, identifier code, newline.
#[derive(Clone, Copy)]
pub(super) struct ScalarLine {
    pub bytes: [u8; 8],
    pub length: u8,
}

impl ScalarLine {
    fn new(code: IdCode) -> Self {
        let text = format!("x{code}\n");
        // 94⁵ codes, more than there can be nets, have at most five characters.
        assert!(text.len() <= 8, "identifier code too long");
        let mut bytes = [0; 8];
        bytes[..text.len()].copy_from_slice(text.as_bytes());
        ScalarLine {
            bytes,
            length: text.len() as u8,
        }
    }
}

/// A bus: its nets are `bus_bits[bits]`, most significant first.
pub(super) struct Bus {
    pub bits: std::ops::Range<usize>,
    /// Space, identifier code, newline.
    pub tail: Box<[u8]>,
    pub is_changed: bool,
}

/// Writes everything before the first change, and returns what got which identifier code.
pub(super) fn write_header(
    out: &mut impl Write,
    netlist: &Netlist,
    selection: &Selection,
) -> io::Result<Variables> {
    let coverage = selection.coverage(netlist)?;
    let mut variables = Variables::new(netlist.net_count());
    let mut header = vcd::Writer::new(BufWriter::with_capacity(BLOCK, out));
    header.version(concat!(
        env!("CARGO_PKG_NAME"),
        " ",
        env!("CARGO_PKG_VERSION")
    ))?;
    header.timescale(1, TimescaleUnit::FS)?;
    // Ends of the subtrees that are open.
    let mut open: Vec<usize> = Vec::new();
    for (index, scope) in netlist.scopes().iter().enumerate() {
        while open.last().is_some_and(|&end| end <= index) {
            open.pop();
            header.upscope()?;
        }
        if coverage[index] == Coverage::Nothing {
            continue;
        }
        open.push(index + scope.subtree);
        header.add_module(&scope.name)?;
        if coverage[index] == Coverage::Path {
            continue;
        }
        for signal in scope.module.signals() {
            if signal.width() > 0 && (signal.is_named || selection.includes_anonymous()) {
                let nets = netlist.signal_nets(scope, signal);
                let bits: Vec<u32> = nets.rev().map(|n| n.index() as u32).collect();
                let width = bits.len() as u32;
                let range = ReferenceIndex::Range(width as i32 - 1, 0);
                let range = signal.is_bus.then_some(range);
                let code = variables.code(bits);
                header.var_def(VarType::Wire, width, code, &signal.name, range)?;
            }
        }
    }
    for _ in open {
        header.upscope()?;
    }
    header.enddefinitions()?;
    header.timestamp(0)?;
    header.begin(SimulationCommand::Dumpvars)?;
    variables.write_unknown(header.writer())?;
    header.end()?;
    header.flush()?;
    Ok(variables)
}

/// The distinct variables of a file: those with an identifier code of their own.
pub(super) struct Variables {
    next_code: IdCode,
    /// Index into `scalars` by net, or [`NO_SCALAR`].
    pub scalar_of_net: Vec<u32>,
    pub scalars: Vec<ScalarLine>,
    scalar_codes: Vec<IdCode>,
    pub buses: Vec<Bus>,
    pub bus_bits: Vec<u32>,
    bus_codes: HashMap<Vec<u32>, IdCode>,
}

impl Variables {
    fn new(net_count: usize) -> Self {
        Variables {
            next_code: IdCode::FIRST,
            scalar_of_net: vec![NO_SCALAR; net_count],
            scalars: Vec::new(),
            scalar_codes: Vec::new(),
            buses: Vec::new(),
            bus_bits: Vec::new(),
            bus_codes: HashMap::new(),
        }
    }

    /// Identifier code of these nets, most significant first.
    fn code(&mut self, bits: Vec<u32>) -> IdCode {
        match bits[..] {
            // A bus of one bit is the same as a scalar.
            [net] => self.scalar_code(net as usize),
            _ => self.bus_code(bits),
        }
    }

    fn scalar_code(&mut self, net: usize) -> IdCode {
        if self.scalar_of_net[net] == NO_SCALAR {
            let code = self.new_code();
            self.scalar_of_net[net] = self.scalars.len() as u32;
            self.scalars.push(ScalarLine::new(code));
            self.scalar_codes.push(code);
        }
        self.scalar_codes[self.scalar_of_net[net] as usize]
    }

    fn bus_code(&mut self, bits: Vec<u32>) -> IdCode {
        if let Some(&code) = self.bus_codes.get(&bits) {
            return code;
        }
        let code = self.new_code();
        let first = self.bus_bits.len();
        self.bus_bits.extend_from_slice(&bits);
        self.buses.push(Bus {
            bits: first..self.bus_bits.len(),
            tail: format!(" {code}\n").into_bytes().into(),
            is_changed: false,
        });
        self.bus_codes.insert(bits, code);
        code
    }

    fn new_code(&mut self) -> IdCode {
        let code = self.next_code;
        self.next_code = code.next();
        code
    }

    fn write_unknown(&self, out: &mut impl Write) -> io::Result<()> {
        for line in &self.scalars {
            out.write_all(&line.bytes[..line.length as usize])?;
        }
        for bus in &self.buses {
            out.write_all(b"b")?;
            for _ in bus.bits.clone() {
                out.write_all(b"x")?;
            }
            out.write_all(&bus.tail)?;
        }
        Ok(())
    }
}
