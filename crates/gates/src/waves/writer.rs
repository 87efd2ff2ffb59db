//! The writer of waveforms: an observer of the kernel that finds out what a file has to say, in any format.
//!
//! One instant of simulated time is written as a whole, when the next one begins. Changes within
//! it are only noted; then each net is compared with what the file last said of it. So a glitch
//! of zero width leaves no trace, a value is never repeated (a viewer would draw a repetition as
//! a toggle), a bus of which several bits change gets one entry, and a time is written only if a
//! change follows it.
//!
//! ```text
//!   change(t, net, v) ─► nets[net].now = v, once on `changed`
//!   t advances ────────► changed ─► differs from nets[net].written? ─► scalar, and every bus it is a bit of
//!                                                                                       │
//!                                                                        Format: VCD bytes, FST blocks
//! ```
//!
//! A file may keep a span of the simulation. It then begins at the span's first instant with the values that all
//! signals have there, in absolute time: nothing before is written, but all of it is seen.
//!
//! Trap: the nets are taken to be unknown when the writer is made; it must observe the simulation from its start.

use std::io;
use std::ops::RangeInclusive;

use super::variables::{BusBit, NO_VARIABLE, Variable, Variables};
use crate::kernel::Observer;
use crate::logic::Logic;
use crate::netlist::{NetId, Netlist};
use crate::units::Time;

/// Character of each value, indexed by [`Logic::bits`].
const CHARACTERS: [u8; 4] = *b"01xz";

/// How a file says what changes. Values are characters of `01xz`, times only grow, and an error is kept for the end.
pub trait Format {
    /// What the file is written to.
    type Out;

    /// The file begins at `time`; the values of all variables follow, then [`Format::begun`].
    fn begin(&mut self, time: Time);

    /// All first values have been reported.
    fn begun(&mut self);

    /// The changes that follow are at `time`.
    fn time(&mut self, time: Time);

    /// A variable of one net has a value.
    fn scalar(&mut self, variable: u32, value: u8);

    /// A variable of several nets has these values, most significant first.
    fn bus(&mut self, variable: u32, values: &[u8]);

    /// All changes of an instant have been reported.
    fn end_instant(&mut self);

    /// The file ends at `end`, which is not before the last change.
    ///
    /// # Errors
    /// The first error since the file was begun.
    fn finish(self, end: Time) -> io::Result<Self::Out>;
}

/// What the writer knows of one net.
#[derive(Clone, Copy)]
struct NetState {
    /// The variable that shows it alone, or [`NO_VARIABLE`].
    scalar: u32,
    /// Present value, as a character.
    now: u8,
    /// The value that the file shows, as a character.
    written: u8,
    /// Already on the list of changed nets; or not shown at all, and never to be put there.
    is_settled: bool,
}

/// Writes the waveform of a simulation that it observes, in the format `F`.
pub struct WaveWriter<F: Format> {
    format: F,
    kept: RangeInclusive<Time>,
    has_begun: bool,
    /// The instant whose changes are being collected.
    now: Time,
    /// The last time written.
    stamped: Time,
    nets: Vec<NetState>,
    changed: Vec<u32>,
    variables: Vec<Variable>,
    variable_nets: Vec<u32>,
    /// What the file shows of each of `variable_nets`, as a character. Of buses alone; scalars need it once.
    variable_values: Vec<u8>,
    changed_buses: Vec<u32>,
    /// Bits of buses that net `n` is: `bus_bits[bus_bits_start[n]..bus_bits_start[n + 1]]`.
    bus_bits: Vec<BusBit>,
    bus_bits_start: Vec<u32>,
}

