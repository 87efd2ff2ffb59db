//! Value change dumps: an observer of the kernel that writes what every viewer reads.
//!
//! One instant of simulated time is written as a whole, when the next one begins. Changes within
//! it are only noted; then each net is compared with what the file last said of it. So a glitch
//! of zero width leaves no trace, a value is never repeated (a viewer would draw a repetition as
//! a toggle), a bus of which several bits change gets one line, and a time is written only if a
//! change follows it.
//!
//! ```text
//!   change(t, net, v) ─► nets[net].now = v, once on `changed`
//!   t advances ────────► changed ─► differs from nets[net].written? ─► "1!"  and every bus it
//!                                                                     is a bit of ─► "b0101 #"
//! ```
//!
//! The header goes through the `vcd` crate. The crate formats a change bit by bit, at a fifth of
//! the speed that bytes of our own reach; changes are most of a file, so they are written here.
//!
//! Traps: GTKWave refuses times beyond 2⁵³ units, which are 9 s of femtoseconds; it cannot read a
//! name with a colon, a bracket or a leading dollar (the netlist allows only identifiers, so none
//! can occur), nor a last line without a newline. The nets are taken to be unknown when the
//! writer is made: it must observe the simulation from its start.

use std::io::{self, Write};

use super::selection::Selection;
use super::vcd_header::{BLOCK, Bus, NO_SCALAR, ScalarLine, Variables, write_header};
use crate::kernel::Observer;
use crate::logic::Logic;
use crate::netlist::{NetId, Netlist};
use crate::units::Time;

/// Character of each value, indexed by [`Logic::bits`].
const CHARACTERS: [u8; 4] = *b"01xz";

/// What the writer knows of one net.
#[derive(Clone, Copy)]
struct NetState {
    /// Index into `scalars`, or [`NO_SCALAR`].
    scalar: u32,
    /// Present value, as a character.
    now: u8,
    /// The value that the file shows, as a character.
    written: u8,
    /// Already on the list of changed nets; or not shown at all, and never to be put there.
    is_settled: bool,
}

/// Writes a value change dump of a simulation that it observes.
///
/// Output is handed over in large blocks, so `out` needs no buffer of its own.
pub struct VcdWriter<W: Write> {
    out: W,
    error: Option<io::Error>,
    buffer: Vec<u8>,
    limit: Time,
    /// The instant whose changes are being collected.
    now: Time,
    /// The last time written.
    stamped: Time,
    nets: Vec<NetState>,
    changed: Vec<u32>,
    scalars: Vec<ScalarLine>,
    buses: Vec<Bus>,
    bus_bits: Vec<u32>,
    changed_buses: Vec<u32>,
    /// Buses of net `n`: `net_buses[net_buses_start[n]..net_buses_start[n + 1]]`.
    net_buses: Vec<u32>,
    net_buses_start: Vec<u32>,
}

impl<W: Write> VcdWriter<W> {
    /// Starts a dump of the selected signals at time 0, with every net unknown.
    ///
    /// # Errors
    /// Those of `out`, and a path in `selection` that does not exist.
    pub fn new(mut out: W, netlist: &Netlist, selection: &Selection) -> io::Result<Self> {
        let Variables {
            scalar_of_net,
            scalars,
            buses,
            bus_bits,
            ..
        } = write_header(&mut out, netlist, selection)?;
        let (net_buses_start, net_buses) = invert(netlist.net_count(), &buses, &bus_bits);
        let unknown = CHARACTERS[Logic::X as usize];
        let nets = scalar_of_net
            .iter()
            .zip(net_buses_start.windows(2))
            .map(|(&scalar, buses)| NetState {
                scalar,
                now: unknown,
                written: unknown,
                is_settled: scalar == NO_SCALAR && buses[0] == buses[1],
            })
            .collect();
        Ok(VcdWriter {
            out,
            error: None,
            buffer: Vec::with_capacity(2 * BLOCK),
            limit: Time::MAX,
            now: Time::ZERO,
            stamped: Time::ZERO,
            nets,
            changed: Vec::new(),
            scalars,
            buses,
            bus_bits,
            changed_buses: Vec::new(),
            net_buses,
            net_buses_start,
        })
    }

    /// Ignores every change after `limit`.
    pub fn limit(mut self, limit: Time) -> Self {
        self.limit = limit;
        self
    }

