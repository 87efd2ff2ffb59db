//! A circuit on its own: elaborated, driven, watched.

// Each test file uses its own part of this.
#![allow(dead_code)]

use std::sync::Arc;

use guided_dtof::chip::{ChipTiming, SensorConfig};
use guided_dtof::kernel::{Drive, Kernel, Recorder, Stimulus};
use guided_dtof::logic::Logic;
use guided_dtof::netlist::{CellKind, Corner, Library, Module, NetId, Netlist, Timing};
use guided_dtof::units::Time;
use proptest::prelude::*;

/// Longer than anything takes to settle in the slow corner.
pub const SETTLING: Time = Time::from_ns(5);

/// A circuit on its own, what is to be driven into it, and what it did.
pub struct Bench {
    pub config: SensorConfig,
    pub netlist: Netlist,
    pub drives: Vec<Drive>,
}

impl Bench {
    /// The circuit with all inputs low from time 0 on.
    pub fn new(module: &Arc<Module>, corner: Corner) -> Self {
        let netlist = Netlist::elaborate(module);
        let low = |net| Drive::new(Time::ZERO, net, false);
        Bench {
            drives: netlist.inputs().into_iter().map(low).collect(),
            config: SensorConfig {
                corner,
                ..SensorConfig::default()
            },
            netlist,
        }
    }

    pub fn timing(&self) -> ChipTiming {
        ChipTiming::new(&self.config)
    }

    pub fn delay(&self, kind: CellKind, pin: usize, to: Logic) -> Time {
        Library::generic_40nm().delay(kind, pin, to, self.config.corner)
    }

    pub fn net(&self, path: &str) -> NetId {
        self.netlist.net(path).unwrap()
    }

    pub fn bus(&self, path: &str) -> Vec<NetId> {
        self.netlist.signal(path).unwrap()
    }

    pub fn drive(&mut self, time: Time, path: &str, value: bool) {
        self.drives.push(Drive::new(time, self.net(path), value));
    }

    pub fn pulse(&mut self, time: Time, width: Time, path: &str) {
        self.drive(time, path, true);
        self.drive(time + width, path, false);
    }

    pub fn number(&mut self, time: Time, path: &str, value: u64) {
        for (bit, net) in self.bus(path).into_iter().enumerate() {
            self.drives
                .push(Drive::new(time, net, value >> bit & 1 == 1));
        }
    }

    /// Starts the simulation of everything driven so far, from time 0.
    pub fn start(&mut self, watched: &[&str]) -> Run {
        let nets = watched.iter().flat_map(|path| self.bus(path));
        Run {
            recorder: Recorder::new(nets),
            kernel: Kernel::new(
                &self.netlist,
                &Timing::nominal(&self.netlist, &Library::generic_40nm(), self.config.corner),
            ),
            stimulus: Stimulus::sorted(std::mem::take(&mut self.drives)),
        }
    }
}

pub struct Run {
    pub kernel: Kernel,
    pub stimulus: Stimulus<'static>,
    pub recorder: Recorder,
}

impl Run {
    pub fn until(&mut self, time: Time) {
        self.kernel
            .run(&mut self.stimulus, time, &mut self.recorder)
            .unwrap();
    }

    /// The number on a bus at `time`, which must not be in the past.
    pub fn number_at(&mut self, time: Time, nets: &[NetId]) -> Option<u64> {
        self.until(time);
        self.kernel.number(nets)
    }

    pub fn is_high_at(&mut self, time: Time, net: NetId) -> Option<bool> {
        self.number_at(time, &[net]).map(|n| n == 1)
    }
}

pub fn corners() -> impl Strategy<Value = Corner> {
    prop::sample::select(Corner::ALL.to_vec())
}
