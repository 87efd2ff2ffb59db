//! Hardware events: what a real chip would do silently, reported with its name, instance and time.
//!
//! | event | what happens in the chip |
//! |---|---|
//! | `memory_written_while_counting` | a memory bit that changes flips its multiplexer: an edge for the next stage, though nothing was counted |
//! | `reset_too_short` | COUNTER_RESET is missing, or ends before the stage outputs are back at the memory's value (their rising edges then count), or before the COUNTER_CLK edge that LOCAL_STOP's fall lets through (it then counts) |
//! | `pulses_cancelled` | a SPAD fires twice between two CLK edges: its toggle flip-flop is back where it was, both photons are lost |
//!
//! [`HardwareEvents`] is an observer, as timing checks are. A STOP edge that releases the reset too near a CLK edge is
//! a violation of recovery or removal, and found by those. The first two are those of the default P-counter; other
//! variants do other things, and are not judged.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::chip::{Mode, PCounter, Probe, Probes, SensorConfig, Tap, probes};
use crate::kernel::Observer;
use crate::logic::Logic;
use crate::netlist::{NetId, Netlist};
use crate::settings::words;
use crate::units::Time;

/// Events that are kept one by one; further ones are only counted.
const MOST_EVENTS: usize = 10_000;

words! {
    /// What happened.
    #[derive(PartialOrd, Ord)]
    #[non_exhaustive]
    pub enum HardwareEventKind {
        /// A start value changed while its counter was not held in reset.
        MemoryWrittenWhileCounting = "memory_written_while_counting",
        /// The counter was not reset, or began to count from another value than its start value, or at an edge that is
        /// not CLK's.
        ResetTooShort = "reset_too_short",
        /// Two pulses of one SPAD fell between the same two CLK edges.
        PulsesCancelled = "pulses_cancelled",
    }
}

/// One of them.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct HardwareEvent {
    /// What happened.
    pub kind: HardwareEventKind,
    /// Dotted path of the macropixel, or of what it happened to within it.
    pub instance: String,
    /// When, fs.
    pub time_fs: i64,
}

/// Everything that was seen.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct HardwareEventReport {
    /// By time.
    pub hardware_events: Vec<HardwareEvent>,
    /// Events that were counted but not kept.
    pub hardware_events_left_out: u64,
}

impl fmt::Display for HardwareEventReport {
    /// One line for each kind that occurred: how often, and where first.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.hardware_events.is_empty() {
            return writeln!(f, "Hardware events: none");
        }
        writeln!(f, "Hardware events, first of each kind")?;
        for kind in HardwareEventKind::ALL {
            let mut of_kind = self.hardware_events.iter().filter(|e| e.kind == kind);
            let Some(first) = of_kind.next() else {
                continue;
            };
            let (count, time) = (1 + of_kind.count(), Time::from_fs(first.time_fs));
            let name = kind.name();
            writeln!(f, "  {name:<30}{count:>8}  {} at {time}", first.instance)?;
        }
        if self.hardware_events_left_out > 0 {
            writeln!(f, "  {} more were not kept", self.hardware_events_left_out)?;
        }
        Ok(())
    }
}

/// What a net is to its macropixel.
#[derive(Debug, Clone, Copy)]
enum Role {
    Clk,
    Stop,
    PixelClear,
    CounterReset,
    CounterClk,
    LocalStop,
    Memory(u8),
    CounterOut(u8),
    Toggle(u8),
}

/// A number whose bits are learnt one by one.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Bits {
    ones: u32,
    known: u32,
}

impl Bits {
    fn set(&mut self, bit: u8, value: Logic) {
        let mask = 1 << bit;
        self.ones = self.ones & !mask | if value == Logic::One { mask } else { 0 };
        let is_known = value.to_bool().is_some();
        self.known = self.known & !mask | if is_known { mask } else { 0 };
    }
}

#[derive(Debug, Clone)]
struct Macropixel {
    path: String,
    reset: Logic,
    local_stop: Logic,
    memory: Bits,
    out: Bits,
    /// When the reset was released, until the first count after it.
    released: Option<Time>,
    reset_rose: Time,
    clk_fell: Time,
    /// The last rise of STOP, if the counter was free and had to be reset by it.
    awaits_reset: Option<Time>,
    /// PIXEL_CLEAR, which also moves toggles.
    is_cleared: bool,
    toggle: Bits,
    /// Changes of each SPAD's toggle since CLK last rose.
    toggled: Vec<u8>,
}

/// Watches macropixels of a netlist.
pub struct HardwareEvents {
    /// Macropixels and roles of every net; most have none.
    roles: Vec<Vec<(u32, Role)>>,
    pixels: Vec<Macropixel>,
    not_before: Time,
    /// What was seen so far.
    pub report: HardwareEventReport,
    /// By kind, those that were not kept among them.
    counts: [u64; HardwareEventKind::ALL.len()],
}

