//! The waveform: three intervals in clock counter, ring oscillator and delay line at once, and their codes against the models.
//!
//! The intervals are shorter than a step of the ring, longer than one but within the line, and far beyond the line.

use std::path::Path;

use super::converter::{BEGIN, BITS, CLEARED, CODES, SIGMA, STAGES, build};
use crate::chip::tdc::{clock_counter, delay_line, ring_oscillator};
use crate::engine::waveform::write_waves;
use crate::files::InputError;
use crate::netlist::ModuleBuilder;
use crate::report::Checks;
use crate::testbenches::rig::{self, finished};
use crate::units::{Frequency, Time};
use crate::waves::{Entry, Layout, Mark, SignalGroup};

/// From one interval's beginning to the next one's.
const SLOT: Time = Time::from_ns(40);

/// Three intervals in all converters at once.
pub(super) fn run(waves: &Path, checks: &mut Checks) -> Result<(), InputError> {
    let clock = Frequency::from_hz_f64(384e6).expect("a frequency");
    let intervals = [
        Time::from_ps(600),
        Time::from_ps(1_200),
        Time::from_ps(15_000),
    ];
    let mut m = ModuleBuilder::new("tdcs");
    let [start, stop, clear, clk] =
        ["START", "STOP", "TDC_RESET", "CLK"].map(|name| [m.input(name)]);
    let pins = [
        ("START", &start[..]),
        ("STOP", &stop),
        ("TDC_RESET", &clear),
    ];
    let with_clk: Vec<_> = pins.into_iter().chain([("CLK", &clk[..])]).collect();
    m.instance("clock_counter", &clock_counter::circuit(BITS), &with_clk);
    m.instance("ring", &ring_oscillator::circuit(STAGES, BITS), &pins);
    m.instance("line", &delay_line::circuit(CODES), &pins);
    let rig = build(&finished(m), SIGMA, 1);

    let mut drives = rig.power_up();
    for (slot, &interval) in (0..).zip(&intervals) {
        let at = SLOT * slot;
        let fall = at + SLOT - Time::from_ns(5);
        drives.pulse(rig.net("TDC_RESET"), at + Time::from_fs(1), at + CLEARED);
        drives.pulse(rig.net("START"), at + BEGIN, fall);
        let stop = at + BEGIN + interval;
        drives.pulse(rig.net("STOP"), stop, fall + Time::from_ns(2));
    }
    let end = SLOT * intervals.len() as i64;
    let edges = (1..)
        .map(|k| (clock.half_periods(k), k % 2 == 0))
        .take_while(|edge| edge.0 < end);
    edges.for_each(|(time, level)| drives.set(time, rig.net("CLK"), level));
    let nets = ["ring.CODE", "line.SEEN"].map(|path| rig.bus(path));
    let models = [
        ring_oscillator::RingOscillatorModel::from_netlist(&rig.netlist, &rig.timing, "ring")
            .steps(1 << BITS),
        delay_line::model(&rig.netlist, &rig.timing, "line"),
    ];
    let (mut kernel, mut stimulus) = (rig.kernel(), drives.sorted());
    let mut found = Vec::new();
    write_waves(waves, &rig.netlist, &view(), |waves| {
        for slot in 1..=intervals.len() as i64 {
            let read = SLOT * slot - Time::from_ns(6);
            rig::run(&mut kernel, &mut stimulus, read, waves);
            found.push(nets.each_ref().map(|nets| kernel.number(nets)));
        }
        rig::run(&mut kernel, &mut stimulus, end, waves);
        end
    })?;
    for (&interval, found) in intervals.iter().zip(found) {
        let expected = models.each_ref().map(|steps| steps.code(interval));
        let ones = found[1].map(|seen| seen.count_ones() as usize);
        let found = [found[0].map(|code| code as usize), ones];
        checks.add_verdict(
            format!("{interval} in the waveform: codes of ring and line"),
            format!("{} and {}", expected[0], expected[1]),
            found
                .map(|code| code.map_or("unknown".to_owned(), |n| n.to_string()))
                .join(" and "),
            found == expected.map(Some),
        );
    }
    Ok(())
}

/// When an interval begins.
fn begin(slot: i64) -> Time {
    SLOT * slot + BEGIN
}

fn view() -> Layout {
    let group = |title: &str, entries: &[Entry]| SignalGroup::new(title, entries.iter().cloned());
    Layout {
        groups: vec![
            group(
                "Interval",
                &["START", "STOP", "TDC_RESET", "CLK"].map(Entry::binary),
            ),
            group(
                "Clock counter",
                &[
                    Entry::binary("clock_counter.GATE"),
                    Entry::binary("clock_counter.GATED_CLK"),
                    Entry::decimal("clock_counter.CODE"),
                ],
            ),
            group(
                "Gated ring oscillator",
                &[
                    Entry::binary("ring.GATE"),
                    Entry::hex("ring.RING"),
                    Entry::decimal("ring.CODE"),
                ],
            ),
            group(
                "Delay line",
                &[Entry::hex("line.TAP"), Entry::hex("line.SEEN")],
            ),
        ],
        // The third interval, in which all of them count.
        zoom: (begin(2) - Time::from_ns(2), begin(2) + Time::from_ns(22)),
        marker: Some(begin(2)),
        marks: [0, 1, 2]
            .map(|slot| Mark::new(begin(slot), format!("interval {}", slot + 1)))
            .to_vec(),
    }
}
