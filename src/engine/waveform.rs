//! Waveforms of the sensor: a VCD of every named net, and beside it a GTKWave save file that groups the
//! signals as the thesis's timing diagrams do (Fig. 47, 54, 57).

use std::path::Path;

use super::gate::GateSimulation;
use crate::chip::sensor;
use crate::files::{InputError, OutputFile};
use crate::netlist::Netlist;
use crate::units::Time;
use crate::waves::{Entry, Group, SaveFile, Selection, VcdWriter};

/// Runs `simulation` to its end with every named net in `vcd`, and writes the save file beside it, showing
/// these macropixels (row, col) and the first laser cycle.
///
/// # Errors
/// When a file cannot be written.
pub fn record(
    simulation: &mut GateSimulation<'_>,
    vcd: &Path,
    pixels: &[(usize, usize)],
    view_end: Time,
) -> Result<(), InputError> {
    let origin = simulation.schedule().origin;
    let view = SaveFile {
        groups: groups(simulation.netlist(), pixels),
        zoom: (origin - Time::from_ns(10), origin + view_end),
        marker: Some(origin),
    };
    write_vcd(vcd, simulation.netlist().clone(), |observer| {
        simulation.run(observer);
        simulation.schedule().end
    })?;
    write_view(vcd, simulation.netlist(), &view)
}

/// Writes what `run` lets the observer see of `netlist` to `vcd`; `run` returns the end of the simulation.
///
/// # Errors
/// When the file cannot be written; it is then not there at all.
pub fn write_vcd(
    vcd: &Path,
    netlist: Netlist,
    run: impl FnOnce(&mut VcdWriter<OutputFile>) -> Time,
) -> Result<(), InputError> {
    let failed = |e: std::io::Error| {
        InputError::new(
            vcd.display(),
            format!("cannot be written ({e}); free some space"),
        )
    };
    let file = OutputFile::create(vcd)?;
    let mut writer = VcdWriter::new(file, &netlist, &Selection::all()).map_err(failed)?;
    let end = run(&mut writer);
    writer.finish(end).map_err(failed)?.commit()
}

/// Writes the save file of a VCD beside it, with the extension `.gtkw`.
///
/// # Errors
/// When the file cannot be written.
pub fn write_view(vcd: &Path, netlist: &Netlist, view: &SaveFile) -> Result<(), InputError> {
    let name = vcd.file_name().unwrap_or_default().to_string_lossy();
    OutputFile::write_with(&vcd.with_extension("gtkw"), |out| {
        view.write(out, netlist, &name)
    })
}

fn groups(netlist: &Netlist, pixels: &[(usize, usize)]) -> Vec<Group> {
    let mut groups = Vec::new();
    for &(row, col) in pixels {
        let pixel = sensor::pixel_name(row, col);
        let of = |name: &str| format!("{pixel}.{name}");
        let counter = [
            Entry::binary("CLK"),
            Entry::binary("STOP"),
            Entry::binary(of("ENABLE")),
            Entry::binary(of("MEMORY_LOAD")),
            Entry::decimal(of("COUNTER_INIT")),
            Entry::decimal(of("p_counter.MEMORY")),
            Entry::binary(of("COUNTER_RESET")),
            Entry::binary(of("COUNTER_CLK")),
            Entry::decimal(of("p_counter.COUNTER_OUT")),
            Entry::binary(of("LOCAL_STOP")),
        ];
        groups.push(Group::new(format!("P-counter {pixel} (Fig. 54)"), counter));
        let bins = (0..)
            .map(|bin| of(&format!("histogram.bin_{bin}.COUNT")))
            .take_while(|path| netlist.signal(path).is_some())
            .map(Entry::decimal);
        let histogram = [
            Entry::hex(of("SPAD_RAW")),
            Entry::hex(of("SPAD_TIMED")),
            Entry::binary(of("SPAD_EVENT")),
            Entry::binary(of("metdc.SHIFT")),
            Entry::binary(of("metdc.STROBE")),
            Entry::binary(of("HIT")),
        ];
        let signals = histogram.into_iter().chain(bins);
        groups.push(Group::new(format!("Histogram {pixel} (Fig. 47)"), signals));
    }
    let load = [
        Entry::binary("LOAD_ENABLE"),
        Entry::binary("LOAD_CLK"),
        Entry::binary("COUNTER_INITS"),
        Entry::hex("COUNTER_INIT_ROW"),
        Entry::binary("ROW_DONE"),
        Entry::binary("MEMORY_LOAD"),
    ];
    groups.push(Group::new("Load path (Fig. 57)", load));
    groups
}
