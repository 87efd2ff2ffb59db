//! The rig of a testbench at gate level: a circuit with its delays, what is driven into it, and its run. Macropixels are driven through
//! the pins of a sensor ([`GateSimulation`]).
//!
//! ```text
//!   circuit ─► Rig ─► Drives, from power-up with all inputs low ─► run ─► observer
//!                                                                 └► record ─► observer, waveform and views
//! ```

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::chip::{CellLibrary, Exposure, SensorConfig, Silicon};
use crate::engine::GateSimulation;
use crate::engine::waveform::write_waves;
use crate::files::InputError;
use crate::kernel::{Drive, Kernel, Observer, Recorder, Stimulus, clock};
use crate::netlist::{Corner, Module, ModuleBuilder, NetId, Netlist, Timing};
use crate::photon::SpadEvent;
use crate::units::{Frequency, Time};
use crate::waves::Layout;

/// The module of a builder.
pub(super) fn finished(m: ModuleBuilder) -> Arc<Module> {
    m.finish().expect("the testbench's circuit is whole")
}

/// A second waveform of this name beside `waves`, in the same format.
pub(super) fn beside(waves: &Path, name: &str) -> PathBuf {
    waves
        .with_file_name(name)
        .with_extension(waves.extension().unwrap_or_default())
}

/// Runs until `end`.
pub(super) fn run(
    kernel: &mut Kernel,
    stimulus: &mut Stimulus<'_>,
    end: Time,
    observer: &mut dyn Observer,
) {
    kernel
        .run(stimulus, end, observer)
        .expect("no loop of cells without delay");
}

/// A circuit under test and its delays.
pub(super) struct Rig {
    pub(super) netlist: Netlist,
    pub(super) timing: Timing,
}

impl Rig {
    /// In the built-in library.
    pub(super) fn new(circuit: &Arc<Module>, corner: Corner) -> Self {
        Rig::of_netlist(Netlist::elaborate(circuit), corner)
    }

    /// In built-in cells of this silicon.
    pub(super) fn of_silicon(circuit: &Arc<Module>, silicon: &Silicon) -> Self {
        let netlist = Netlist::elaborate(circuit);
        let timing = silicon.timing(&netlist);
        Rig { netlist, timing }
    }

    /// The same of a netlist.
    pub(super) fn of_netlist(netlist: Netlist, corner: Corner) -> Self {
        let timing = Timing::nominal(&netlist, CellLibrary::BUILT_IN.cells(), corner);
        Rig { netlist, timing }
    }

    /// The net at a path.
    ///
    /// # Panics
    /// When the circuit has none there.
    pub(super) fn net(&self, path: &str) -> NetId {
        self.netlist.net(path).expect("a net of the testbench")
    }

    /// The nets of a bus.
    ///
    /// # Panics
    /// When the circuit has none there.
    pub(super) fn bus(&self, path: &str) -> Vec<NetId> {
        self.netlist.signal(path).expect("a bus of the testbench")
    }

    /// All nets.
    pub(super) fn nets(&self) -> impl Iterator<Item = NetId> + use<> {
        (0..self.netlist.net_count()).map(NetId::new)
    }

    /// A new simulation.
    pub(super) fn kernel(&self) -> Kernel {
        Kernel::new(&self.netlist, &self.timing)
    }

    /// All inputs low from the beginning on.
    pub(super) fn power_up(&self) -> Drives {
        Drives::low(self.netlist.inputs())
    }

    /// Simulates from power-up to `end`.
    pub(super) fn run(&self, drives: Drives, end: Time, observer: &mut dyn Observer) {
        run(&mut self.kernel(), &mut drives.sorted(), end, observer);
    }

    /// The same, with its waveform in `waves` and `layout` beside it.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub(super) fn record(
        &self,
        waves: &Path,
        layout: &Layout,
        drives: Drives,
        end: Time,
        recorder: &mut Recorder,
    ) -> Result<(), InputError> {
        write_waves(waves, &self.netlist, layout, |waves| {
            self.run(drives, end, &mut (recorder, waves));
            end
        })
    }
}

/// Changes of inputs, in any order. A waveform has those of one instant in theirs.
pub(super) struct Drives(Vec<Drive>);

impl Drives {
    /// Nets that are low from the beginning on.
    pub(super) fn low(nets: impl IntoIterator<Item = NetId>) -> Self {
        let low = |net| Drive::new(Time::ZERO, net, false);
        Drives(nets.into_iter().map(low).collect())
    }

    /// One change.
    pub(super) fn set(&mut self, time: Time, net: NetId, value: bool) {
        self.0.push(Drive::new(time, net, value));
    }

    /// A net that is high from `rise` to `fall`.
    pub(super) fn pulse(&mut self, net: NetId, rise: Time, fall: Time) {
        self.set(rise, net, true);
        self.set(fall, net, false);
    }

    /// A number on a bus, its lowest bit first.
    pub(super) fn number(&mut self, time: Time, bus: &[NetId], number: u64) {
        for (bit, &net) in bus.iter().enumerate() {
            self.set(time, net, number >> bit & 1 == 1);
        }
    }

    /// Half periods `first` to `end` of a clock, which falls at `origin`.
    pub(super) fn clock(
        &mut self,
        net: NetId,
        frequency: Frequency,
        origin: Time,
        (first, end): (i64, i64),
    ) {
        self.0.extend(clock(net, frequency, origin, first, end));
    }

    /// As a kernel takes them.
    pub(super) fn sorted(self) -> Stimulus<'static> {
        Stimulus::sorted(self.0)
    }
}

/// What the gates count in one macropixel with this start value; `None` where a bin is unknown.
pub(super) fn counts(
    config: &SensorConfig,
    exposure: &Exposure,
    place: (usize, usize),
    start: u16,
    pulses: &[SpadEvent],
) -> Option<Vec<u16>> {
    let mut gate = GateSimulation::new(config, exposure, place, (1, 1), &[start], &[pulses]);
    gate.run(&mut ());
    Some(gate.histograms().ok()?.into_counts())
}

/// Exposes macropixels, with their waveform in `waves` and `layout` beside it.
///
/// # Errors
/// When a file cannot be written.
pub(super) fn record_exposure(
    gate: &mut GateSimulation,
    waves: &Path,
    layout: &Layout,
    observer: &mut dyn Observer,
) -> Result<(), InputError> {
    let netlist = Arc::clone(gate.netlist());
    write_waves(waves, &netlist, layout, |waves| {
        gate.run(&mut (observer, waves));
        gate.schedule().end
    })
}
