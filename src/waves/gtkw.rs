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
/// Pixels beside the waves that are neither names nor tree: borders and a scroll bar, about 80, and
/// a little more so that the end of the interval is seen under any theme.
const BORDERS: u32 = 100;

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
    /// Those of `out`; and, before anything is written: a signal that `netlist` has not; a title or file name of several lines.
    pub fn write(&self, out: &mut dyn Write, netlist: &Netlist, vcd_name: &str) -> io::Result<()> {
        let text = self.text(netlist, vcd_name)?;
        out.write_all(&text)
    }

    fn text(&self, netlist: &Netlist, vcd_name: &str) -> io::Result<Vec<u8>> {
        one_line(vcd_name)?;
        let mut out = Vec::new();
        let version = env!("CARGO_PKG_VERSION");
        writeln!(out, "[*] {} {version}", env!("CARGO_PKG_NAME"))?;
        writeln!(out, "[dumpfile] \"{vcd_name}\"")?;
        // GTKWave looks for the dump from its own working folder, unless a name of the save file
        // (any name) tells it that the dump's is relative to where it found the save file.
        writeln!(out, "[savefile] \"save.gtkw\"")?;
        let start = self.zoom.0.max(Time::ZERO);
        writeln!(out, "[timestart] {}", start.as_fs())?;
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
        Ok(out)
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
    Ok(match (signal.is_bus, signal.width()) {
        (false, _) => format!("{top}.{path}"),
        // GTKWave shortens the range [0:0] when it reads the dump.
        (true, 1) => format!("{top}.{path}[0]"),
        (true, width) => format!("{top}.{path}[{}:0]", width - 1),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::netlist::{CellKind, ModuleBuilder};

    fn netlist() -> Netlist {
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

    fn save(groups: Vec<Group>) -> io::Result<String> {
        let file = SaveFile {
            groups,
            zoom: (Time::from_ns(1), Time::from_ns(3)),
            marker: Some(Time::from_ns(2)),
        };
        let mut text = Vec::new();
        file.write(&mut text, &netlist(), "x.vcd")?;
        Ok(String::from_utf8(text).unwrap())
    }

    #[test]
    fn a_save_file_is_exact() {
        let groups = vec![
            Group::new("Inputs", [Entry::hex("DATA"), Entry::binary("inner.BITS")]),
            Group::new("Results", [Entry::decimal("inner.ONE"), Entry::binary("Z")]),
        ];
        let expected = format!(
            "[*] guided-dtof {}\n{}{}\n{}",
            env!("CARGO_PKG_VERSION"),
            r#"[dumpfile] "x.vcd"
[savefile] "save.gtkw"
[timestart] 1000000
[size] 1600 900
[pos] -1 -1
*-18.566996 2000000"#,
            " -1".repeat(26),
            r#"[treeopen] top.
[treeopen] top.inner.
[sst_width] 220
[signals_width] 250
[sst_expanded] 1
@800200
-Inputs
@22
top.DATA[1:0]
@28
top.inner.BITS[1:0]
@1000200
-Inputs
@800200
-Results
@24
top.inner.ONE[0]
@28
top.Z
@1000200
-Results
"#
        );
        assert_eq!(save(groups).unwrap(), expected);
    }

    #[test]
    fn a_signal_that_is_not_there_is_named() {
        for path in ["inner.NONE", "outer.BITS", "top.Z", "DATA[1]", ""] {
            let error = save(vec![Group::new("", [Entry::hex(path)])]).unwrap_err();
            assert!(error.to_string().contains(&format!("`{path}`")), "{error}");
        }
    }

    #[test]
    fn a_title_is_one_line() {
        assert!(save(vec![Group::new("two\nlines", [])]).is_err());
    }
}
