//! A P-counter counted down on its gates: with which COUNTER_CLK edge, and how long after it, LOCAL_STOP rises.
//!
//! ```text
//!   COUNTER_INIT ─► MEMORY_LOAD ─► COUNTER_RESET ─► COUNTER_CLK edge 0, 1, 2 … E
//!                                                                            └─ delay ─► LOCAL_STOP rises
//! ```
//!
//! Up to 64 values of COUNTER_INIT count side by side in the lanes of one event queue. Everything settles between two edges, so the
//! delay is that of a clock slow enough for the counter.

use crate::chip::config::AfterBorrow;
use crate::chip::own_block::Uneven;
use crate::chip::{Probe, Probes, SensorConfig};
use crate::kernel::{LANES, LaneDrive, LaneKernel, LaneObserver, Lanes};
use crate::netlist::{CellId, NetId, Netlist, ScopeId, Timing};
use crate::units::Time;

/// Half a period of COUNTER_CLK, and every pause, at the least: long enough for ten thousand of the built-in gates one after the other.
pub(in crate::chip) const SHORTEST_PAUSE: Time = Time::from_ns(500);

/// What counting down depends on besides the netlist.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(in crate::chip) struct CountDownSetup {
    /// COUNTER_RESET brings the start value back.
    pub has_memory: bool,
    /// Whether the counter waits after LOCAL_STOP.
    pub after_borrow: AfterBorrow,
    /// Counts from one start value to the next.
    pub step_periods: usize,
}

impl CountDownSetup {
    /// What a sensor's P-counter is expected to do.
    pub(in crate::chip) fn of_sensor(config: &SensorConfig) -> Self {
        CountDownSetup {
            has_memory: config.p_counter.row().has_memory,
            after_borrow: config.after_borrow,
            step_periods: config.step_periods,
        }
    }
}

/// What one value of COUNTER_INIT does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::chip) struct CountDownResult {
    /// Whether LOCAL_STOP is high after the reset.
    pub starts_high: bool,
    /// Edges of COUNTER_CLK that raise LOCAL_STOP, the first one being 0: the first two.
    pub rises: [Option<u32>; 2],
    /// COUNTER_CLK rises → LOCAL_STOP rises for the first time.
    pub delay: Option<Time>,
}

impl CountDownResult {
    /// A LOCAL_STOP that stays low.
    pub(in crate::chip) const NEVER: Self = CountDownResult {
        starts_high: false,
        rises: [None; 2],
        delay: None,
    };
}

/// Up to 64 values of COUNTER_INIT in one counter's lanes.
pub(in crate::chip) struct CountDown<'n> {
    netlist: &'n Netlist,
    probes: &'n Probes,
    kernel: LaneKernel,
    codes: &'n [u16],
    expected: CountDownSetup,
    local_stop: NetId,
    pause: Time,
    now: Time,
}

/// Changes of one net since it was looked at last.
struct Watch {
    net: NetId,
    /// Lanes with a change, and with more than one.
    once: u64,
    again: u64,
    /// When which lanes changed for the first time.
    first: Vec<(Time, u64)>,
}

impl LaneObserver for Watch {
    fn change(&mut self, time: Time, net: NetId, mask: u64, _: Lanes) {
        if net == self.net {
            let new = mask & !self.once;
            self.again |= self.once & mask;
            self.once |= mask;
            self.first.push((time, new));
        }
    }
}

impl<'n> CountDown<'n> {
    /// The P-counter `netlist` with these delays, to count down these values of COUNTER_INIT.
    pub(in crate::chip) fn new(
        (netlist, probes): (&'n Netlist, &'n Probes),
        timing: &Timing,
        codes: &'n [u16],
        expected: CountDownSetup,
    ) -> Self {
        let slowest = |cell: CellId| {
            let arcs = timing.cell_delays(cell).as_flattened().iter();
            let slowest = arcs.map(|arc| arc.rise().max(arc.fall())).max();
            slowest.unwrap_or_default()
        };
        let all: i64 = netlist
            .cells_below(ScopeId::TOP)
            .map(|cell| slowest(cell).as_fs())
            .sum();
        CountDown {
            kernel: LaneKernel::new(netlist, timing),
            local_stop: probes.net(Probe::LocalStop),
            netlist,
            probes,
            codes,
            expected,
            // All cells one after the other.
            pause: SHORTEST_PAUSE.max(Time::from_fs(all)),
            now: Time::ZERO,
        }
    }

    /// Drives inputs in some lanes, waits, and tells what LOCAL_STOP did meanwhile.
    fn drive(&mut self, drives: &[(NetId, Lanes)], mask: u64) -> Watch {
        let time = self.now;
        let drives = drives.iter().map(|&(net, values)| LaneDrive {
            time,
            net,
            mask,
            values,
        });
        let mut watch = Watch {
            net: self.local_stop,
            once: 0,
            again: 0,
            first: Vec::new(),
        };
        self.now += self.pause;
        self.kernel
            .run(&mut drives.peekable(), self.now, &mut watch)
            .expect("no loop of cells without delay");
        watch
    }

