//! Netlists that Yosys wrote: `yosys -p "read_verilog my.v; synth -flatten; write_json my.json"`.
//!
//! ```text
//!   JSON ─► Design ─ top ─► ports and named nets ─► cells, each by `cells::place` ─► Module
//! ```
//!
//! Ports and nets keep their names and order. Yosys names most cells by where it made them, so cells get numbers. Flip-flops
//! power up unknown, as in silicon: initial values are not read. What is don't-care in Yosys is 0. An inverter behind a flip-flop
//! is its output QN. A library's cell (`dfflibmap`, `abc -liberty`) becomes what has its function.
//!
//! The crate `yosys-netlist-json` keeps ports and cells in hash maps, which have no order; so the few fields that matter are read here.

mod cells;
mod error;
#[cfg(test)]
mod tests;

use std::collections::{HashMap, HashSet};
use std::fmt;
use std::marker::PhantomData;
use std::sync::Arc;

use serde::Deserialize;
use serde::de::{Deserializer, MapAccess, Visitor};

#[cfg(feature = "liberty")]
use crate::liberty::{CellFunction, Liberty};
use crate::netlist::{CellKind, Module, ModuleBuilder, Net, is_identifier};
use cells::{FlipFlop, Placing};
pub use error::{CellFault, JsonFault, PinFault, YosysError};

/// Most bytes of a file: a macropixel has 1.2 MB, a block a tenth of that.
const MOST_BYTES: usize = 16 << 20;

/// The entries of a JSON object in their order.
struct OrderedEntries<T>(Vec<(String, T)>);

impl<T> Default for OrderedEntries<T> {
    fn default() -> Self {
        OrderedEntries(Vec::new())
    }
}

impl<T> OrderedEntries<T> {
    fn get(&self, name: &str) -> Option<&T> {
        let mut entries = self.0.iter();
        entries.find(|(known, _)| known == name).map(|(_, it)| it)
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for OrderedEntries<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Entries<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for Entries<T> {
            type Value = OrderedEntries<T>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "an object")
            }
            fn visit_map<A: MapAccess<'de>>(
                self,
                mut map: A,
            ) -> Result<OrderedEntries<T>, A::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = map.next_entry()? {
                    entries.push(entry);
                }
                Ok(OrderedEntries(entries))
            }
        }
        deserializer.deserialize_map(Entries(PhantomData))
    }
}

#[derive(Deserialize)]
struct Design {
    modules: OrderedEntries<YosysModule>,
}

#[derive(Deserialize)]
struct YosysModule {
    #[serde(default)]
    attributes: OrderedEntries<serde_json::Value>,
    #[serde(default)]
    ports: OrderedEntries<PortBits>,
    #[serde(default)]
    cells: OrderedEntries<CellEntry>,
    #[serde(default)]
    netnames: OrderedEntries<NetName>,
}

#[derive(Deserialize)]
struct PortBits {
    direction: String,
    bits: Vec<Bit>,
}

#[derive(Deserialize)]
struct CellEntry {
    /// What it does, where it is a library's.
    #[cfg(feature = "liberty")]
    #[serde(skip)]
    of_library: Option<CellFunction>,
    #[serde(rename = "type")]
    kind: String,
    #[serde(default)]
    port_directions: OrderedEntries<String>,
    connections: OrderedEntries<Vec<Bit>>,
}

#[derive(Deserialize)]
struct NetName {
    #[serde(default)]
    hide_name: u32,
    bits: Vec<Bit>,
}

/// A net by its number, or a constant: 0, 1, x or z.
#[derive(Deserialize, Clone, PartialEq, Eq, Hash)]
#[serde(untagged)]
enum Bit {
    Net(u64),
    Constant(String),
}

impl Module {
    /// Reads a netlist of Yosys's generic gates; of several modules the one called `top`, or else the one that Yosys marked as the top.
    ///
    /// # Errors
    /// Text that is no such netlist, modules that there are not or among which none is the top, cells that have no counterpart
    /// here, nets that nothing or more than one cell drives, names that are no identifiers.
    ///
    /// # Example
    ///
    /// ```
    /// use femtogate::netlist::Module;
    ///
    /// let text = r#"{"modules": {"top": {
    ///   "ports": {
    ///     "A": {"direction": "input", "bits": [2]},
    ///     "Y": {"direction": "output", "bits": [3]}
    ///   },
    ///   "cells": {
    ///     "$1": {"type": "$_NOT_", "connections": {"A": [2], "Y": [3]}}
    ///   }
    /// }}}"#;
    /// let top = Module::from_yosys(text, None)?;
    /// assert_eq!((top.name(), top.cells().len()), ("top", 1));
    ///
    /// let error = Module::from_yosys(text, Some("counter")).unwrap_err();
    /// assert_eq!(error.to_string(), "has no module counter; give top");
    /// # Ok::<(), femtogate::yosys::YosysError>(())
    /// ```
    pub fn from_yosys(text: &str, top: Option<&str>) -> Result<Arc<Self>, YosysError> {
        Design::from_json(text)?.build(top)
    }

