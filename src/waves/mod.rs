//! Waveforms for viewers: value change dumps, and save files that lay out what to look at.
//!
//! ```text
//!   Netlist ─► Selection ─┐
//!   Kernel ──(observes)───┴─► VcdWriter ─► frame.vcd  ─┐
//!   Netlist ────────────────► SaveFile  ─► frame.gtkw ─┴─► GTKWave (Surfer reads the VCD)
//! ```
//!
//! Two runs of the same simulation write the same bytes: files carry no date.
//!
//! ```
//! use guided_dtof::kernel::{Drive, Kernel};
//! use guided_dtof::netlist::{CellKind, Corner, Library, ModuleBuilder, Netlist, Timing};
//! use guided_dtof::units::Time;
//! use guided_dtof::waves::{Selection, VcdWriter};
//!
//! let mut m = ModuleBuilder::new("top");
//! let (a, z) = (m.input("A"), m.output("Z"));
//! m.gate_into(CellKind::Inv, &[a], z);
//! let netlist = Netlist::elaborate(&m.finish().unwrap());
//!
//! let mut waves = VcdWriter::new(Vec::new(), &netlist, &Selection::all())?;
//! let timing = Timing::nominal(&netlist, &Library::default(), Corner::Typ);
//! let mut kernel = Kernel::new(&netlist, &timing);
//! let drives = [Drive::new(Time::from_ns(1), netlist.net("A").unwrap(), true)];
//! let mut stimulus = guided_dtof::kernel::merge([Box::new(drives.into_iter()) as Box<_>]);
//! kernel.run(&mut stimulus, Time::from_ns(2), &mut waves);
//! let text = String::from_utf8(waves.finish(kernel.now())?).unwrap();
//! assert!(text.ends_with("#1000000\n1!\n#1018979\n0\"\n#2000000\n"));
//! # Ok::<(), std::io::Error>(())
//! ```

mod gtkw;
mod selection;
mod vcd;
mod vcd_header;

pub use gtkw::{Entry, Group, Radix, SaveFile};
pub use selection::Selection;
pub use vcd::VcdWriter;