    fn set(&mut self, pin: Probe, value: bool) {
        let net = self.probes.net(pin);
        self.drive(&[(net, all(value))], u64::MAX);
    }

    /// Loads the values and counts from them, as often as asked: after another reset the same must come again.
    ///
    /// # Errors
    /// A LOCAL_STOP that is unknown or not one clean edge, or a reset that does not bring a value back.
    pub(in crate::chip) fn measure(mut self, times: usize) -> Result<Vec<CountDownResult>, Uneven> {
        let inputs: Vec<_> = self
            .netlist
            .inputs()
            .iter()
            .map(|&n| (n, all(false)))
            .collect();
        self.drive(&inputs, u64::MAX);
        for (pin, value) in [
            (Probe::MemoryReset, true),
            (Probe::CounterReset, true),
            (Probe::MemoryReset, false),
        ] {
            self.set(pin, value);
        }
        let init = self.probes.bus(Probe::CounterInit);
        let bits = (0..).zip(init).map(|(bit, &net)| {
            let lanes = (0..).zip(self.codes);
            let word = lanes.fold(0, |word, (lane, code)| {
                word | u64::from(code >> bit & 1) << lane
            });
            (net, Lanes::from_bits(word))
        });
        let bits: Vec<_> = bits.collect();
        self.drive(&bits, u64::MAX);
        for (pin, value) in [
            (Probe::MemoryLoad, true),
            (Probe::MemoryLoad, false),
            (Probe::CounterReset, false),
        ] {
            self.set(pin, value);
        }
        let counted = self.count()?;
        for _ in 1..times {
            self.set(Probe::CounterReset, true);
            self.set(Probe::CounterReset, false);
            let again = self.count()?;
            let mut lanes = counted.iter().zip(&again).zip(self.codes);
            let differ = |one: &CountDownResult, other: &CountDownResult| {
                (one.starts_high, one.rises) != (other.starts_high, other.rises)
            };
            if let Some((_, &code)) = lanes.find(|((one, other), _)| differ(one, other)) {
                return Err(Uneven::Forgets(code));
            }
        }
        Ok(counted)
    }

    /// Clocks the counter until LOCAL_STOP has risen, or come round where it wraps, as the timing block lets it.
    fn count(&mut self) -> Result<Vec<CountDownResult>, Uneven> {
        let holds = self.expected.after_borrow == AfterBorrow::Hold;
        let clk = self.probes.net(Probe::CounterClk);
        let bits = self.probes.bus(Probe::CounterInit).len();
        // The tap `borrow` makes the round of a counter twice as long; and twice more for one that takes its time.
        let most = (self.expected.step_periods as u32) << (bits + 2);
        let used = u64::MAX >> (LANES - self.codes.len());
        let code = |lanes: u64| self.codes[lanes.trailing_zeros() as usize];
        let mut high = self.kernel.value(self.local_stop).one;
        let starts_high = high;
        let mut counted: Vec<CountDownResult> = (0..self.codes.len())
            .map(|lane| CountDownResult {
                starts_high: starts_high >> lane & 1 == 1,
                ..CountDownResult::NEVER
            })
            .collect();
        let mut awaited = if holds { used & !high } else { used };
        for edge in 0..most {
            if awaited == 0 {
                break;
            }
            let counting = if holds { awaited } else { used };
            let rises_at = self.now;
            let moved = self.drive(&[(clk, all(true))], counting);
            let level = self.kernel.value(self.local_stop);
            let late = self.drive(&[(clk, all(false))], counting);
            let unknown = !(level.one | level.zero) & used;
            if unknown != 0 {
                return Err(Uneven::Unknown(code(unknown)));
            }
            let unclean = (moved.again | late.once) & used;
            if unclean != 0 {
                return Err(Uneven::Glitch(code(unclean)));
            }
            let mut rose = level.one & !high & used;
            high = level.one;
            while rose != 0 {
                let lane = rose.trailing_zeros() as usize;
                rose &= rose - 1;
                let of_lane = &mut counted[lane];
                if of_lane.rises[0].is_none() {
                    let change = moved.first.iter().find(|(_, lanes)| lanes >> lane & 1 == 1);
                    of_lane.delay = change.map(|&(time, _)| time - rises_at);
                }
                let place = of_lane.rises.iter_mut().find(|place| place.is_none());
                if let Some(place) = place {
                    *place = Some(edge);
                }
                if holds || of_lane.rises[1].is_some() {
                    awaited &= !(1 << lane);
                }
            }
        }
        Ok(counted)
    }
}

fn all(value: bool) -> Lanes {
    Lanes::from_bits(if value { u64::MAX } else { 0 })
}