    /// Reads a netlist of Yosys's generic gates and of a library's cells, which `abc` and `dfflibmap` put there.
    ///
    /// # Errors
    /// As [`Module::from_yosys`].
    #[cfg(feature = "liberty")]
    pub fn from_yosys_of(
        text: &str,
        top: Option<&str>,
        library: Option<&Liberty>,
    ) -> Result<Arc<Self>, YosysError> {
        let mut design = Design::from_json(text)?;
        let modules = design.modules.0.iter_mut();
        for (_, cell) in modules.flat_map(|(_, of)| &mut of.cells.0) {
            cell.of_library = library
                .and_then(|library| library.function(&cell.kind))
                .cloned();
        }
        design.build(top)
    }
}

impl Design {
    fn from_json(text: &str) -> Result<Self, YosysError> {
        if text.len() > MOST_BYTES {
            return Err(YosysError::TooLong(text.len()));
        }
        serde_json::from_str(text).map_err(|e| YosysError::NoNetlist(JsonFault::new(&e)))
    }

    /// The module called `top`, or else the one that is marked as the top.
    fn build(&self, top: Option<&str>) -> Result<Arc<Module>, YosysError> {
        let modules = &self.modules.0;
        let is_top = |module: &YosysModule| {
            let top = module.attributes.get("top").map(ToString::to_string);
            top.is_some_and(|value| value.contains('1'))
        };
        let names = || modules.iter().map(|(name, _)| name.clone()).collect();
        let (name, described) = match top {
            Some(top) => {
                let asked = modules.iter().find(|(name, _)| name == top);
                asked.ok_or_else(|| YosysError::NoModule {
                    asked: top.to_owned(),
                    there: names(),
                })?
            }
            None => match (&modules[..], modules.iter().find(|(_, of)| is_top(of))) {
                ([], _) => return Err(YosysError::NoNetlist(JsonFault::NoModule)),
                ([only], _) | (_, Some(only)) => only,
                _ => return Err(YosysError::NoTop(names())),
            },
        };
        described.build(name)
    }
}

impl YosysModule {
    fn build(&self, name: &str) -> Result<Arc<Module>, YosysError> {
        let driven = self.drivers(name)?;
        let mut m = ModuleBuilder::new(name);
        let mut nets: HashMap<u64, Net> = HashMap::new();
        // Outputs whose bit is a net already, or a constant.
        let mut joined: Vec<(&Bit, Net)> = Vec::new();
        let mut tie = None;
        for (port, PortBits { direction, bits }) in &self.ports.0 {
            let is_input = match direction.as_str() {
                "input" => true,
                "output" => false,
                _ => {
                    return Err(YosysError::Direction {
                        module: name.to_owned(),
                        port: port.clone(),
                        direction: direction.clone(),
                    });
                }
            };
            let own = match (is_input, bits.len()) {
                (true, 1) => vec![m.input(port)],
                (true, width) => m.input_bus(port, width),
                (false, 1) => vec![m.output(port)],
                (false, width) => m.output_bus(port, width),
            };
            if is_input && (tie.is_none() || bits.len() == 1) {
                tie = own.first().copied();
            }
            for (bit, own) in bits.iter().zip(own) {
                match bit {
                    Bit::Net(n)
                        if !nets.contains_key(n) && (is_input || driven.contains_key(n)) =>
                    {
                        nets.insert(*n, own);
                    }
                    _ => joined.push((bit, own)),
                }
            }
        }
        let mut taken: HashSet<&str> = self.ports.0.iter().map(|(port, _)| &**port).collect();
        for (net, NetName { hide_name, bits }) in &self.netnames.0 {
            let numbers = bits.iter().map(|bit| match bit {
                Bit::Net(n) if driven.contains_key(n) && !nets.contains_key(n) => Some(*n),
                _ => None,
            });
            let Some(numbers) = numbers.collect::<Option<Vec<u64>>>() else {
                continue;
            };
            let is_plain = numbers.iter().collect::<HashSet<_>>().len() == numbers.len();
            let is_free = is_identifier(net) && !is_ours(net) && taken.insert(net);
            if *hide_name == 0 && is_plain && is_free {
                let own = match numbers.len() {
                    1 => vec![m.wire(net)],
                    width => m.wire_bus(net, width),
                };
                nets.extend(numbers.into_iter().zip(own));
            }
        }
        for (_, cell) in &self.cells.0 {
            for bit in cell.outputs().flat_map(|(_, bits)| bits) {
                if let Bit::Net(n) = bit {
                    nets.entry(*n).or_insert_with(|| m.unnamed());
                }
            }
        }
        let kinds: HashMap<&str, &CellEntry> =
            self.cells.0.iter().map(|(n, of)| (&**n, of)).collect();
        let inverses = self.cells.0.iter().filter_map(|(_, of)| {
            let (from, to) = of.inverts()?;
            let driver = kinds.get(driven.get(&from)?)?;
            driver.is_flip_flop().then_some((from, to))
        });
        // Yosys has merged inverters of one net; of others the last one counts.
        let inverses: HashMap<u64, u64> = inverses.collect();
        let mut placing = Placing::new(m, nets, tie, name);
        for (cell, of) in &self.cells.0 {
            let is_qn = of
                .inverts()
                .is_some_and(|(from, to)| inverses.get(&from) == Some(&to));
            if !is_qn {
                placing.cell(cell, of, &inverses)?;
            }
        }
        for (bit, port) in joined {
            let from = placing.net(bit).ok_or_else(|| YosysError::Undriven {
                module: name.to_owned(),
                net: self.name_of(bit),
            })?;
            placing.gate_into(CellKind::Buf, &[from], port);
        }
        Ok(placing.finish()?)
    }