impl<F: Format> WaveWriter<F> {
    /// A writer of these variables of `netlist`, which `format` has declared.
    pub(super) fn from_variables(format: F, netlist: &Netlist, variables: Variables) -> Self {
        let (bus_bits_start, bus_bits) = variables.bus_bits();
        let unknown = CHARACTERS[Logic::X as usize];
        let nets: Vec<NetState> = variables
            .scalar_of_net
            .iter()
            .zip(bus_bits_start.windows(2))
            .map(|(&scalar, buses)| NetState {
                scalar,
                now: unknown,
                written: unknown,
                is_settled: scalar == NO_VARIABLE && buses[0] == buses[1],
            })
            .collect();
        debug_assert_eq!(nets.len(), netlist.net_count());
        WaveWriter {
            format,
            kept: Time::ZERO..=Time::MAX,
            has_begun: false,
            now: Time::from_fs(-1),
            stamped: Time::ZERO,
            nets,
            changed: Vec::new(),
            variables: variables.all,
            variable_values: vec![unknown; variables.nets.len()],
            variable_nets: variables.nets,
            changed_buses: Vec::new(),
            bus_bits,
            bus_bits_start,
        }
    }

    /// Keeps only this span of the simulation, which begins no earlier than time 0.
    pub fn keep(mut self, span: RangeInclusive<Time>) -> Self {
        debug_assert!(*span.start() >= Time::ZERO);
        self.kept = span;
        self
    }

    /// Writes what is pending and marks the end of the simulation (or of the span that is kept, if that is
    /// earlier), so that viewers show the last values up to there.
    ///
    /// # Errors
    /// The first error of the underlying writer since the start; the file is then incomplete.
    pub fn finish(mut self, end: Time) -> io::Result<F::Out> {
        let end = end.min(*self.kept.end()).max(self.now);
        if !self.has_begun {
            self.begin(end.min(*self.kept.start()).max(Time::ZERO));
        }
        self.write_instant();
        self.format.finish(end.max(self.stamped))
    }

    /// Leaves the present instant for a later one.
    fn advance(&mut self, time: Time) {
        if self.has_begun {
            self.write_instant();
        } else if time >= *self.kept.start() {
            self.begin(*self.kept.start());
        }
        self.now = time;
    }

    /// Begins the file with all present values.
    fn begin(&mut self, time: Time) {
        self.has_begun = true;
        self.stamped = time;
        for &net in &self.changed {
            let state = &mut self.nets[net as usize];
            state.is_settled = false;
            state.written = state.now;
        }
        self.changed.clear();
        self.format.begin(time);
        for (value, &net) in self.variable_values.iter_mut().zip(&self.variable_nets) {
            *value = self.nets[net as usize].now;
        }
        for (index, variable) in (0..).zip(&self.variables) {
            match &self.variable_values[variable.nets.clone()] {
                [value] => self.format.scalar(index, *value),
                values => self.format.bus(index, values),
            }
        }
        self.format.begun();
    }

    /// Writes the changes of the instant that ends.
    fn write_instant(&mut self) {
        for &net in &self.changed {
            let state = &mut self.nets[net as usize];
            state.is_settled = false;
            if state.now == state.written {
                continue;
            }
            state.written = state.now;
            let NetState { scalar, now, .. } = *state;
            if self.stamped != self.now {
                self.stamped = self.now;
                self.format.time(self.now);
            }
            if scalar != NO_VARIABLE {
                self.format.scalar(scalar, now);
            }
            let bits = &self.bus_bits_start[net as usize..][..2];
            for bit in &self.bus_bits[bits[0] as usize..bits[1] as usize] {
                self.variable_values[bit.place as usize] = now;
                let bus = &mut self.variables[bit.variable as usize];
                if !bus.is_changed {
                    bus.is_changed = true;
                    self.changed_buses.push(bit.variable);
                }
            }
        }
        self.changed.clear();
        for &index in &self.changed_buses {
            let bus = &mut self.variables[index as usize];
            bus.is_changed = false;
            let values = &self.variable_values[bus.nets.clone()];
            self.format.bus(index, values);
        }
        self.changed_buses.clear();
        self.format.end_instant();
    }
}

impl<F: Format> Observer for WaveWriter<F> {
    #[inline]
    fn change(&mut self, time: Time, net: NetId, value: Logic) {
        if time > *self.kept.end() {
            return;
        }
        // A change in the past counts as one of the present: a file's times never go back.
        if time > self.now {
            self.advance(time);
        }
        let state = &mut self.nets[net.index()];
        state.now = CHARACTERS[value as usize];
        if !state.is_settled {
            state.is_settled = true;
            self.changed.push(net.index() as u32);
        }
    }
}
