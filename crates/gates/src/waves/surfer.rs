//! Command files of Surfer: what one would type to lay the signals out.
//!
//! Surfer reads them with `--command-file`, when it has loaded the waveform that is named beside. The commands are those
//! of versions 0.4 and later.
//!
//! Traps: Surfer parses all lines before it carries out the first, so an item is named by its place in the list, in
//! letters (`a` is 0, `p` is 15), never by what was added. The name of a divider is one word of letters, digits and
//! underscores. There is no command for a zoom: each `zoom_in` halves what is seen, at first everything from time 0
//! to the end of the file, and `cursor_set` centres what is not seen yet.

use std::io::{self, Write};

use super::layout::{Layout, MARKS, Radix, SignalShape, mark, one_line};
use crate::netlist::Netlist;
use crate::units::Time;

impl Radix {
    /// Surfer's name of the format.
    const fn surfer(self) -> &'static str {
        match self {
            Radix::Binary => "Binary",
            Radix::Hex => "Hexadecimal",
            Radix::Decimal => "Unsigned",
        }
    }
}

impl Layout {
    /// Writes the command file for the waveform `file`, which ends at `end`.
    ///
    /// # Errors
    /// Those of `out`; and, before anything is written: a signal that `netlist` has not; a file name of several lines.
    pub fn write_surfer(
        &self,
        out: &mut dyn Write,
        netlist: &Netlist,
        file: &str,
        end: Time,
    ) -> io::Result<()> {
        let text = self.surfer(netlist, file, end)?;
        out.write_all(&text)
    }

    /// What command files written here begin with.
    pub const SURFER_SIGNATURE: &str = "# surfer --command-file THIS_FILE";

    fn surfer(&self, netlist: &Netlist, file: &str, end: Time) -> io::Result<Vec<u8>> {
        one_line(file)?;
        let top = &netlist.scopes()[0].name;
        let mut out = Vec::new();
        writeln!(out, "{} {file}", Self::SURFER_SIGNATURE)?;
        let mut items = 0;
        for group in &self.groups {
            writeln!(out, "divider_add {}", one_word(&group.title))?;
            items += 1;
            for entry in &group.signals {
                let shape = SignalShape::find(netlist, &entry.path)?;
                writeln!(out, "variable_add {top}.{}", entry.path)?;
                if shape.width > 1 {
                    writeln!(out, "item_focus {}_", letters(items))?;
                    writeln!(out, "item_set_format {}", entry.radix.surfer())?;
                }
                items += 1;
            }
        }
        writeln!(out, "item_unfocus")?;
        let (from, until) = self.zoom;
        let span_fs = (until - from).as_fs().max(1);
        let mut seen_fs = end.as_fs();
        while seen_fs / 2 >= span_fs {
            writeln!(out, "zoom_in")?;
            seen_fs /= 2;
        }
        // What is seen already would not be centred.
        writeln!(out, "goto_start")?;
        let middle_fs = from.as_fs() + span_fs / 2;
        writeln!(out, "cursor_set {}", middle_fs.max(0))?;
        if let Some(marker) = self.marker {
            writeln!(out, "cursor_set {}", marker.as_fs())?;
        }
        for (place, named) in self.marks.iter().take(MARKS).enumerate() {
            writeln!(out, "marker_set {} {}", mark(place), named.time.as_fs())?;
        }
        Ok(out)
    }
}

/// A title as a divider may have it.
fn one_word(title: &str) -> String {
    let parts = title.split(|c: char| !c.is_ascii_alphanumeric());
    let words: Vec<&str> = parts.filter(|part| !part.is_empty()).collect();
    if words.is_empty() {
        "_".to_owned()
    } else {
        words.join("_")
    }
}

/// Surfer's name of the item at this place: its hexadecimal digits as letters from `a` on.
fn letters(place: usize) -> String {
    format!("{place:x}")
        .chars()
        .map(|digit| (b'a' + digit.to_digit(16).expect("a digit") as u8) as char)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::layout::sample::{groups, layout, netlist};
    use super::super::layout::{Entry, SignalGroup};
    use super::*;

    fn commands(groups: Vec<SignalGroup>) -> io::Result<String> {
        let mut text = Vec::new();
        layout(groups).write_surfer(&mut text, &netlist(), "x.fst", Time::from_ns(17))?;
        Ok(String::from_utf8(text).unwrap())
    }

    #[test]
    fn a_command_file_is_exact() {
        let expected = "\
# surfer --command-file THIS_FILE x.fst
divider_add Inputs
variable_add top.DATA
item_focus b_
item_set_format Hexadecimal
variable_add top.inner.BITS
item_focus c_
item_set_format Binary
divider_add Results
variable_add top.inner.ONE
variable_add top.Z
item_unfocus
zoom_in
zoom_in
zoom_in
goto_start
cursor_set 2000000
cursor_set 2000000
marker_set A 1000000
marker_set B 2500000
";
        assert_eq!(commands(groups()).unwrap(), expected);
    }

    #[test]
    fn a_signal_that_is_not_there_is_named() {
        let error = commands(vec![SignalGroup::new("", [Entry::hex("outer.BITS")])]).unwrap_err();
        assert!(error.to_string().contains("`outer.BITS`"), "{error}");
    }

    #[test]
    fn titles_and_places_are_words() {
        assert_eq!(one_word("counter r3_c1 (Fig. 54)"), "counter_r3_c1_Fig_54");
        assert_eq!(one_word("(…)"), "_");
        assert_eq!(
            [0, 9, 15, 16, 0x1af].map(letters),
            ["a", "j", "p", "ba", "bkp"]
        );
    }
}
