//! The builder of circuit descriptions: declares nets, places cells and instances, and checks the whole.
//!
//! ```
//! use femtogate::netlist::{CellKind, ModuleBuilder};
//!
//! // A divide-by-two: D = Q̄.
//! let mut m = ModuleBuilder::new("toggle");
//! let (clk, reset, q) = (m.input("CLK"), m.input("RESET"), m.output("Q"));
//! let qn = m.wire("QN");
//! m.cell("flip", CellKind::Dffr, &[qn, clk, reset], &[q, qn]);
//! let toggle = m.finish().unwrap();
//! assert_eq!(toggle.transistors(), 24);
//! ```

use std::collections::HashSet;
use std::sync::Arc;

use super::cell::{CellKind, MAX_INPUTS, MAX_OUTPUTS};
use super::error::NetlistError;
use super::module::{Cell, Direction, Instance, Module, Names, Net, Port, Signal};
use super::own_delay::OwnDelay;

/// Builds a [`Module`]; the first mistake is kept and returned by [`ModuleBuilder::finish`].
pub struct ModuleBuilder {
    module: Module,
    drivers: Vec<Option<String>>,
    error: Option<NetlistError>,
}

impl ModuleBuilder {
    /// Starts an empty module.
    pub fn new(name: impl Into<String>) -> Self {
        ModuleBuilder {
            module: Module {
                name: name.into(),
                signals: Vec::new(),
                ports: Vec::new(),
                net_count: 0,
                cells: Vec::new(),
                instances: Vec::new(),
                names: Names::default(),
            },
            drivers: Vec::new(),
            error: None,
        }
    }

    fn declare(&mut self, name: String, width: usize, is_bus: bool, is_named: bool) -> Vec<Net> {
        let first = self.module.net_count;
        let signal = Signal {
            name,
            first,
            width: width as u32,
            is_bus,
            is_named,
        };
        self.module.net_count += width as u32;
        self.drivers.resize(self.module.net_count as usize, None);
        let nets = signal.nets().collect();
        self.module.signals.push(signal);
        nets
    }

    fn port(&mut self, name: &str, width: usize, is_bus: bool, direction: Direction) -> Vec<Net> {
        self.module.ports.push(Port {
            signal: self.module.signals.len(),
            direction,
        });
        let nets = self.declare(name.to_owned(), width, is_bus, true);
        if direction == Direction::Input {
            for &net in &nets {
                self.drive(net, || format!("input {name}"));
            }
        }
        nets
    }

    /// Declares an input port.
    pub fn input(&mut self, name: &str) -> Net {
        self.port(name, 1, false, Direction::Input)[0]
    }

    /// Declares an input bus (bit 0 first).
    pub fn input_bus(&mut self, name: &str, width: usize) -> Vec<Net> {
        self.port(name, width, true, Direction::Input)
    }

    /// Declares an output port; drive it like any net.
    pub fn output(&mut self, name: &str) -> Net {
        self.port(name, 1, false, Direction::Output)[0]
    }

    /// Declares an output bus (bit 0 first).
    pub fn output_bus(&mut self, name: &str, width: usize) -> Vec<Net> {
        self.port(name, width, true, Direction::Output)
    }

    /// Declares an internal net.
    pub fn wire(&mut self, name: &str) -> Net {
        self.declare(name.to_owned(), 1, false, true)[0]
    }

    /// Declares an internal bus (bit 0 first).
    pub fn wire_bus(&mut self, name: &str, width: usize) -> Vec<Net> {
        self.declare(name.to_owned(), width, true, true)
    }

    fn fail(&mut self, error: NetlistError) {
        self.error.get_or_insert(error);
    }

    fn net_name(&self, net: Net) -> String {
        let signal = self
            .module
            .signals
            .iter()
            .find(|s| (s.first..s.first + s.width).contains(&net.0));
        match signal {
            Some(s) if s.is_bus => format!("{}[{}]", s.name, net.0 - s.first),
            Some(s) => s.name.clone(),
            None => format!("#{}", net.0),
        }
    }

