//! Real cell libraries: Liberty files, as every foundry gives them and every synthesis and timing tool reads them.
//!
//! ```text
//!   .lib ─► group ─► cell ─► mapping: kind → cells ─┐
//!   netlist ─► loads, drives, slews ────────────────┴─► characterised: Timing of every instance, area, leakage, mapped Verilog
//! ```
//!
//! Each kind of cell ([`CellKind`](crate::netlist::CellKind)) is mapped to cells of the library by its *function*. Then every instance gets delays of its
//! own from the library's tables, by its load and by the slews at its pins. Non-linear delay models are read; current-source models
//! in the same file are passed over.
//!
//! What a kernel with one delay an arc and output edge cannot say is taken at its worst: of conditions (`when`), and of the two input
//! edges of an exclusive OR or a multiplexer's select. Negative limits count as zero.
//!
//! | file | what it has |
//! |---|---|
//! | `text` | a file's bytes as text |
//! | `group` | the syntax |
//! | `function` | Boolean expressions as truth tables |
//! | `table` | delays, slews and limits over slew and load |
//! | `units` | what a file's numbers are in |
//! | `candidate` | which cells may be chosen |
//! | `cell`, `read_cell` | a chosen cell with its tables |
//! | `words` | attributes that are one of a few words |
//! | `passed_over` | the others, and why |
//! | `error`, `syntax_fault`, `table_fault` | what can be wrong |
//! | `remark` | what is odd, or was put together |
//! | `flip_flop` | what a flip-flop's pins do, and which are tied |
//! | `leakage` | what a cell leaks |
//! | `complete` | what a cell must state, and what it leaves out |
//! | `mapping` | what stands for each kind |
//! | `kit` | several files that are one library |
//! | `read` | a library as a whole |
//! | `characterised` | loads, drives and slews of a netlist, and what follows |
//! | `composite` | one instance: from the slews at its pins to its delays and limits |
//! | `verilog_name` | names of cells and pins for other tools |
//! | `mapped_verilog` | the netlist of library cells, for other tools |
//! | `mapped_models` | what its cells do, for simulators |
//! | `mapped_timing` | its delays and clocks for them |
//! | `mapped_wires` | loads of its wires for them |

mod candidate;
mod cell;
mod characterised;
mod complete;
mod composite;
mod error;
mod flip_flop;
mod function;
mod group;
mod kit;
mod leakage;
mod mapped_models;
mod mapped_timing;
mod mapped_verilog;
mod mapped_wires;
mod mapping;
mod passed_over;
mod read;
mod read_cell;
mod remark;
mod syntax_fault;
mod table;
mod table_fault;
mod text;
mod units;
mod verilog_name;
mod words;

#[cfg(feature = "yosys")]
pub(crate) use candidate::{CellFunction, Role};
pub use characterised::{CharacterisedNetlist, Environment};
pub use error::{KitError, LibertyError, LibertyFault, PassedOver, PassedOverReason};
#[cfg(feature = "yosys")]
pub(crate) use function::TruthTable;
pub use mapped_models::write_mapped_cells;
pub use mapped_timing::{Clocking, write_constraints, write_mapped_sdf};
pub use mapped_verilog::write_mapped;
pub use mapping::CellMap;
pub use read::Liberty;
pub use remark::{CellRemark, LibraryRemark, MadeOf};
pub use syntax_fault::LibertySyntaxFault;
pub use table_fault::{LibertyTableFault, LibertyUnit};
pub use text::liberty_text;
