//! Pulses as a waveform (VCD, IEEE 1364): SPAD wires, STOP and CLK of one macropixel.
//!
//! ```text
//!   STOP        ▔▔▔▔▔▔▔▔▔▔▁▁▁▁▁▁▁▁▁▁▔▔▔▔   rises with each laser pulse, falls half a laser cycle later
//!   CLK         ▁▔▁▔▁▔▁▔▁▔▁▔▁▔▁▔▁▔▁▔▁▔▁▔   falls with the first one (or before it, by the phase of STOP)
//!   SPAD_RAW_3  ▁▁▁▔▔▔▔▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁   high for the shortest dead time
//! ```
//!
//! Times are femtoseconds from the first laser pulse. Wires are scalars, because a change of one bit of a bus writes all of it.

use std::collections::VecDeque;
use std::io::{self, Write};

use super::lines::PixelWriter;
use super::source::LightSource;
use crate::photon::SpadEvent;
use crate::units::{Frequency, Time};

/// Bytes of a change and its time, about.
pub(super) const CHANGE_BYTES: f64 = 17.0;

/// A waveform.
pub(super) struct Vcd<'a, W> {
    out: W,
    source: &'a LightSource,
    /// Last time that was written.
    stamp: Option<Time>,
    /// Next edge of STOP, by number: even ones rise.
    stop: u64,
    clk: Option<Clk>,
    /// When SPADs fall, in that order: all pulses are as long.
    falls: VecDeque<SpadEvent>,
}

/// Next edge of CLK.
struct Clk {
    clock: Frequency,
    phase: Time,
    /// Its number: even ones fall.
    next: i64,
}

impl Clk {
    fn time(&self) -> Time {
        self.clock.half_periods(self.next) - self.phase
    }
}

/// The wires: STOP, CLK, and SPADs from number 2 on.
const STOP: u8 = 0;
const CLK: u8 = 1;

/// The identifier code of a wire: one printable character.
fn code(wire: u8) -> char {
    char::from(b'!' + wire)
}

impl<'a, W: Write> Vcd<'a, W> {
    /// Begins a waveform of the macropixel at a row and column.
    pub(super) fn begin(
        mut out: W,
        source: &'a LightSource,
        (row, col): (usize, usize),
        has_clk: bool,
    ) -> io::Result<Self> {
        writeln!(out, "$version\n    {}\n$end", crate::ORIGIN.program)?;
        writeln!(out, "$timescale 1 fs $end")?;
        writeln!(out, "$scope module macropixel_r{row}_c{col} $end")?;
        let mut wires = vec![(STOP, "STOP".to_owned())];
        if has_clk {
            wires.push((CLK, "CLK".to_owned()));
        }
        let spads = 0..source.exposure.layout.spads() as u8;
        wires.extend(spads.map(|spad| (spad + 2, format!("SPAD_RAW_{spad}"))));
        for (wire, name) in &wires {
            writeln!(out, "$var wire 1 {} {name} $end", code(*wire))?;
        }
        writeln!(out, "$upscope $end\n$enddefinitions $end\n#0\n$dumpvars")?;
        let mut vcd = Vcd {
            out,
            source,
            stamp: Some(Time::ZERO),
            stop: 1,
            clk: has_clk.then_some(Clk {
                clock: source.exposure.clk,
                phase: source.exposure.clk_phase,
                next: 0,
            }),
            falls: VecDeque::new(),
        };
        let mut clk_level = 0;
        if let Some(clk) = &mut vcd.clk {
            // The level at time 0 is that after its last edge until then.
            while clk.time() <= Time::ZERO {
                clk_level = clk.next & 1;
                clk.next += 1;
            }
        }
        for (wire, _) in wires {
            let level = match wire {
                STOP => 1,
                CLK => clk_level,
                _ => 0,
            };
            writeln!(vcd.out, "{level}{}", code(wire))?;
        }
        writeln!(vcd.out, "$end")?;
        Ok(vcd)
    }

    fn change(&mut self, time: Time, wire: u8, level: i64) -> io::Result<()> {
        if self.stamp != Some(time) {
            writeln!(self.out, "#{}", time.as_fs())?;
            self.stamp = Some(time);
        }
        writeln!(self.out, "{level}{}", code(wire))
    }

    /// When STOP's next edge comes; one more rises at the end of the exposure, which is not shown.
    fn stop_time(&self) -> Time {
        let cycle = (self.stop / 2) as u32;
        let start = self.source.cycle_start(cycle);
        match self.stop & 1 {
            0 => start,
            _ => {
                let next = self.source.cycle_start(cycle + 1);
                start + Time::from_fs((next - start).as_fs() / 2)
            }
        }
    }

    /// Writes what STOP, CLK and falling SPADs do before a time, or at it. A wire that falls and rises at one time has fallen first.
    fn advance(&mut self, until: Time) -> io::Result<()> {
        loop {
            let stop = self.stop_time();
            let clk = self.clk.as_ref().map(Clk::time);
            let fall = self.falls.front().map(|fall| fall.time);
            let others = [clk, fall].into_iter().flatten();
            let next = others.fold(stop, Time::min);
            if next > until {
                return Ok(());
            }
            if stop == next {
                let level = 1 - (self.stop & 1) as i64;
                self.stop += 1;
                self.change(next, STOP, level)?;
            } else if fall == Some(next) {
                let spad = self.falls.pop_front().map_or(0, |fall| fall.spad);
                self.change(next, spad + 2, 0)?;
            } else if let Some(clk) = &mut self.clk {
                let level = clk.next & 1;
                clk.next += 1;
                self.change(next, CLK, level)?;
            }
        }
    }
}

impl<W: Write> PixelWriter for Vcd<'_, W> {
    fn write(&mut self, pulses: &[SpadEvent]) -> io::Result<()> {
        let width = self.source.pulse_width();
        for pulse in pulses {
            self.advance(pulse.time)?;
            self.change(pulse.time, pulse.spad + 2, 1)?;
            self.falls
                .push_back(SpadEvent::new(pulse.time + width, pulse.spad));
        }
        Ok(())
    }

    fn finish(&mut self) -> io::Result<u64> {
        let end = self.source.end();
        self.advance(end - Time::from_fs(1))?;
        if self.stamp != Some(end) {
            writeln!(self.out, "#{}", end.as_fs())?;
        }
        self.out.flush()?;
        Ok(0)
    }
}
