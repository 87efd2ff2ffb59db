//! What a viewer shows when it opens a waveform: which signals, in which groups and radix, and where to look.
//!
//! Viewers drop a name that they do not find without a word, so every path is looked up in the netlist before a file
//! for one of them is written.

use std::io;

use super::selection::no_such;
use crate::netlist::Netlist;
use crate::units::Time;

/// How a signal's value is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Radix {
    /// Bits; also for scalars.
    #[default]
    Binary,
    /// Hexadecimal.
    Hex,
    /// Unsigned decimal.
    Decimal,
}

/// One line of the display.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// Dotted path of the signal below the top, such as `mp_r0_c0.p_counter.COUNT`.
    pub path: String,
    /// How to show it.
    pub radix: Radix,
    /// What GTKWave calls it instead of its own name. Surfer shows its own name.
    pub alias: Option<String>,
}

impl Entry {
    /// A signal in binary, or a scalar.
    pub fn binary(path: impl Into<String>) -> Self {
        Self::new(path, Radix::Binary)
    }

    /// A bus in hexadecimal.
    pub fn hex(path: impl Into<String>) -> Self {
        Self::new(path, Radix::Hex)
    }

    /// A bus in decimal.
    pub fn decimal(path: impl Into<String>) -> Self {
        Self::new(path, Radix::Decimal)
    }

    fn new(path: impl Into<String>, radix: Radix) -> Self {
        let path = path.into();
        Entry {
            path,
            radix,
            alias: None,
        }
    }

    /// The same under another name.
    #[must_use]
    pub fn named(self, alias: impl Into<String>) -> Self {
        Entry {
            alias: Some(alias.into()),
            ..self
        }
    }
}

/// Signals under a common title that can be folded away.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct SignalGroup {
    /// Title, one line.
    pub title: String,
    /// Signals from top to bottom.
    pub signals: Vec<Entry>,
}

impl SignalGroup {
    /// A group from its parts.
    pub fn new(title: impl Into<String>, signals: impl IntoIterator<Item = Entry>) -> Self {
        SignalGroup {
            title: title.into(),
            signals: signals.into_iter().collect(),
        }
    }
}

/// What a viewer shows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    /// Groups from top to bottom.
    pub groups: Vec<SignalGroup>,
    /// From when to when to look.
    pub zoom: (Time, Time),
    /// Where the marker stands.
    pub marker: Option<Time>,
    /// Further instants, marked with the letters from A on ([`mark`]); 26 at most are shown.
    pub marks: Vec<Mark>,
}

impl Layout {
    /// These groups, from when to when, and the marker; no further marks.
    pub fn new(groups: Vec<SignalGroup>, zoom: (Time, Time), marker: Time) -> Self {
        Layout {
            groups,
            zoom,
            marker: Some(marker),
            marks: Vec::new(),
        }
    }
}

/// A marked instant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mark {
    /// When it is.
    pub time: Time,
    /// What it is, one line, which GTKWave shows in the place of its letter. Empty: the letter alone.
    pub name: String,
}

impl Mark {
    /// A mark with a name.
    pub fn new(time: Time, name: impl Into<String>) -> Self {
        let name = name.into();
        Mark { time, name }
    }
}

/// Marks that a viewer has.
pub(super) const MARKS: usize = 26;

/// The letter of a mark, by its place among [`Layout::marks`].
pub fn mark(place: usize) -> char {
    debug_assert!(place < MARKS, "there are 26 letters");
    char::from(b'A' + place as u8)
}

/// What a viewer has to know of a signal.
pub(super) struct SignalShape {
    pub width: usize,
    pub is_bus: bool,
}

impl SignalShape {
    /// The shape of the signal at `path`.
    ///
    /// # Errors
    /// When `netlist` has none.
    pub(super) fn find(netlist: &Netlist, path: &str) -> io::Result<Self> {
        let (scope, name) = path.rsplit_once('.').unwrap_or(("", path));
        let signal = netlist
            .scope(scope)
            .and_then(|scope| netlist.scopes()[scope.index()].module.signal(name))
            .ok_or_else(|| no_such("signal", path, netlist))?;
        Ok(SignalShape {
            width: signal.width(),
            is_bus: signal.is_bus,
        })
    }

    /// Its range as GTKWave names it, if it is a bus. GTKWave shortens the range `[0:0]` when it reads the file.
    pub(super) fn range(&self) -> String {
        match (self.is_bus, self.width) {
            (false, _) => String::new(),
            (true, 1) => "[0]".to_owned(),
            (true, width) => format!("[{}:0]", width - 1),
        }
    }

    /// Characters of its longest value in `radix`.
    pub(super) fn digits(&self, radix: Radix) -> usize {
        match radix {
            Radix::Binary => self.width,
            Radix::Hex => self.width.div_ceil(4),
            Radix::Decimal => (self.width as f64 * libm::log10(2f64)).ceil() as usize,
        }
    }
}

/// Refuses what would break a file that is read by lines.
pub(super) fn one_line(text: &str) -> io::Result<()> {
    if text.contains(['\n', '\r', '"']) {
        let message = format!("{text:?} has a line break or a quote; take it out");
        return Err(io::Error::new(io::ErrorKind::InvalidInput, message));
    }
    Ok(())
}

/// Signals for the tests of what is written for viewers.
#[cfg(test)]
pub(super) mod sample {
    use super::*;
    use crate::netlist::{CellKind, ModuleBuilder};

    pub fn netlist() -> Netlist {
        let mut m = ModuleBuilder::new("leaf");
        let bits = m.input_bus("BITS", 2);
        let one = m.output_bus("ONE", 1);
        m.gate_into(CellKind::And2, &bits, one[0]);
        let leaf = m.finish().unwrap();
        let mut m = ModuleBuilder::new("top");
        let bits = m.input_bus("DATA", 2);
        let z = m.output("Z");
        m.instance("inner", &leaf, &[("BITS", &bits), ("ONE", &[z])]);
        Netlist::elaborate(&m.finish().unwrap())
    }

    pub fn layout(groups: Vec<SignalGroup>) -> Layout {
        Layout {
            groups,
            zoom: (Time::from_ns(1), Time::from_ns(3)),
            marker: Some(Time::from_ns(2)),
            marks: vec![
                Mark::new(Time::from_ns(1), "STOP"),
                Mark::new(Time::from_ps(2_500), ""),
            ],
        }
    }

    pub fn groups() -> Vec<SignalGroup> {
        vec![
            SignalGroup::new(
                "Inputs",
                [
                    Entry::hex("DATA"),
                    Entry::binary("inner.BITS").named("bits, bit 1 first"),
                ],
            ),
            SignalGroup::new("Results", [Entry::decimal("inner.ONE"), Entry::binary("Z")]),
        ]
    }
}
