//! FST: GTKWave's compressed waveforms, a few bytes a change. Surfer reads them, too.
//!
//! Bytes go through the `fst-writer` crate. It collects changes by variable and compresses them in blocks; a block is
//! given to the file when its changes fill [`BLOCK`]. The same signals and changes are in it as in the VCD, and no date.
//!
//! Traps: the crate panics at a change that follows a `flush` before time has advanced, so blocks end just before a
//! new time. It takes a file's first values from the changes before the first time, and only if a time follows:
//! there is always one, a femtosecond on if need be. It lets every file begin at time 0; where a span is
//! kept, the two fields that say so are set to the span's first instant when the file is complete.

use std::io::{self, Read, Seek, SeekFrom, Write};

use fst_writer::{
    FstBodyWriter, FstFileType, FstHeaderWriter, FstInfo, FstScopeType, FstSignalId, FstSignalType,
    FstVarDirection, FstVarType, FstWriteError,
};

use super::selection::WaveSelection;
use super::variables::{Declaration, Declare, Variables};
use super::writer::{Format, WaveWriter};
use crate::Origin;
use crate::netlist::Netlist;
use crate::units::Time;

/// Bytes of collected changes that make a block.
const BLOCK: usize = 1 << 20;

/// Writes an FST file of a simulation that it observes.
pub type FstWriter<W> = WaveWriter<Fst<W>>;

impl<W: Read + Write + Seek> FstWriter<W> {
    /// Starts a file of the selected signals at the beginning of `out`, with every net unknown.
    ///
    /// # Errors
    /// Those of `out`, and a path in `selection` that does not exist.
    ///
    /// # Example
    ///
    /// ```
    /// use std::io::Cursor;
    ///
    /// use femtogate::kernel::{Drive, Kernel, Stimulus};
    /// use femtogate::netlist::{CellKind, Corner, Library, ModuleBuilder, Netlist, Timing};
    /// use femtogate::units::Time;
    /// use femtogate::waves::{FstWriter, WaveSelection};
    ///
    /// let mut m = ModuleBuilder::new("top");
    /// let (a, z) = (m.input("A"), m.output("Z"));
    /// m.cell("inverter", CellKind::Inv, &[a], &[z]);
    /// let netlist = Netlist::elaborate(&m.finish()?);
    /// let a = netlist.net("A").unwrap();
    /// let timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
    /// let file = Cursor::new(Vec::new()); // or a `File` that can be read, too
    /// let mut waves = FstWriter::new(file, &netlist, &WaveSelection::all())?;
    /// let mut kernel = Kernel::new(&netlist, &timing);
    /// let mut stimulus = Stimulus::new([Drive::new(Time::from_ns(1), a, true)]);
    /// kernel.run(&mut stimulus, Time::from_ns(2), &mut waves)?;
    /// let bytes = waves.finish(kernel.now())?.into_inner();
    /// assert_eq!(bytes[..9], [0, 0, 0, 0, 0, 0, 0, 1, 73]); // a header of 329 bytes
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn new(out: W, netlist: &Netlist, selection: &WaveSelection) -> io::Result<Self> {
        Self::with_origin(out, netlist, selection, Origin::default())
    }

    /// The same, with another program named as the file's writer.
    ///
    /// # Errors
    /// As [`FstWriter::new`].
    pub fn with_origin(
        out: W,
        netlist: &Netlist,
        selection: &WaveSelection,
        origin: Origin,
    ) -> io::Result<Self> {
        let info = FstInfo {
            start_time: 0,
            timescale_exponent: -15,
            version: origin.vendor_and_version(),
            date: String::new(),
            file_type: FstFileType::Verilog,
        };
        let mut header = Header {
            out: FstHeaderWriter::new(out, &info).map_err(io_error)?,
            ids: Vec::new(),
        };
        let variables = Variables::declare(netlist, selection, &mut header)?;
        let mut body = header.out.finish().map_err(io_error)?;
        // The writer tells changes only.
        body.set_deduplicate(false);
        let fst = Fst {
            full: body.size() + BLOCK,
            body,
            ids: header.ids,
            start: Time::ZERO,
            stamped: Time::ZERO,
            error: None,
        };
        Ok(WaveWriter::from_variables(fst, netlist, variables))
    }
}

