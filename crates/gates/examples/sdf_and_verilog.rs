//! A circuit for other tools: its Verilog, the cells it is made of, and its delays as SDF; and delays that come back from
//! layout as SDF.
//!
//! ```text
//!   cargo run --example sdf_and_verilog -- FOLDER
//! ```

use std::collections::BTreeSet;
use std::error::Error;
use std::fs::File;
use std::path::PathBuf;

use femtogate::netlist::{
    CellKind, Corner, Edge, Library, ModuleBuilder, Netlist, StaticTiming, Timing,
};
use femtogate::sdf::{Sdf, SdfOptions, annotate, write_sdf};
use femtogate::verilog::{write_modules, write_standard_cells};

/// What a router might say of one cell.
const FROM_LAYOUT: &str = r#"(DELAYFILE (SDFVERSION "3.0") (TIMESCALE 1ps)
  (CELL (CELLTYPE "NAND2") (INSTANCE slow)
    (DELAY (ABSOLUTE (IOPATH A Z (60.0::90.0) (50.0::80.0)))))
)"#;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args_os().nth(1).map(PathBuf::from);
    let folder = folder.unwrap_or_else(std::env::temp_dir);

    let mut m = ModuleBuilder::new("pair");
    let (a, b, z) = (m.input("A"), m.input("B"), m.output("Z"));
    let inner = m.wire("INNER");
    m.cell("slow", CellKind::Nand2, &[a, b], &[inner]);
    m.cell("inverter", CellKind::Inv, &[inner], &[z]);
    let top = m.finish()?;
    let netlist = Netlist::elaborate(&top);
    let library = Library::generic_40nm();
    let corners = Corner::ALL.map(|corner| Timing::nominal(&netlist, &library, corner));

    write_modules(&mut File::create(folder.join("pair.v"))?, &top)?;
    let mut cells = File::create(folder.join("cells.v"))?;
    write_standard_cells(&mut cells, &library, &BTreeSet::new())?;
    let mut sdf = File::create(folder.join("pair.sdf"))?;
    write_sdf(
        &mut sdf,
        &netlist,
        corners.each_ref(),
        SdfOptions::default(),
    )?;
    println!("pair.v, cells.v and pair.sdf are in {}", folder.display());

    let sdf = Sdf::parse("layout.sdf", FROM_LAYOUT)?;
    let [a, z] = ["A", "Z"].map(|name| netlist.net(name).expect("a port"));
    for (corner, mut timing) in Corner::ALL.into_iter().zip(corners) {
        let before = rise(&netlist, &timing, a, z)?;
        let done = annotate(&mut timing, &netlist, &sdf, corner)?;
        let after = rise(&netlist, &timing, a, z)?;
        println!(
            "{}: A to a rise of Z {before}, and {after} with {} delays from layout",
            corner.name(),
            done.arcs
        );
    }
    Ok(())
}

/// The longest time from a rise of one net to a rise of another, as text.
fn rise(
    netlist: &Netlist,
    timing: &Timing,
    from: femtogate::netlist::NetId,
    to: femtogate::netlist::NetId,
) -> Result<String, Box<dyn Error>> {
    let analysis = StaticTiming::new(netlist, timing);
    let arrivals = analysis.arrivals(&[(from, Edge::Rise)], &[])?;
    let window = arrivals.edge_window(to, Edge::Rise);
    Ok(window.map_or("never".to_owned(), |(_, latest)| latest.to_string()))
}
