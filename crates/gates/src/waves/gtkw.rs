//! Save files of GTKWave.
//!
//! A save file names signals by dotted path, buses with their range.
//!
//! GTKWave keeps the zoom as the negative binary logarithm of time units per 200 pixels, and the
//! width of the window in pixels apart from it: to show a given interval, both are written. The column of names
//! is made wide enough for the longest name and, beside it, the longest value, which GTKWave cuts off otherwise.
//! A signal's flags are a set of bits in hexadecimal; those used here are two for right-justified
//! text and radix, 0x200 for a line without a signal, and the beginning and end of a group.

use std::io::{self, Write};

use super::layout::{Layout, MARKS, Radix, SignalShape, mark, one_line};
use crate::Origin;
use crate::netlist::Netlist;
use crate::units::Time;

/// Size of the viewer's window, in pixels.
const WINDOW: (usize, usize) = (1600, 900);
/// Width of the hierarchy browser, in pixels.
const TREE_WIDTH: usize = 220;
/// Width of a character in the column of names, in pixels: 7.7 on a screenshot of GTKWave 3.3.118.
const CHARACTER: usize = 8;
/// Pixels of the column of names that are neither name nor value.
const NAMES_MARGIN: usize = 24;
/// Pixels beside the waves that are neither names nor tree: borders and a scroll bar, about 80, and
/// a little more so that the end of the interval is seen under any theme.
const BORDERS: usize = 100;

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

impl Layout {
    /// Writes the save file for the waveform `file`, a file name relative to where the save file
    /// will be. `origin` is the program that it names as its writer.
    ///
    /// # Errors
    /// Those of `out`; and, before anything is written: a signal that `netlist` has not; a title or file name of several lines.
    pub fn write_gtkw(
        &self,
        out: &mut dyn Write,
        netlist: &Netlist,
        file: &str,
        origin: Origin,
    ) -> io::Result<()> {
        let text = self.gtkw(netlist, file, origin)?;
        out.write_all(&text)
    }

    /// What save files of this origin begin with. Those that GTKWave writes begin otherwise.
    pub fn gtkw_signature(origin: Origin) -> String {
        format!("[*] {}", origin.vendor)
    }

    fn gtkw(&self, netlist: &Netlist, file: &str, origin: Origin) -> io::Result<Vec<u8>> {
        one_line(file)?;
        let names_width = self.names_width(netlist)?;
        let top = &netlist.scopes()[0].name;
        let mut out = Vec::new();
        writeln!(out, "{} {}", Self::gtkw_signature(origin), origin.version)?;
        writeln!(out, "[dumpfile] \"{file}\"")?;
        // GTKWave looks for the dump from its own working folder, unless a name of the save file
        // (any name) tells it that the dump's is relative to where it found the save file.
        writeln!(out, "[savefile] \"save.gtkw\"")?;
        let start = self.zoom.0.max(Time::ZERO);
        writeln!(out, "[timestart] {}", start.as_fs())?;
        writeln!(out, "[size] {} {}", WINDOW.0, WINDOW.1)?;
        writeln!(out, "[pos] -1 -1")?;
        let marker = self.marker.map_or(-1, Time::as_fs);
        // After the primary marker come the lettered ones.
        let marks = self.marks.iter().map(|mark| mark.time.as_fs());
        let lettered = marks.chain(std::iter::repeat(-1)).take(MARKS);
        let lettered: String = lettered.map(|fs| format!(" {fs}")).collect();
        let zoom = self.zoom_level(names_width);
        writeln!(out, "*{zoom:.6} {marker}{lettered}")?;
        for (place, named) in self.marks.iter().take(MARKS).enumerate() {
            one_line(&named.name)?;
            if !named.name.is_empty() {
                writeln!(out, "[markername] {}{}", mark(place), named.name)?;
            }
        }
        for scope in self.open_scopes(top) {
            writeln!(out, "[treeopen] {scope}.")?;
        }
        writeln!(out, "[sst_width] {TREE_WIDTH}")?;
        writeln!(out, "[signals_width] {names_width}")?;
        writeln!(out, "[sst_expanded] 1")?;
        for group in &self.groups {
            one_line(&group.title)?;
            writeln!(out, "@800200\n-{}", group.title)?;
            for entry in &group.signals {
                let range = SignalShape::find(netlist, &entry.path)?.range();
                let flags = entry.radix.flags();
                writeln!(out, "{flags}")?;
                if let Some(alias) = &entry.alias {
                    one_line(alias)?;
                    write!(out, "+{{{alias}}} ")?;
                }
                writeln!(out, "{top}.{}{range}", entry.path)?;
            }
            writeln!(out, "@1000200\n-{}", group.title)?;
        }
        Ok(out)
    }