    fn drive(&mut self, net: Net, driver: impl Fn() -> String) {
        match &self.drivers[net.index()] {
            None => self.drivers[net.index()] = Some(driver()),
            Some(first) => {
                let error = NetlistError::DriverConflict {
                    module: self.module.name.clone(),
                    net: self.net_name(net),
                    first: first.clone(),
                    second: driver(),
                };
                self.fail(error);
            }
        }
    }

    fn check_width(&mut self, what: impl Fn() -> String, wanted: usize, got: usize) -> bool {
        if wanted != got {
            let module = self.module.name.clone();
            self.fail(NetlistError::WidthMismatch {
                module,
                what: what(),
                wanted,
                got,
            });
        }
        wanted == got
    }

    /// Places a cell with its nets in pin order. Outputs are nets, or options of nets where one is left open.
    pub fn cell<N: Into<Option<Net>> + Copy>(
        &mut self,
        name: &str,
        kind: CellKind,
        inputs: &[Net],
        outputs: &[N],
    ) {
        let what = |side| move || format!("cell {name} ({} {side})", kind.name());
        if !self.check_width(what("inputs"), kind.inputs().len(), inputs.len())
            || !self.check_width(what("outputs"), kind.outputs().len(), outputs.len())
        {
            return;
        }
        let mut cell = Cell {
            name: name.to_owned(),
            kind,
            inputs: [None; MAX_INPUTS],
            outputs: [None; MAX_OUTPUTS],
            own_delay: None,
        };
        for (pin, &net) in cell.inputs.iter_mut().zip(inputs) {
            *pin = Some(net);
        }
        for (pin, &net) in cell.outputs.iter_mut().zip(outputs) {
            *pin = net.into();
        }
        for net in cell.outputs.into_iter().flatten() {
            self.drive(net, || format!("cell {name}"));
        }
        self.module.cells.push(cell);
    }

    /// Places a cell with a delay of its own.
    pub fn cell_with_delay<N: Into<Option<Net>> + Copy>(
        &mut self,
        name: &str,
        kind: CellKind,
        inputs: &[Net],
        outputs: &[N],
        delay: OwnDelay,
    ) {
        self.cell(name, kind, inputs, outputs);
        if let Some(cell) = self
            .module
            .cells
            .last_mut()
            .filter(|cell| cell.name == name)
        {
            cell.own_delay = Some(delay);
        }
    }

    /// Places a gate that drives `output`.
    pub fn gate_into(&mut self, kind: CellKind, inputs: &[Net], output: Net) {
        let name = format!("u{}", self.module.cells.len());
        self.cell(&name, kind, inputs, &[output]);
    }

    /// Places a gate and returns its new, unnamed output net.
    pub fn gate(&mut self, kind: CellKind, inputs: &[Net]) -> Net {
        let output = self.unnamed();
        self.gate_into(kind, inputs, output);
        output
    }

    /// A new net without a name of its own.
    pub(crate) fn unnamed(&mut self) -> Net {
        let name = format!("n{}", self.module.net_count);
        self.declare(name, 1, false, false)[0]
    }

    /// Combines any number of nets with a balanced tree of 2-input gates of one kind.
    ///
    /// # Panics
    /// When `inputs` is empty.
    ///
    /// # Example
    ///
    /// ```
    /// use femtogate::netlist::{CellKind, ModuleBuilder};
    ///
    /// let mut m = ModuleBuilder::new("parity");
    /// let word = m.input_bus("WORD", 8);
    /// let odd = m.tree(CellKind::Xor2, &word);
    /// let parity = m.output("PARITY");
    /// m.gate_into(CellKind::Buf, &[odd], parity);
    /// assert_eq!(m.finish()?.cells().len(), 7 + 1);
    /// # Ok::<(), femtogate::netlist::NetlistError>(())
    /// ```
    pub fn tree(&mut self, kind: CellKind, inputs: &[Net]) -> Net {
        assert!(!inputs.is_empty(), "a tree needs a leaf");
        let mut level = inputs.to_vec();
        while level.len() > 1 {
            level = level
                .chunks(2)
                .map(|pair| match *pair {
                    [a, b] => self.gate(kind, &[a, b]),
                    _ => pair[0],
                })
                .collect();
        }
        level[0]
    }

