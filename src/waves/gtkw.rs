//! Save files of GTKWave: which signals to show, in which groups and radix, and where to look.
//!
//! A save file names signals by dotted path, buses with their range. GTKWave drops a name it does
//! not find without a word, so every path is looked up in the netlist before it is written.
//!
//! GTKWave keeps the zoom as the negative binary logarithm of time units per 200 pixels, and the
//! width of the window in pixels apart from it: to show a given interval, both are written.
//! A signal's flags are a set of bits in hexadecimal; those used here are two for right-justified
//! text and radix, 0x200 for a line without a signal, and the beginning and end of a group.

use std::io::{self, Write};

use super::selection::no_such;
use crate::netlist::Netlist;
use crate::units::Time;

/// Size of the viewer's window, in pixels.
const WINDOW: (u32, u32) = (1600, 900);
/// Width of the column of names, in pixels.
const NAMES_WIDTH: u32 = 250;
/// Width of the hierarchy browser, in pixels.
const TREE_WIDTH: u32 = 220;
/// Pixels beside the waves that are neither names nor tree: borders, values and scroll bars.
const BORDERS: u32 = 60;

/// How a signal's value is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Radix {
    /// Bits; also for scalars.
    #[default]
    Binary,
    /// Hexadecimal.
    Hex,
    /// Unsigned decimal.
    Decimal,
}

impl Radix {
    /// GTKWave's flags: right-justified and the radix.
    const fn flags(self) -> &'static str {
        match self {
            Radix::Binary => "@28",
            Radix::Hex => "@22",
            Radix::Decimal => "@24",
        }
    }
}

/// One line of the display.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// Dotted path of the signal below the top, such as `mp_r0_c0.p_counter.COUNT`.
    pub path: String,
    /// How to show it.
    pub radix: Radix,
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
        Entry { path, radix }
    }
}

/// Signals under a common title that can be folded away.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Group {
    /// Title, one line.
    pub title: String,
    /// Signals from top to bottom.
    pub signals: Vec<Entry>,
}

impl Group {
    /// A group from its parts.
    pub fn new(title: impl Into<String>, signals: impl IntoIterator<Item = Entry>) -> Self {
        Group {
            title: title.into(),
            signals: signals.into_iter().collect(),
        }
    }
}

/// What GTKWave shows when it opens a dump.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SaveFile {
    /// Groups from top to bottom.
    pub groups: Vec<Group>,
    /// From when to when to look.
    pub zoom: (Time, Time),
    /// Where the red marker stands.
    pub marker: Option<Time>,
}

impl SaveFile {
    /// Writes the save file for the dump `vcd_name`, a file name relative to where the save file
    /// will be.
    ///
    /// # Errors
    /// Those of `out`; a signal that `netlist` has not; a title or file name of several lines.
    pub fn write(&self, out: &mut dyn Write, netlist: &Netlist, vcd_name: &str) -> io::Result<()> {
        one_line(vcd_name)?;
        let version = env!("CARGO_PKG_VERSION");
        writeln!(out, "[*] {} {version}", env!("CARGO_PKG_NAME"))?;
        writeln!(out, "[dumpfile] \"{vcd_name}\"")?;
        writeln!(out, "[timestart] {}", self.zoom.0.as_fs())?;
        writeln!(out, "[size] {} {}", WINDOW.0, WINDOW.1)?;
        writeln!(out, "[pos] -1 -1")?;
        let marker = self.marker.map_or(-1, Time::as_fs);
        // After the primary marker come the 26 lettered ones, all absent.
        let lettered = " -1".repeat(26);
        writeln!(out, "*{:.6} {marker}{lettered}", self.zoom_level())?;
        for scope in self.open_scopes(netlist) {
            writeln!(out, "[treeopen] {scope}.")?;
        }
        writeln!(out, "[sst_width] {TREE_WIDTH}")?;
        writeln!(out, "[signals_width] {NAMES_WIDTH}")?;
        writeln!(out, "[sst_expanded] 1")?;
        for group in &self.groups {
            one_line(&group.title)?;
            writeln!(out, "@800200\n-{}", group.title)?;
            for entry in &group.signals {
                let name = full_name(netlist, &entry.path)?;
                writeln!(out, "{}\n{name}", entry.radix.flags())?;
            }
            writeln!(out, "@1000200\n-{}", group.title)?;
        }
        Ok(())
    }

    /// GTKWave's measure of magnification for the interval to fill the window.
    fn zoom_level(&self) -> f64 {
        let span_fs = (self.zoom.1 - self.zoom.0).as_fs().max(1) as f64;
        let pixels = (WINDOW.0 - NAMES_WIDTH - TREE_WIDTH - BORDERS) as f64;
        -(span_fs * 200.0 / pixels).log2()
    }

    /// Every scope on the way to a signal, top first, each once.
    fn open_scopes(&self, netlist: &Netlist) -> Vec<String> {
        let top = &netlist.scopes()[0].name;
        let mut open = vec![top.clone()];
        for entry in self.groups.iter().flat_map(|g| &g.signals) {
            for (dot, _) in entry.path.match_indices('.') {
                let scope = format!("{top}.{}", &entry.path[..dot]);
                if !open.contains(&scope) {
                    open.push(scope);
                }
            }
        }
        open
    }
}

/// GTKWave's name of the signal at `path`.
fn full_name(netlist: &Netlist, path: &str) -> io::Result<String> {
    let (scope, name) = path.rsplit_once('.').unwrap_or(("", path));
    let signal = netlist
        .scope(scope)
        .and_then(|scope| netlist.scopes()[scope].module.signal(name))
        .ok_or_else(|| no_such("signal", path, netlist))?;
    let top = &netlist.scopes()[0].name;
    Ok(match signal.width() {
        _ if !signal.is_bus => format!("{top}.{path}"),
        width => format!("{top}.{path}[{}:0]", width - 1),
    })
}

/// Refuses what would break a file that is read by lines.
fn one_line(text: &str) -> io::Result<()> {
    if text.contains(['\n', '\r', '"']) {
        let message = format!("{text:?} has a line break or a quote; take it out");
        return Err(io::Error::new(io::ErrorKind::InvalidInput, message));
    }
    Ok(())
}
