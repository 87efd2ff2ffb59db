//! Waveforms for viewers: value change dumps or FST files, and files that lay out what to look at.
//!
//! ```text
//!   Netlist ─► Selection ─┐              ┌─► Vcd ─► frame.vcd ─┐
//!   Kernel ──(observes)───┴─► WaveWriter ┴─► Fst ─► frame.fst ─┴─► GTKWave, Surfer
//!   Netlist ────────────────► Layout ─► frame.gtkw, frame.sucl ──────┘
//! ```
//!
//! Beside them [`write_saif`] writes the activity of every net, for power tools.
//!
//! Two runs of the same simulation write the same bytes: files carry no date.
//!
//! ```
//! use femtogate::kernel::{Drive, Kernel, Stimulus};
//! use femtogate::netlist::{CellKind, Corner, Library, ModuleBuilder, Netlist, Timing};
//! use femtogate::units::Time;
//! use femtogate::waves::{VcdWriter, WaveSelection};
//!
//! let mut m = ModuleBuilder::new("top");
//! let (a, z) = (m.input("A"), m.output("Z"));
//! m.gate_into(CellKind::Inv, &[a], z);
//! let netlist = Netlist::elaborate(&m.finish().unwrap());
//!
//! let mut waves = VcdWriter::new(Vec::new(), &netlist, &WaveSelection::all())?;
//! let timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
//! let mut kernel = Kernel::new(&netlist, &timing);
//! let drives = [Drive::new(Time::from_ns(1), netlist.net("A").unwrap(), true)];
//! let mut stimulus = Stimulus::new(drives);
//! kernel.run(&mut stimulus, Time::from_ns(2), &mut waves)?;
//! let text = String::from_utf8(waves.finish(kernel.now())?).unwrap();
//! assert!(text.ends_with("#1000000\n1!\n#1018979\n0\"\n#2000000\n"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[cfg(feature = "fst")]
mod fst;
mod gtkw;
mod layout;
mod saif;
mod selection;
mod surfer;
mod variables;
mod vcd;
mod writer;

#[cfg(feature = "fst")]
pub use fst::{Fst, FstWriter};
pub use layout::{Entry, Layout, Mark, Radix, SignalGroup, mark};
pub use saif::write_saif;
pub use selection::WaveSelection;
pub use vcd::{Vcd, VcdWriter};
pub use writer::{Format, WaveWriter};