    /// Instantiates `module`, connecting ports by name. Outputs may be left out.
    pub fn instance(&mut self, name: &str, module: &Arc<Module>, ports: &[(&str, &[Net])]) {
        let ports: Vec<(&str, Vec<Option<Net>>)> = ports
            .iter()
            .map(|(port, nets)| (*port, nets.iter().copied().map(Some).collect()))
            .collect();
        self.instance_with_open_bits(name, module, &ports);
    }

    /// Instantiates `module` as [`ModuleBuilder::instance`] does, where single bits of outputs may be left open, too.
    pub fn instance_with_open_bits(
        &mut self,
        name: &str,
        module: &Arc<Module>,
        ports: &[(&str, Vec<Option<Net>>)],
    ) {
        let mut connections = Vec::new();
        let parent = self.module.name.clone();
        let mut errors = Vec::new();
        for (port, _) in ports {
            if !module.port_signals().any(|(_, s)| s.name == *port) {
                errors.push(NetlistError::NoPort {
                    module: parent.clone(),
                    instance: name.to_owned(),
                    port: (*port).to_owned(),
                });
            }
        }
        for (direction, signal) in module.port_signals() {
            match ports.iter().find(|(port, _)| *port == signal.name) {
                Some((_, nets)) => {
                    let what = || format!("port {} of instance {name}", signal.name);
                    if self.check_width(what, signal.width(), nets.len()) {
                        let is_open = nets.iter().all(Option::is_none);
                        for &net in nets {
                            // Verilog can leave open a port as a whole, but no bit of it.
                            let net = net.or_else(|| (!is_open).then(|| self.unnamed()));
                            connections.push(net);
                            if let (Direction::Output, Some(net)) = (direction, net) {
                                self.drive(net, || format!("instance {name}"));
                            }
                        }
                    }
                }
                None if direction == Direction::Output => {
                    connections.extend(signal.nets().map(|_| None));
                }
                None => errors.push(NetlistError::OpenInput {
                    module: parent.clone(),
                    instance: name.to_owned(),
                    port: signal.name.clone(),
                }),
            }
        }
        errors.into_iter().for_each(|error| self.fail(error));
        self.module.instances.push(Instance {
            name: name.to_owned(),
            module: Arc::clone(module),
            connections,
        });
    }

    /// Instantiates `module` as [`ModuleBuilder::instance`] does; a port that is not in `ports` is connected to the signal of
    /// its own name. An output without one stays open.
    pub fn instance_by_names(
        &mut self,
        name: &str,
        module: &Arc<Module>,
        ports: &[(&str, &[Net])],
    ) {
        let signal = |name: &str| {
            let mut signals = self.module.signals.iter();
            signals.find(|s| s.is_named && s.name == name)
        };
        let left = module.port_signals().map(|(_, port)| port.name.as_str());
        let left = left.filter(|name| ports.iter().all(|(given, _)| given != name));
        let left: Vec<(&str, Vec<Net>)> = left
            .filter_map(|name| Some((name, signal(name)?.nets().collect())))
            .collect();
        let left = left.iter().map(|(name, nets)| (*name, nets.as_slice()));
        let ports: Vec<_> = ports.iter().copied().chain(left).collect();
        self.instance(name, module, &ports);
    }

    /// Checks the module and hands it out.
    ///
    /// # Errors
    /// The first mistake made: driver conflicts, undriven nets, wrong widths, unknown ports,
    /// duplicate or unusable names.
    ///
    /// # Example
    ///
    /// ```
    /// use femtogate::netlist::ModuleBuilder;
    ///
    /// let mut m = ModuleBuilder::new("top");
    /// m.output("Z");
    /// let error = m.finish().unwrap_err();
    /// assert_eq!(
    ///     error.to_string(),
    ///     "module top: nothing drives net Z; connect an output to it or remove it"
    /// );
    /// ```
    pub fn finish(mut self) -> Result<Arc<Module>, NetlistError> {
        if let Some(net) = self.drivers.iter().position(Option::is_none) {
            let error = NetlistError::Undriven {
                module: self.module.name.clone(),
                net: self.net_name(Net(net as u32)),
            };
            self.fail(error);
        }
        self.check_names();
        match self.error {
            Some(error) => Err(error),
            None => {
                self.module.names = Names::new(&self.module);
                Ok(Arc::new(self.module))
            }
        }
    }

