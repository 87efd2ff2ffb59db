//! Value change dumps: the format that every viewer reads.
//!
//! The header goes through the `vcd` crate. The crate formats a change bit by bit, at a fifth of
//! the speed that bytes of our own reach; changes are most of a file, so they are written here.
//!
//! Traps: GTKWave refuses times beyond 2⁵³ units, which are 9 s of femtoseconds; it cannot read a
//! name with a colon, a bracket or a leading dollar (the netlist allows only identifiers, so none
//! can occur), nor a last line without a newline.

use std::io::{self, BufWriter, Write};

use vcd::{IdCode, ReferenceIndex, TimescaleUnit, VarType};

use self::text::{BLOCK, Block, Stamp};
use super::selection::WaveSelection;
use super::variables::{Declaration, Declare, Variables};
use super::writer::{Format, WaveWriter};
use crate::Origin;
use crate::netlist::Netlist;
use crate::units::Time;

mod text;

/// Writes a value change dump of a simulation that it observes.
///
/// Output is handed over in large blocks, so `out` needs no buffer of its own.
pub type VcdWriter<W> = WaveWriter<Vcd<W>>;

impl<W: Write> VcdWriter<W> {
    /// Starts a dump of the selected signals, with every net unknown.
    ///
    /// # Errors
    /// Those of `out`, and a path in `selection` that does not exist.
    pub fn new(out: W, netlist: &Netlist, selection: &WaveSelection) -> io::Result<Self> {
        Self::with_origin(out, netlist, selection, Origin::default())
    }

    /// The same, with another program named as the file's writer.
    ///
    /// # Errors
    /// As [`VcdWriter::new`].
    pub fn with_origin(
        mut out: W,
        netlist: &Netlist,
        selection: &WaveSelection,
        origin: Origin,
    ) -> io::Result<Self> {
        let (variables, lines) = write_header(&mut out, netlist, selection, origin)?;
        let vcd = Vcd {
            out,
            error: None,
            block: Block::new(),
            lines,
            stamp: Stamp::new(),
        };
        Ok(WaveWriter::from_variables(vcd, netlist, variables))
    }
}

/// Writes everything before the first change, and returns what got which identifier code.
fn write_header(
    out: &mut impl Write,
    netlist: &Netlist,
    selection: &WaveSelection,
    origin: Origin,
) -> io::Result<(Variables, Vec<Line>)> {
    let mut header = Header {
        out: vcd::Writer::new(BufWriter::with_capacity(BLOCK, out)),
        lines: Vec::new(),
    };
    header.out.version(&origin.vendor_and_version())?;
    header.out.timescale(1, TimescaleUnit::FS)?;
    let variables = Variables::declare(netlist, selection, &mut header)?;
    header.out.enddefinitions()?;
    header.out.flush()?;
    Ok((variables, header.lines))
}

/// The format: what [`VcdWriter`] writes.
pub struct Vcd<W> {
    out: W,
    error: Option<io::Error>,
    block: Block,
    lines: Vec<Line>,
    stamp: Stamp,
}

/// The end of a variable's lines: one character, which is the value of a scalar or the space behind those of a
/// bus, identifier code, newline.
#[derive(Clone, Copy)]
struct Line {
    bytes: [u8; 8],
    length: u8,
}

impl Line {
    fn new(code: IdCode) -> Self {
        let text = format!(" {code}\n");
        // 94⁵ codes, more than there can be nets, have at most five characters.
        assert!(text.len() <= 8, "identifier code too long");
        let mut bytes = [0; 8];
        bytes[..text.len()].copy_from_slice(text.as_bytes());
        let length = text.len() as u8;
        Line { bytes, length }
    }
}

struct Header<W: Write> {
    out: vcd::Writer<W>,
    lines: Vec<Line>,
}

impl<W: Write> Declare for Header<W> {
    fn scope(&mut self, name: &str) -> io::Result<()> {
        self.out.add_module(name)
    }

    fn up_scope(&mut self) -> io::Result<()> {
        self.out.upscope()
    }

    fn signal(&mut self, signal: &Declaration<'_>) -> io::Result<()> {
        let code = IdCode::from(signal.variable);
        if !signal.is_alias {
            self.lines.push(Line::new(code));
        }
        let range = ReferenceIndex::Range(signal.width as i32 - 1, 0);
        let range = signal.is_bus.then_some(range);
        let (wire, name) = (VarType::Wire, signal.name);
        self.out.var_def(wire, signal.width, code, name, range)
    }
}

impl<W: Write> Vcd<W> {
    /// Hands the block over. After an error the rest is dropped: the file is lost anyway.
    fn write_block(&mut self) {
        if self.error.is_none() {
            self.error = self.out.write_all(self.block.text()).err();
        }
        self.block.clear();
    }
}

impl<W: Write> Format for Vcd<W> {
    type Out = W;