    /// Writes what is pending and marks the end of the simulation (or the limit, if that is
    /// earlier), so that viewers show the last values up to there.
    ///
    /// # Errors
    /// The first error of the underlying writer since the start; the file is then incomplete.
    pub fn finish(mut self, end: Time) -> io::Result<W> {
        self.write_instant();
        let end = end.min(self.limit);
        if end > self.stamped {
            self.stamp(end);
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

    /// Writes the changes of the instant that ends.
    fn write_instant(&mut self) {
        let changed = std::mem::take(&mut self.changed);
        for &net in &changed {
            let state = &mut self.nets[net as usize];
            state.is_settled = false;
            if state.now == state.written {
                continue;
            }
            state.written = state.now;
            let NetState { scalar, now, .. } = *state;
            if self.stamped != self.now {
                self.stamp(self.now);
            }
            if scalar != NO_SCALAR {
                let mut line = self.scalars[scalar as usize];
                line.bytes[0] = now;
                // Eight bytes at once and back to the true length: cheaper than a variable copy.
                let length = self.buffer.len() + line.length as usize;
                self.buffer.extend_from_slice(&line.bytes);
                self.buffer.truncate(length);
            }
            let buses = &self.net_buses_start[net as usize..][..2];
            for &index in &self.net_buses[buses[0] as usize..buses[1] as usize] {
                let bus = &mut self.buses[index as usize];
                if !bus.is_changed {
                    bus.is_changed = true;
                    self.changed_buses.push(index);
                }
            }
        }
        self.changed = changed;
        self.changed.clear();
        for &index in &self.changed_buses {
            let bus = &mut self.buses[index as usize];
            bus.is_changed = false;
            let bits = &self.bus_bits[bus.bits.clone()];
            self.buffer.push(b'b');
            self.buffer
                .extend(bits.iter().map(|&net| self.nets[net as usize].now));
            self.buffer.extend_from_slice(&bus.tail);
        }
        self.changed_buses.clear();
        if self.buffer.len() >= BLOCK {
            self.write_block();
        }
    }

    fn stamp(&mut self, time: Time) {
        self.stamped = time;
        self.buffer.push(b'#');
        push_decimal(&mut self.buffer, time.as_fs().unsigned_abs());
        self.buffer.push(b'\n');
    }

    /// Hands the buffer over. After an error the rest is dropped: the file is lost anyway.
    fn write_block(&mut self) {
        if self.error.is_none() {
            self.error = self.out.write_all(&self.buffer).err();
        }
        self.buffer.clear();
    }
}

impl<W: Write> Observer for VcdWriter<W> {
    #[inline]
    fn change(&mut self, time: Time, net: NetId, value: Logic) {
        if time > self.limit {
            return;
        }
        // A change in the past counts as one of the present: a file's times never go back.
        if time > self.now {
            self.write_instant();
            self.now = time;
        }
        let state = &mut self.nets[net.index()];
        state.now = CHARACTERS[value as usize];
        if !state.is_settled {
            state.is_settled = true;
            self.changed.push(net.index() as u32);
        }
    }
}

/// Appends `number` in decimal, without the formatting machinery.
#[inline]
fn push_decimal(buffer: &mut Vec<u8>, mut number: u64) {
    let mut digits = [0; 20];
    let mut start = digits.len();
    loop {
        start -= 1;
        digits[start] = b'0' + (number % 10) as u8;
        number /= 10;
        if number == 0 {
            break;
        }
    }
    buffer.extend_from_slice(&digits[start..]);
}

/// Lists for every net the buses that it is a bit of: start of each net's list, then the lists.
fn invert(net_count: usize, buses: &[Bus], bus_bits: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let mut start = vec![0u32; net_count + 1];
    for &net in bus_bits {
        start[net as usize + 1] += 1;
    }
    for i in 1..start.len() {
        start[i] += start[i - 1];
    }
    let mut next = start.clone();
    let mut lists = vec![0; bus_bits.len()];
    for (index, bus) in buses.iter().enumerate() {
        for &net in &bus_bits[bus.bits.clone()] {
            let at = &mut next[net as usize];
            lists[*at as usize] = index as u32;
            *at += 1;
        }
    }
    (start, lists)
}

#[cfg(test)]
mod tests {
    use super::*;
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

    fn writer(selection: Selection) -> VcdWriter<Vec<u8>> {
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
        let text = writer(Selection::all()).finish(Time::ZERO).unwrap();
        let expected = format!(
            "$version\n    guided-dtof {}\n$end\n{}",
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
x#
x$
x%
bxx "
$end
"#
        );
        assert_eq!(String::from_utf8(text).unwrap(), expected);
    }

    #[test]
    fn a_selection_keeps_paths() {
        let text = writer(Selection::all().below("second"));
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
        let named = lines(Selection::all());
        assert_eq!(lines(Selection::all().with_anonymous()), named + 1);
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
            body(writer(Selection::all()), changes),
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
        assert_eq!(body(writer(Selection::all()), changes), "#8\n0!\n#100\n");
    }

    #[test]
    fn changes_of_nets_not_selected_cost_no_line() {
        let changes = [(5, "A", One), (6, "Z[1]", One)];
        let only = writer(Selection::all().below("second"));
        assert_eq!(body(only, changes), "#6\n1\"\n#100\n");
    }

    #[test]
    fn a_limit_ends_the_file_there() {
        let changes = [(5, "A", One), (50, "A", Zero), (51, "A", One)];
        let limited = writer(Selection::all()).limit(Time::from_fs(50));
        assert_eq!(body(limited, changes), "#5\n1!\n#50\n0!\n");
        let limited = writer(Selection::all()).limit(Time::from_fs(49));
        assert_eq!(body(limited, changes), "#5\n1!\n#49\n");
    }

    #[test]
    fn time_never_goes_back() {
        let changes = [(5, "A", One), (3, "A", Zero), (3, "Z[0]", One)];
        assert_eq!(
            body(writer(Selection::all()), changes),
            "#5\n0!\n1#\nbx1 \"\n#100\n"
        );
    }

    #[test]
    fn the_first_error_is_kept_for_the_end() {
        /// Takes so many bytes and then is full.
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
        assert!(VcdWriter::new(Disk(10), &netlist, &Selection::all()).is_err());
        let mut writer = VcdWriter::new(Disk(10_000), &netlist, &Selection::all()).unwrap();
        let a = netlist.net("A").unwrap();
        for fs in 1..100_000 {
            writer.change(Time::from_fs(fs), a, Logic::from(fs % 2 == 0));
        }
        let error = writer.finish(Time::from_fs(100_000)).err().unwrap();
        assert_eq!(error.to_string(), "disk full");
    }

    #[test]
    fn decimals_are_those_of_the_standard_library() {
        let numbers = [0, 9, 10, 99, 100, 1 << 53, u64::MAX];
        for number in numbers {
            let mut text = Vec::new();
            push_decimal(&mut text, number);
            assert_eq!(text, number.to_string().as_bytes());
        }
    }
}
