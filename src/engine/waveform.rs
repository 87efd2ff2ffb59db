//! Waveforms of the sensor: a VCD of every named net, and beside it a GTKWave save file that groups the
//! signals as the thesis's timing diagrams do (Fig. 47, 54, 57).

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use super::gate::GateSimulation;
use crate::chip::window_law::{Window, WindowLaw};
use crate::chip::{Exposure, SensorConfig, histogram, sensor};
use crate::files::{InputError, OutputFile};
use crate::kernel::Observer;
use crate::netlist::Netlist;
use crate::units::Time;
use crate::waves::{Entry, Group, SaveFile, Selection, VcdWriter};

/// What a waveform shows.
#[derive(Debug, Clone)]
pub struct View<'p> {
    /// Macropixels (row, col) whose signals are grouped.
    pub pixels: &'p [(usize, usize)],
    /// Where the viewer looks first, from the first rising edge of STOP.
    pub focus: Range<Time>,
    /// Where the marker stands, from the first rising edge of STOP.
    pub marker: Time,
    /// Changes after this time, from the first rising edge of STOP, are left out of the file.
    pub limit: Option<Time>,
}

impl<'p> View<'p> {
    /// Looks at how the first laser cycle's window of `start` closes: the last counts, LOCAL_STOP (with the
    /// marker) and what the histogram makes of it.
    pub fn of_window(
        pixels: &'p [(usize, usize)],
        config: &SensorConfig,
        exposure: &Exposure,
        start: u16,
    ) -> Self {
        let marker = match WindowLaw::new(config, exposure).window(start) {
            Window::Open(open) => open.strobe_cause,
            Window::Never | Window::Irregular(_) | Window::Race(_) => Time::ZERO,
        };
        let periods = |k| exposure.clock.periods(k);
        View {
            pixels,
            focus: marker - periods(18)..marker + periods(4),
            marker,
            limit: None,
        }
    }
}

/// Runs `simulation` to its end with every named net in `vcd` (and `observer` watching, too), and writes a save file
/// for `view` beside it.
///
/// # Errors
/// When a file cannot be written.
pub fn record<O: Observer>(
    simulation: &mut GateSimulation<'_>,
    vcd: &Path,
    view: &View<'_>,
    observer: &mut O,
) -> Result<(), InputError> {
    let schedule = simulation.schedule();
    let origin = schedule.origin;
    let save_file = SaveFile {
        groups: groups(simulation.netlist(), view.pixels),
        zoom: (origin + view.focus.start, origin + view.focus.end),
        marker: Some(origin + view.marker),
    };
    let netlist = Arc::clone(simulation.netlist());
    let limit = view.limit.map_or(schedule.end, |limit| origin + limit);
    write_vcd(vcd, &netlist, limit, |writer| {
        simulation.run(&mut (writer, observer));
        schedule.end
    })?;
    write_view(vcd, &netlist, &save_file)
}

/// Writes what `run` lets the observer see of `netlist` to `vcd`, changes after `limit` left out; `run` returns
/// the end of the simulation.
///
/// # Errors
/// When the file cannot be written; it is then not there at all.
pub fn write_vcd(
    vcd: &Path,
    netlist: &Netlist,
    limit: Time,
    run: impl FnOnce(&mut VcdWriter<OutputFile>) -> Time,
) -> Result<(), InputError> {
    let failed = |e: std::io::Error| {
        InputError::new(
            vcd.display(),
            format!("cannot be written ({e}); free some space"),
        )
    };
    let file = OutputFile::create(vcd)?;
    let mut writer = VcdWriter::new(file, netlist, &Selection::all())
        .map_err(failed)?
        .limit(limit);
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
        let has_signal = |path: &String| netlist.signal(path).is_some();
        let memory = Some(of("p_counter.MEMORY")).filter(has_signal);
        let mut counter = vec![
            Entry::binary("CLK"),
            Entry::binary("STOP"),
            Entry::binary(of("ENABLE")),
            Entry::binary(of("MEMORY_LOAD")),
            Entry::decimal(of("COUNTER_INIT")),
        ];
        counter.extend(memory.map(Entry::decimal));
        counter.extend([
            Entry::binary(of("COUNTER_RESET")),
            Entry::binary(of("COUNTER_CLK")),
            Entry::decimal(of("p_counter.COUNTER_OUT")),
            Entry::binary(of("LOCAL_STOP")),
        ]);
        groups.push(Group::new(format!("P-counter {pixel} (Fig. 54)"), counter));
        let bins = (0..)
            .map(|bin| of(&format!("histogram.{}", histogram::bin_name(bin))))
            .take_while(has_signal)
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