    fn begin(&mut self, time: Time) {
        self.time(time);
        self.block.push(b"$dumpvars\n");
    }

    fn begun(&mut self) {
        self.block.push(b"$end\n");
    }

    #[inline]
    fn time(&mut self, time: Time) {
        self.stamp.write(time, &mut self.block);
    }

    #[inline]
    fn scalar(&mut self, variable: u32, value: u8) {
        let line = &self.lines[variable as usize];
        let start = self.block.end();
        self.block.push_part(&line.bytes, line.length.into());
        self.block.replace(start, value);
    }

    #[inline]
    fn bus(&mut self, variable: u32, values: &[u8]) {
        self.block.push_part(b"b", 1);
        self.block.push(values);
        let line = &self.lines[variable as usize];
        self.block.push_part(&line.bytes, line.length.into());
    }

    #[inline]
    fn end_instant(&mut self) {
        if self.block.end() >= BLOCK {
            self.write_block();
        }
    }

    fn finish(mut self, end: Time) -> io::Result<W> {
        if end > self.stamp.time() {
            self.time(end);
        }
        self.write_block();
        match self.error {
            Some(error) => Err(error),
            None => {
                self.out.flush()?;
                Ok(self.out)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Observer;
    use crate::logic::Logic;
    use crate::netlist::{CellKind, ModuleBuilder};

    /// Two inverters in a row below a top with a bus of both outputs, and one anonymous net.
    fn pair() -> Netlist {
        let mut m = ModuleBuilder::new("leaf");
        let (a, z) = (m.input("A"), m.output("Z"));
        m.cell("inv", CellKind::Inv, &[a], &[z]);
        let leaf = m.finish().unwrap();
        let mut m = ModuleBuilder::new("viewer");
        let bits = m.input_bus("BITS", 2);
        let one = m.output_bus("ONE", 1);
        m.gate_into(CellKind::And2, &bits, one[0]);
        let viewer = m.finish().unwrap();
        let mut m = ModuleBuilder::new("pair");
        let (a, z) = (m.input("A"), m.output_bus("Z", 2));
        m.instance("first", &leaf, &[("A", &[a]), ("Z", &z[..1])]);
        m.instance("second", &leaf, &[("A", &z[..1]), ("Z", &z[1..])]);
        m.instance("viewer", &viewer, &[("BITS", &z)]);
        m.gate(CellKind::Inv, &[a]);
        Netlist::elaborate(&m.finish().unwrap())
    }

    fn writer(selection: WaveSelection) -> VcdWriter<Vec<u8>> {
        VcdWriter::new(Vec::new(), &pair(), &selection).unwrap()
    }

    /// What `changes` (femtoseconds, net, value) add after the header, up to time 100.
    fn body(
        mut writer: VcdWriter<Vec<u8>>,
        changes: impl IntoIterator<Item = (i64, &'static str, Logic)>,
    ) -> String {
        let netlist = pair();
        for (fs, net, value) in changes {
            writer.change(Time::from_fs(fs), netlist.net(net).unwrap(), value);
        }
        let text = String::from_utf8(writer.finish(Time::from_fs(100)).unwrap()).unwrap();
        let (_, body) = text.rsplit_once("$end\n").unwrap();
        body.to_owned()
    }

    use Logic::{One, X, Z, Zero};

    #[test]
    fn the_header_is_exact() {
        let text = writer(WaveSelection::all()).finish(Time::ZERO).unwrap();
        let expected = format!(
            "$version\n    femtogate {}\n$end\n{}",
            env!("CARGO_PKG_VERSION"),
            r#"$timescale 1 fs $end
$scope module pair $end
$var wire 1 ! A $end
$var wire 2 " Z [1:0] $end
$scope module first $end
$var wire 1 ! A $end
$var wire 1 # Z $end
$upscope $end
$scope module second $end
$var wire 1 # A $end
$var wire 1 $ Z $end
$upscope $end
$scope module viewer $end
$var wire 2 " BITS [1:0] $end
$var wire 1 % ONE [0:0] $end
$upscope $end
$upscope $end
$enddefinitions $end
#0
$dumpvars
x!
bxx "
x#
x$
x%
$end
"#
        );
        assert_eq!(String::from_utf8(text).unwrap(), expected);
    }

    #[test]
    fn a_selection_keeps_paths() {
        let text = writer(WaveSelection::all().with_scope("second"));
        let text = String::from_utf8(text.finish(Time::ZERO).unwrap()).unwrap();
        let expected = "$scope module pair $end
$scope module second $end
$var wire 1 ! A $end
$var wire 1 \" Z $end
$upscope $end
$upscope $end
";
        assert!(text.contains(expected), "{text}");
    }

    #[test]
    fn anonymous_nets_come_on_request() {
        let lines = |selection| {
            let text = writer(selection).finish(Time::ZERO).unwrap();
            text.split(|&b| b == b'\n')
                .filter(|line| line.starts_with(b"$var"))
                .count()
        };
        let named = lines(WaveSelection::all());
        assert_eq!(lines(WaveSelection::all().with_anonymous()), named + 1);
    }

    #[test]
    fn an_instant_is_written_once_and_whole() {
        let changes = [
            (0, "A", Zero),
            (7, "Z[0]", One),
            (7, "Z[1]", Zero),
            (7, "Z[1]", Z),
            (9, "A", One),
        ];
        assert_eq!(
            body(writer(WaveSelection::all()), changes),
            "0!\n#7\n1#\nz$\nbz1 \"\n#9\n1!\n#100\n"
        );
    }

    #[test]
    fn glitches_of_zero_width_leave_no_trace() {
        let changes = [
            (5, "A", One),
            (5, "A", X),
            (6, "Z[0]", One),
            (6, "Z[0]", X),
            (8, "A", Zero),
            (8, "Z[1]", Zero),
            (8, "Z[1]", X),
        ];
        assert_eq!(
            body(writer(WaveSelection::all()), changes),
            "#8\n0!\n#100\n"
        );
    }

    #[test]
    fn changes_of_nets_not_selected_cost_no_line() {
        let changes = [(5, "A", One), (6, "Z[1]", One)];
        let only = writer(WaveSelection::all().with_scope("second"));
        assert_eq!(body(only, changes), "#6\n1\"\n#100\n");
    }

    #[test]
    fn a_limit_ends_the_file_there() {
        let changes = [(5, "A", One), (50, "A", Zero), (51, "A", One)];
        let until = |fs| Time::ZERO..=Time::from_fs(fs);
        let limited = writer(WaveSelection::all()).keep(until(50));
        assert_eq!(body(limited, changes), "#5\n1!\n#50\n0!\n");
        let limited = writer(WaveSelection::all()).keep(until(49));
        assert_eq!(body(limited, changes), "#5\n1!\n#49\n");
    }

    #[test]
    fn a_kept_span_begins_with_the_values_there() {
        let span = |from, until| {
            let span = Time::from_fs(from)..=Time::from_fs(until);
            let mut writer = writer(WaveSelection::all()).keep(span);
            let netlist = pair();
            for (fs, net, value) in [
                (0, "A", Zero),
                (5, "Z[0]", One),
                (8, "A", X),
                (8, "A", One),
                (20, "A", Zero),
                (20, "Z[0]", Zero),
                (30, "Z[1]", One),
            ] {
                writer.change(Time::from_fs(fs), netlist.net(net).unwrap(), value);
            }
            let text = String::from_utf8(writer.finish(Time::from_fs(100)).unwrap()).unwrap();
            let (_, body) = text.split_once("$enddefinitions $end\n").unwrap();
            body.replace('\n', " ")
        };
        let values = |a: char, z: &str, rest: &str| {
            format!(
                "$dumpvars {a}! b{z} \" {}# {}$ x% $end {rest}",
                &z[1..],
                &z[..1]
            )
        };
        // Between two instants.
        let changes = "#20 0! 0# bx0 \" #25 ";
        assert_eq!(span(10, 25), format!("#10 {}", values('1', "x1", changes)));
        // At an instant: what changes in it does so after the first values.
        let changes = "0! 0# bx0 \" #30 1$ b10 \" #100 ";
        assert_eq!(span(20, 900), format!("#20 {}", values('1', "x1", changes)));
        // After the last change, and after the end.
        assert_eq!(span(40, 50), format!("#40 {}", values('0', "10", "#50 ")));
        assert_eq!(span(400, 500), format!("#100 {}", values('0', "10", "")));
    }

    #[test]
    fn time_never_goes_back() {
        let changes = [(5, "A", One), (3, "A", Zero), (3, "Z[0]", One)];
        assert_eq!(
            body(writer(WaveSelection::all()), changes),
            "#5\n0!\n1#\nbx1 \"\n#100\n"
        );
    }

    #[test]
    fn the_first_error_is_kept_for_the_end() {
        /// Takes this number of bytes and then is full.
        struct Disk(usize);
        impl Write for Disk {
            fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
                if self.0 < bytes.len() {
                    return Err(io::Error::other("disk full"));
                }
                self.0 -= bytes.len();
                Ok(bytes.len())
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let netlist = pair();
        assert!(VcdWriter::new(Disk(10), &netlist, &WaveSelection::all()).is_err());
        let mut writer = VcdWriter::new(Disk(10_000), &netlist, &WaveSelection::all()).unwrap();
        let a = netlist.net("A").unwrap();
        for fs in 1..100_000 {
            writer.change(Time::from_fs(fs), a, Logic::from(fs % 2 == 0));
        }
        let error = writer.finish(Time::from_fs(100_000)).err().unwrap();
        assert_eq!(error.to_string(), "disk full");
    }
}