    /// Width of the column of names, in pixels: the longest name or title, and beside it `=` and the longest value.
    fn names_width(&self, netlist: &Netlist) -> io::Result<usize> {
        let (mut name, mut value) = (0, 0);
        for group in &self.groups {
            // A brace and a space mark a group.
            name = name.max(group.title.chars().count() + 2);
            for entry in &group.signals {
                let shape = SignalShape::find(netlist, &entry.path)?;
                let last = entry.path.rsplit('.').next().unwrap_or_default();
                let own = last.len() + shape.range().len();
                let alias = entry.alias.as_ref().map(|alias| alias.chars().count());
                name = name.max(alias.unwrap_or(own));
                value = value.max(shape.digits(entry.radix));
            }
        }
        Ok(CHARACTER * (name + 1 + value) + NAMES_MARGIN)
    }

    /// GTKWave's measure of magnification for the interval to fill the window.
    fn zoom_level(&self, names_width: usize) -> f64 {
        let span_fs = (self.zoom.1 - self.zoom.0).as_fs().max(1) as f64;
        let pixels = WINDOW.0.saturating_sub(names_width + TREE_WIDTH + BORDERS);
        -libm::log2(span_fs * 200.0 / pixels.max(200) as f64)
    }

    /// Every scope on the way to a signal, top first, each once.
    fn open_scopes(&self, top: &str) -> Vec<String> {
        let mut open = vec![top.to_owned()];
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

#[cfg(test)]
mod tests {
    use super::super::layout::sample::{groups, layout, netlist};
    use super::super::layout::{Entry, SignalGroup};
    use super::*;

    fn save(groups: Vec<SignalGroup>) -> io::Result<String> {
        let mut text = Vec::new();
        layout(groups).write_gtkw(&mut text, &netlist(), "x.vcd", Origin::default())?;
        Ok(String::from_utf8(text).unwrap())
    }

    #[test]
    fn a_save_file_is_exact() {
        let expected = format!(
            "[*] femtogate {}\n{}{}\n{}",
            env!("CARGO_PKG_VERSION"),
            r#"[dumpfile] "x.vcd"
[savefile] "save.gtkw"
[timestart] 1000000
[size] 1600 900
[pos] -1 -1
*-18.477393 2000000 1000000 2500000"#,
            " -1".repeat(24),
            r#"[markername] ASTOP
[treeopen] top.
[treeopen] top.inner.
[sst_width] 220
[signals_width] 184
[sst_expanded] 1
@800200
-Inputs
@22
top.DATA[1:0]
@28
+{bits, bit 1 first} top.inner.BITS[1:0]
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
        assert_eq!(save(groups()).unwrap(), expected);
    }

    #[test]
    fn a_signal_that_is_not_there_is_named() {
        for path in ["inner.NONE", "outer.BITS", "top.Z", "DATA[1]", ""] {
            let error = save(vec![SignalGroup::new("", [Entry::hex(path)])]).unwrap_err();
            assert!(error.to_string().contains(&format!("`{path}`")), "{error}");
        }
    }

    #[test]
    fn a_title_is_one_line() {
        assert!(save(vec![SignalGroup::new("two\nlines", [])]).is_err());
    }
}
