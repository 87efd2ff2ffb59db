//! A waveform in a file of its own, in the format that its name asks for.

use std::ffi::OsStr;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

pub use femtogate::waves::*;

use crate::ORIGIN;
use crate::files::{InputError, OutputFile, begins_with, set_aside_foreign};
use crate::kernel::Observer;
use crate::logic::Logic;
use crate::netlist::{NetId, Netlist};
use crate::units::Time;

/// How a waveform is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum WaveFormat {
    /// Value change dump: text that every tool reads.
    #[default]
    Vcd,
    /// GTKWave's compressed format, several times smaller.
    Fst,
}

impl WaveFormat {
    /// What the name of a file asks for: FST if it ends so, else VCD.
    pub fn from_path(path: &Path) -> Self {
        match path.extension() {
            Some(extension) if extension.eq_ignore_ascii_case("fst") => WaveFormat::Fst,
            _ => WaveFormat::Vcd,
        }
    }

    /// How names of such files end.
    pub fn extension(self) -> &'static str {
        match self {
            WaveFormat::Vcd => "vcd",
            WaveFormat::Fst => "fst",
        }
    }
}

/// Writes the waveform of a simulation that it observes, and appears under its name when it is finished.
pub struct WaveFile {
    path: PathBuf,
    writer: Writer,
}

enum Writer {
    Vcd(Box<VcdWriter<OutputFile>>),
    Fst(Box<FstWriter<OutputFile>>),
}

impl WaveFile {
    /// Starts a file of the selected signals, which keeps this span of the simulation.
    ///
    /// # Errors
    /// When the file cannot be written, or the selection has a path that does not exist.
    pub(crate) fn create(
        path: &Path,
        format: WaveFormat,
        netlist: &Netlist,
        selection: &WaveSelection,
        span: RangeInclusive<Time>,
    ) -> Result<Self, InputError> {
        let failed = |e| InputError::unwritable(path, &e);
        let file = OutputFile::create(path)?;
        let writer = match format {
            WaveFormat::Vcd => {
                let writer =
                    VcdWriter::with_origin(file, netlist, selection, ORIGIN).map_err(failed)?;
                Writer::Vcd(Box::new(writer.keep(span)))
            }
            WaveFormat::Fst => {
                let writer =
                    FstWriter::with_origin(file, netlist, selection, ORIGIN).map_err(failed)?;
                Writer::Fst(Box::new(writer.keep(span)))
            }
        };
        let path = path.to_owned();
        Ok(WaveFile { path, writer })
    }

    /// Ends the file at the end of the simulation, or of the span that it keeps.
    ///
    /// # Errors
    /// When the file cannot be written; it is then not there at all.
    pub(crate) fn finish(self, end: Time) -> Result<(), InputError> {
        let file = match self.writer {
            Writer::Vcd(writer) => writer.finish(end),
            Writer::Fst(writer) => writer.finish(end),
        };
        file.map_err(|e| InputError::unwritable(&self.path, &e))?
            .commit()
    }
}

impl Observer for WaveFile {
    #[inline]
    fn change(&mut self, time: Time, net: NetId, value: Logic) {
        match &mut self.writer {
            Writer::Vcd(writer) => writer.change(time, net, value),
            Writer::Fst(writer) => writer.change(time, net, value),
        }
    }
}

/// Writes the files that let viewers open the waveform `path`, which ends at `end`, with this layout: beside it, with
/// the extensions of [`VIEWS`]. A view that somebody else has saved under such a name is set aside.
///
/// # Errors
/// When a file cannot be written, or `netlist` has not a signal of the layout.
pub(crate) fn write_views(
    layout: &Layout,
    path: &Path,
    netlist: &Netlist,
    end: Time,
) -> Result<(), InputError> {
    let name = path
        .file_name()
        .map(OsStr::to_string_lossy)
        .unwrap_or_default();
    let [gtkw, surfer] = VIEWS.map(|extension| path.with_extension(extension));
    set_aside_foreign(&gtkw, begins_with(&Layout::gtkw_signature(ORIGIN)))?;
    set_aside_foreign(&surfer, begins_with(Layout::SURFER_SIGNATURE))?;
    OutputFile::write_with(&gtkw, |out| layout.write_gtkw(out, netlist, &name, ORIGIN))?;
    OutputFile::write_with(&surfer, |out| layout.write_surfer(out, netlist, &name, end))
}

/// Extensions of the files beside a waveform: GTKWave's save file, Surfer's command file.
pub const VIEWS: [&str; 2] = ["gtkw", "sucl"];