impl HardwareEvents {
    /// Watches these macropixels of a sensor with this configuration; nothing before `not_before` is judged.
    ///
    /// # Panics
    /// When one of them is no macropixel.
    pub fn new(
        netlist: &Netlist,
        config: &SensorConfig,
        macropixels: &[Probes],
        not_before: Time,
    ) -> Self {
        let judges_counts = config.p_counter == PCounter::Ripple
            && config.p_counter_block.is_none()
            && config.tap == Tap::Borrow
            && config.mode == Mode::Guided;
        let mut roles = vec![Vec::new(); netlist.net_count()];
        let mut pixels = Vec::new();
        for (index, probes) in macropixels.iter().enumerate() {
            let mut watch = |net: NetId, role| roles[net.index()].push((index as u32, role));
            watch(probes.net(Probe::Clk), Role::Clk);
            watch(probes.net(Probe::PixelClear), Role::PixelClear);
            if judges_counts {
                watch(probes.net(Probe::Stop), Role::Stop);
                watch(probes.net(Probe::CounterReset), Role::CounterReset);
                watch(probes.net(Probe::CounterClk), Role::CounterClk);
                watch(probes.net(Probe::LocalStop), Role::LocalStop);
                for (bit, &net) in probes.bus(Probe::Memory).iter().enumerate() {
                    watch(net, Role::Memory(bit as u8));
                }
                for (bit, &net) in probes.bus(Probe::CounterOut).iter().enumerate() {
                    watch(net, Role::CounterOut(bit as u8));
                }
            }
            for (spad, &toggle) in probes.toggles().iter().enumerate() {
                watch(toggle, Role::Toggle(spad as u8));
            }
            pixels.push(Macropixel {
                path: probes.macropixel().to_owned(),
                reset: Logic::X,
                local_stop: Logic::X,
                memory: Bits::default(),
                out: Bits::default(),
                released: None,
                reset_rose: Time::ZERO,
                clk_fell: Time::ZERO,
                awaits_reset: None,
                is_cleared: true,
                toggle: Bits::default(),
                toggled: vec![0; config.spads()],
            });
        }
        HardwareEvents {
            roles,
            pixels,
            not_before,
            report: HardwareEventReport::default(),
            counts: [0; HardwareEventKind::ALL.len()],
        }
    }

    /// How often one kind was seen so far, kept or not.
    pub fn count(&self, kind: HardwareEventKind) -> u64 {
        self.counts[kind as usize]
    }

    fn watched(&mut self, time: Time, pixel: usize, role: Role, value: Logic) {
        let p = &mut self.pixels[pixel];
        let mut found = None;
        match role {
            Role::Clk if value == Logic::One => p.toggled.fill(0),
            Role::Clk => p.clk_fell = time,
            Role::Stop if value == Logic::One => {
                let is_free = p.reset == Logic::Zero;
                let missed = std::mem::replace(&mut p.awaits_reset, is_free.then_some(time));
                found = missed.map(|stop| (HardwareEventKind::ResetTooShort, stop, p.path.clone()));
            }
            Role::Stop => {}
            Role::PixelClear => p.is_cleared = value != Logic::Zero,
            Role::CounterReset => {
                p.released = (value == Logic::Zero).then_some(time);
                if value == Logic::One {
                    p.reset_rose = time;
                    p.awaits_reset = None;
                }
                p.reset = value;
            }
            Role::LocalStop => p.local_stop = value,
            Role::CounterClk if value == Logic::One && p.reset == Logic::Zero => {
                // A CLK edge that counts is one that fell after the reset began.
                let starts_right =
                    p.out == p.memory && p.local_stop == Logic::Zero && p.clk_fell >= p.reset_rose;
                if let (Some(released), false) = (p.released.take(), starts_right) {
                    found = Some((HardwareEventKind::ResetTooShort, released, p.path.clone()));
                }
            }
            Role::CounterClk => {}
            Role::CounterOut(bit) => p.out.set(bit, value),
            Role::Memory(bit) => {
                let before = p.memory;
                p.memory.set(bit, value);
                let was_known = before.known >> bit & 1 == 1;
                if was_known && before != p.memory && p.reset == Logic::Zero {
                    let kind = HardwareEventKind::MemoryWrittenWhileCounting;
                    let memory = Probe::Memory.path(&p.path);
                    found = Some((kind, time, format!("{memory}[{bit}]")));
                }
            }
            Role::Toggle(spad) => {
                let before = p.toggle;
                p.toggle.set(spad, value);
                let is_change = before.known == p.toggle.known && before != p.toggle;
                if is_change && !p.is_cleared {
                    let changes = &mut p.toggled[spad as usize];
                    *changes = changes.saturating_add(1);
                    if changes.is_multiple_of(2) {
                        let instance = probes::spad_path(&p.path, spad.into());
                        found = Some((HardwareEventKind::PulsesCancelled, time, instance));
                    }
                }
            }
        }
        if let Some((kind, when, instance)) = found.filter(|_| time >= self.not_before) {
            self.counts[kind as usize] += 1;
            if self.report.hardware_events.len() == MOST_EVENTS {
                self.report.hardware_events_left_out += 1;
                return;
            }
            self.report.hardware_events.push(HardwareEvent {
                kind,
                instance,
                time_fs: when.as_fs(),
            });
        }
    }
}

impl Observer for HardwareEvents {
    #[inline]
    fn change(&mut self, time: Time, net: NetId, value: Logic) {
        for at in 0..self.roles[net.index()].len() {
            let (pixel, role) = self.roles[net.index()][at];
            self.watched(time, pixel as usize, role, value);
        }
    }
}
