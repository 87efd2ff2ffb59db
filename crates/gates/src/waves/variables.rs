//! What a waveform file declares: scopes, variables, and which variables show the same nets.
//!
//! What is the same is one variable: a net that ports carry through several scopes, and buses of the same nets in
//! the same order. Viewers then store it once, and know it as one. A bus of one bit is the same as a scalar.

use std::collections::HashMap;
use std::io;
use std::ops::Range;

use super::selection::{Coverage, WaveSelection};
use crate::netlist::{NetId, Netlist};

/// Marks a net that is not shown as a scalar.
pub(super) const NO_VARIABLE: u32 = u32::MAX;

/// A name in the hierarchy.
pub(super) struct Declaration<'n> {
    pub name: &'n str,
    /// Nets that it shows.
    pub width: u32,
    /// Whether it has a range, `[width - 1:0]`; a bus may be of one net.
    pub is_bus: bool,
    /// Its variable, numbered in the order in which they are first declared.
    pub variable: u32,
    /// Whether an earlier declaration has the same variable.
    pub is_alias: bool,
}

/// Hears of the hierarchy, in the order in which files declare it.
pub(super) trait Declare {
    fn scope(&mut self, name: &str) -> io::Result<()>;
    fn up_scope(&mut self) -> io::Result<()>;
    fn signal(&mut self, declaration: &Declaration<'_>) -> io::Result<()>;
}

/// A variable: its nets are `Variables::nets[nets]`, most significant first.
pub(super) struct Variable {
    pub nets: Range<usize>,
    pub is_changed: bool,
}

/// A bit of a bus: which bus, and where among `Variables::nets`.
#[derive(Clone, Copy)]
pub(super) struct BusBit {
    pub variable: u32,
    pub place: u32,
}

/// The distinct variables of a file.
pub(super) struct Variables {
    pub all: Vec<Variable>,
    pub nets: Vec<u32>,
    /// The variable that shows a net alone, or [`NO_VARIABLE`].
    pub scalar_of_net: Vec<u32>,
    buses: HashMap<Vec<u32>, u32>,
}

impl Variables {
    /// Declares what is selected of `netlist`.
    ///
    /// # Errors
    /// Those of `out`, and a path in `selection` that does not exist.
    pub(super) fn declare(
        netlist: &Netlist,
        selection: &WaveSelection,
        out: &mut impl Declare,
    ) -> io::Result<Self> {
        let coverage = selection.coverage(netlist)?;
        let mut variables = Variables {
            all: Vec::new(),
            nets: Vec::new(),
            scalar_of_net: vec![NO_VARIABLE; netlist.net_count()],
            buses: HashMap::new(),
        };
        // Ends of the subtrees that are open.
        let mut open: Vec<usize> = Vec::new();
        for (index, scope) in netlist.scopes().iter().enumerate() {
            while open.last().is_some_and(|&end| end <= index) {
                open.pop();
                out.up_scope()?;
            }
            if coverage[index] == Coverage::Nothing {
                continue;
            }
            open.push(index + scope.subtree);
            out.scope(&scope.name)?;
            if coverage[index] == Coverage::Path {
                continue;
            }
            for signal in scope.module.signals() {
                if signal.width() > 0 && (signal.is_named || selection.includes_anonymous()) {
                    let nets = netlist.signal_nets(scope, signal).rev();
                    let (variable, is_alias) = variables.find_or_add(nets.map(index_of).collect());
                    out.signal(&Declaration {
                        name: &signal.name,
                        width: signal.width() as u32,
                        is_bus: signal.is_bus,
                        variable,
                        is_alias,
                    })?;
                }
            }
        }
        for _ in open {
            out.up_scope()?;
        }
        Ok(variables)
    }

    /// The variable of these nets, most significant first, and whether there was one before.
    fn find_or_add(&mut self, nets: Vec<u32>) -> (u32, bool) {
        let known = match nets[..] {
            [net] => self.scalar_of_net[net as usize],
            _ => self.buses.get(&nets).copied().unwrap_or(NO_VARIABLE),
        };
        if known != NO_VARIABLE {
            return (known, true);
        }
        let variable = self.all.len() as u32;
        let first = self.nets.len();
        self.nets.extend_from_slice(&nets);
        self.all.push(Variable {
            nets: first..self.nets.len(),
            is_changed: false,
        });
        match nets[..] {
            [net] => self.scalar_of_net[net as usize] = variable,
            _ => _ = self.buses.insert(nets, variable),
        }
        (variable, false)
    }

    /// Lists for every net the bits of buses that it is: start of each net's list, then the lists.
    pub(super) fn bus_bits(&self) -> (Vec<u32>, Vec<BusBit>) {
        let buses = || (0u32..).zip(&self.all).filter(|(_, v)| v.nets.len() > 1);
        let mut start = vec![0u32; self.scalar_of_net.len() + 1];
        for (_, bus) in buses() {
            for &net in &self.nets[bus.nets.clone()] {
                start[net as usize + 1] += 1;
            }
        }
        for i in 1..start.len() {
            start[i] += start[i - 1];
        }
        let mut next = start.clone();
        let empty = BusBit {
            variable: NO_VARIABLE,
            place: 0,
        };
        let mut bits = vec![empty; start[start.len() - 1] as usize];
        for (variable, bus) in buses() {
            for place in bus.nets.clone() {
                let slot = &mut next[self.nets[place] as usize];
                let place = place as u32;
                bits[*slot as usize] = BusBit { variable, place };
                *slot += 1;
            }
        }
        (start, bits)
    }
}

fn index_of(net: NetId) -> u32 {
    net.index() as u32
}