/// The format: what [`FstWriter`] writes.
pub struct Fst<W: Write + Seek> {
    body: FstBodyWriter<W>,
    ids: Vec<FstSignalId>,
    /// Size of `body` at which its block is complete.
    full: usize,
    start: Time,
    stamped: Time,
    error: Option<FstWriteError>,
}

struct Header<W: Write + Seek> {
    out: FstHeaderWriter<W>,
    ids: Vec<FstSignalId>,
}

impl<W: Write + Seek> Declare for Header<W> {
    fn scope(&mut self, name: &str) -> io::Result<()> {
        let module = FstScopeType::Module;
        self.out.scope(name, "", module).map_err(io_error)
    }

    fn up_scope(&mut self) -> io::Result<()> {
        self.out.up_scope().map_err(io_error)
    }

    fn signal(&mut self, signal: &Declaration<'_>) -> io::Result<()> {
        let name = if signal.is_bus {
            format!("{} [{}:0]", signal.name, signal.width - 1)
        } else {
            signal.name.to_owned()
        };
        let alias = signal.is_alias.then(|| self.ids[signal.variable as usize]);
        let (wire, undirected) = (FstVarType::Wire, FstVarDirection::Implicit);
        let bits = FstSignalType::bit_vec(signal.width);
        let id = self.out.var(name, bits, wire, undirected, alias);
        let id = id.map_err(io_error)?;
        if !signal.is_alias {
            self.ids.push(id);
        }
        Ok(())
    }
}

impl<W: Write + Seek> Fst<W> {
    /// After an error the rest is dropped: the file is lost anyway.
    #[inline]
    fn keep_error(&mut self, result: Result<(), FstWriteError>) {
        if let (Err(error), None) = (result, &self.error) {
            self.error = Some(error);
        }
    }
}

impl<W: Read + Write + Seek> Format for Fst<W> {
    type Out = W;

    fn begin(&mut self, time: Time) {
        self.start = time;
        self.stamped = time;
    }

    fn begun(&mut self) {}

    #[inline]
    fn time(&mut self, time: Time) {
        self.stamped = time;
        if self.body.size() >= self.full {
            let flushed = self.body.flush();
            self.keep_error(flushed);
        }
        let changed = self.body.time_change(time.as_fs().unsigned_abs());
        self.keep_error(changed);
    }

    #[inline]
    fn scalar(&mut self, variable: u32, value: u8) {
        let id = self.ids[variable as usize];
        let changed = self.body.signal_change(id, &[value]);
        self.keep_error(changed);
    }

    #[inline]
    fn bus(&mut self, variable: u32, values: &[u8]) {
        let id = self.ids[variable as usize];
        let changed = self.body.signal_change(id, values);
        self.keep_error(changed);
    }

    fn end_instant(&mut self) {}

    fn finish(mut self, end: Time) -> io::Result<W> {
        let end = end.max(self.start + Time::from_fs(1));
        if end > self.stamped {
            self.time(end);
        }
        if let Some(error) = self.error {
            return Err(io_error(error));
        }
        let mut out = self.body.finish().map_err(io_error)?;
        if self.start > Time::ZERO {
            set_start(&mut out, self.start)?;
        }
        out.flush()?;
        Ok(out)
    }
}

/// Lets a file begin at `start`. Its blocks are a type (a byte), the length of the rest (eight bytes, big endian) and
/// contents; those of the header and of a block of changes open with the time at which they begin.
fn set_start<W: Read + Write + Seek>(out: &mut W, start: Time) -> io::Result<()> {
    const HEADER: u8 = 0;
    const CHANGES: u8 = 8;
    let mut position = 0;
    loop {
        out.seek(SeekFrom::Start(position))?;
        let mut head = [0; 9];
        out.read_exact(&mut head)?;
        let (kind, length) = (head[0], head[1..].try_into().expect("eight bytes"));
        if matches!(kind, HEADER | CHANGES) {
            out.seek(SeekFrom::Start(position + 9))?;
            out.write_all(&start.as_fs().to_be_bytes())?;
        }
        if kind == CHANGES {
            out.seek(SeekFrom::End(0))?;
            return Ok(());
        }
        position += 1 + u64::from_be_bytes(length);
    }
}

fn io_error(error: FstWriteError) -> io::Error {
    match error {
        FstWriteError::Io(error) => error,
        other => io::Error::other(other),
    }
}