    fn check_names(&mut self) {
        let module = &self.module;
        let names = std::iter::once(&module.name)
            .chain(module.signals.iter().map(|s| &s.name))
            .chain(module.cells.iter().map(|c| &c.name))
            .chain(module.instances.iter().map(|i| &i.name));
        let mut seen = HashSet::new();
        let mut error = None;
        for (i, name) in names.enumerate() {
            if !is_identifier(name) {
                error.get_or_insert(NetlistError::BadName {
                    module: module.name.clone(),
                    name: name.clone(),
                });
            }
            // A module's own name lives in another name space.
            if i > 0 && !seen.insert(name) {
                error.get_or_insert(NetlistError::DuplicateName {
                    module: module.name.clone(),
                    name: name.clone(),
                });
            }
        }
        if let Some(error) = error {
            self.fail(error);
        }
    }
}

pub(crate) fn is_identifier(name: &str) -> bool {
    let mut bytes = name.bytes();
    bytes
        .next()
        .is_some_and(|b| b.is_ascii_alphabetic() || b == b'_')
        && bytes.all(|b| b.is_ascii_alphanumeric() || b == b'_')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_drivers_are_a_conflict() {
        let mut m = ModuleBuilder::new("m");
        let a = m.input("A");
        let z = m.output("Z");
        m.gate_into(CellKind::Inv, &[a], z);
        m.gate_into(CellKind::Buf, &[a], z);
        let error = m.finish().unwrap_err();
        assert!(
            matches!(error, NetlistError::DriverConflict { .. }),
            "{error}"
        );
    }

    #[test]
    fn an_open_net_is_reported_by_name() {
        let mut m = ModuleBuilder::new("m");
        m.output_bus("Z", 2);
        let error = m.finish().unwrap_err().to_string();
        assert!(error.contains("Z[0]"), "{error}");
    }

    #[test]
    fn names_and_widths_are_checked() {
        let mut m = ModuleBuilder::new("m");
        m.input("A");
        m.input("A");
        assert!(matches!(
            m.finish(),
            Err(NetlistError::DuplicateName { .. })
        ));

        let mut named_like_a_port = ModuleBuilder::new("A");
        let a = named_like_a_port.input("A");
        named_like_a_port.gate(CellKind::Inv, &[a]);
        assert!(named_like_a_port.finish().is_ok());

        let mut m = ModuleBuilder::new("m");
        m.input("A[0]");
        assert!(matches!(m.finish(), Err(NetlistError::BadName { .. })));

        let mut m = ModuleBuilder::new("m");
        let a = m.input("A");
        m.gate(CellKind::Inv, &[a, a]);
        assert!(matches!(
            m.finish(),
            Err(NetlistError::WidthMismatch { .. })
        ));
    }

    #[test]
    fn instances_need_every_input() {
        let mut m = ModuleBuilder::new("leaf");
        let a = m.input("A");
        m.gate(CellKind::Inv, &[a]);
        let leaf = m.finish().unwrap();
        let mut m = ModuleBuilder::new("top");
        m.instance("u", &leaf, &[]);
        assert!(matches!(m.finish(), Err(NetlistError::OpenInput { .. })));
    }

    #[test]
    fn ports_take_the_signals_of_their_names_unless_they_are_given_others() {
        let mut m = ModuleBuilder::new("leaf");
        let (a, b, z) = (m.input("A"), m.input("B"), m.output("Z"));
        m.gate_into(CellKind::And2, &[a, b], z);
        let leaf = m.finish().unwrap();
        let mut m = ModuleBuilder::new("top");
        let (a, c, z) = (m.input("A"), m.input("C"), m.output("Z"));
        m.instance_by_names("u", &leaf, &[("B", &[c])]);
        let top = m.finish().unwrap();
        assert_eq!(top.instances()[0].connections, [a, c, z].map(Some));

        let mut m = ModuleBuilder::new("top");
        m.input("A");
        m.instance_by_names("u", &leaf, &[]);
        assert!(matches!(m.finish(), Err(NetlistError::OpenInput { .. })));
    }
}