    /// The cell that drives each net, which is one.
    fn drivers(&self, module: &str) -> Result<HashMap<u64, &str>, YosysError> {
        let mut drivers: HashMap<u64, &str> = HashMap::new();
        let inputs = self
            .ports
            .0
            .iter()
            .filter(|(_, of)| of.direction == "input");
        let inputs = inputs.map(|(port, of)| (&**port, &of.bits));
        let input_bits: HashMap<&Bit, &str> = inputs
            .flat_map(|(port, bits)| bits.iter().map(move |bit| (bit, port)))
            .collect();
        for (cell, of) in &self.cells.0 {
            for bit in of.outputs().flat_map(|(_, bits)| bits) {
                let Bit::Net(n) = bit else {
                    continue;
                };
                let other = input_bits.get(bit).copied();
                let other = other.or_else(|| drivers.insert(*n, cell));
                if let Some(other) = other {
                    return Err(YosysError::TwoDrivers {
                        module: module.to_owned(),
                        net: self.name_of(bit),
                        first: other.to_owned(),
                        second: cell.clone(),
                    });
                }
            }
        }
        Ok(drivers)
    }

    /// What a net is called.
    fn name_of(&self, bit: &Bit) -> String {
        let mut names = self.netnames.0.iter();
        let found = names.find_map(|(name, of)| {
            let index = of.bits.iter().position(|known| known == bit)?;
            Some(match of.bits.len() {
                1 => name.clone(),
                _ => format!("{name}[{index}]"),
            })
        });
        found.unwrap_or_else(|| match bit {
            Bit::Net(n) => format!("#{n}"),
            Bit::Constant(value) => format!("constant {value}"),
        })
    }
}

/// Whether a name is one of those that nets and cells without names get.
fn is_ours(name: &str) -> bool {
    let number = name
        .strip_prefix("cell_")
        .or_else(|| name.strip_prefix('n'));
    number.is_some_and(|digits| digits.bytes().all(|b| b.is_ascii_digit()))
}

impl CellEntry {
    fn is_flip_flop(&self) -> bool {
        FlipFlop::from_cell_kind(&self.kind).is_some()
    }

    /// The nets of an inverter.
    fn inverts(&self) -> Option<(u64, u64)> {
        let net = |pin| match self.connections.get(pin).map(Vec::as_slice) {
            Some([Bit::Net(n)]) => Some(*n),
            _ => None,
        };
        (self.kind == "$_NOT_").then_some((net("A")?, net("Y")?))
    }

    /// Pins that drive nets.
    fn outputs(&self) -> impl Iterator<Item = &(String, Vec<Bit>)> {
        self.connections.0.iter().filter(|(pin, _)| {
            #[cfg(feature = "liberty")]
            if let Some(of) = &self.of_library {
                // Yosys says no directions of cells that it has not read.
                return of.outputs.contains(pin);
            }
            let said = self.port_directions.get(pin).map(String::as_str);
            said.map_or(matches!(&**pin, "Y" | "Q"), |said| said != "input")
        })
    }
}
