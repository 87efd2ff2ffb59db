//! Photon line: all SPADs of a macropixel on one line, on which every pulse is an edge (thesis 2.4.1, Fig. 22b). It is the
//! front end of a TDC that a delay line times, and knows no CLK. That HSLIDAR has it is chosen: the thesis does not say how its SPADs
//! come together (4.9.3).
//!
//! ```text
//!                 toggle
//!               ┌────────┐
//!            ┌─►│D      Q├──► XOR ─┐
//!            └──┤QN      │   ┌►    ├─► XOR ─► … ─► driver ─► PHOTONS
//!   SPAD_RAW ──►│>       │   │  … ─┘
//!               └────────┘  other SPADs
//! ```
//!
//! Timing: the XORs and the driver are laid out to switch equally fast either way, because what counts is when an edge comes, and
//! every SPAD passes as many of them. Two pulses closer than an XOR's delay meet at the one that joins their SPADs and leave no
//! edge there: it has no time to switch. Pulses that come between the same two taps of the delay line cancel as well.

use std::ops::Range;
use std::sync::Arc;

use smallvec::SmallVec;

use super::{finished, front_end};
use crate::netlist::{CellKind, Module, ModuleBuilder, OwnDelay};
use crate::units::Time;

/// Delay of an XOR or the driver in the typical corner: between those of the library's XOR to either side.
const STAGE: Time = Time::from_fs(57_553);

/// The photon line of `spads` SPADs, a power of two.
///
/// Ports: SPAD_RAW\<SPADs\>, PIXEL_CLEAR → PHOTONS.
pub fn circuit(spads: usize) -> Arc<Module> {
    debug_assert!(spads.is_power_of_two(), "every SPAD passes as many XORs");
    let toggle = front_end::xor_tree::toggle();
    let mut m = ModuleBuilder::new("photon_line");
    let raw = m.input_bus("SPAD_RAW", spads);
    m.input("PIXEL_CLEAR");
    let photons = m.output("PHOTONS");
    let mut level = m.wire_bus("TOGGLES", spads);
    for spad in 0..spads {
        let ports = [
            ("SPAD_RAW", &raw[spad..=spad]),
            ("TOGGLE", &level[spad..=spad]),
        ];
        m.instance_by_names(&format!("spad_{spad}"), &toggle, &ports);
    }
    let stage = OwnDelay::balanced(STAGE);
    while level.len() > 1 {
        let joined = m.wire_bus(&format!("OF_{}", 2 * spads / level.len()), level.len() / 2);
        for (pair, (inputs, &output)) in level.chunks(2).zip(&joined).enumerate() {
            let name = format!("xor_{}_{pair}", 2 * spads / level.len());
            m.cell_with_delay(&name, CellKind::Xor2, inputs, &[output], stage);
        }
        level = joined;
    }
    m.cell_with_delay("driver", CellKind::Buf, &level, &[photons], stage);
    finished(m.finish())
}

/// Longest time by which a pulse may come before or after another one and decide, with others in between, whether that one leaves an
/// edge: eight SPADs would have to fire within an XOR's delay (60 ps) of each other, one after the other.
pub const REACH: Time = Time::from_ps(500);

/// Delay of each stage of a line of `spads` SPADs, from the delay of the whole, TOGGLE → PHOTONS. Stages are an XOR
/// for each halving of the SPADs, and the driver. Where cells differ it is the average.
pub(crate) fn stage(toggle_to_photons: Time, spads: usize) -> Time {
    let stages = i64::from(spads.trailing_zeros()) + 1;
    Time::from_fs(toggle_to_photons.as_fs() / stages)
}

/// Reference model: keeps the pulses that leave an edge on the line of `spads` SPADs, whose XORs take `stage`. `of`
/// gives the time and the SPAD of a pulse; pulses are sorted by both. An edge comes all stages later than its pulse.
pub fn model<P: Copy>(
    pulses: &mut Vec<P>,
    time_and_spad: impl Fn(&P) -> (Time, u8),
    spads: usize,
    stage: Time,
) {
    let mut left = 0;
    let mut first = 0;
    while let Some(pulse) = pulses.get(first) {
        let mut last_time = time_and_spad(pulse).0;
        let near = pulses[first + 1..].iter().take_while(|pulse| {
            let time = time_and_spad(pulse).0;
            let is_near = time < last_time + stage;
            last_time = time;
            is_near
        });
        let end = first + 1 + near.count();
        // Pulses that are no delay apart decide about each other, and about no others; two leave no edge.
        if end - first == 1 {
            pulses[left] = pulses[first];
            left += 1;
        } else if end - first > 2 || spads == 1 {
            let together = (first..end).map(|at| {
                let (time, spad) = time_and_spad(&pulses[at]);
                (time, spad, at)
            });
            for (_, _, at) in edges(&together.collect::<Together>(), 0..spads as u8, stage) {
                pulses[left] = pulses[at];
                left += 1;
            }
        }
        first = end;
    }
    pulses.truncate(left);
}

/// Time, SPAD and number of pulses; more than two are seldom together.
type Together = SmallVec<[(Time, u8, usize); 4]>;

/// Edges on the net that joins a range of SPADs.
fn edges(pulses: &[(Time, u8, usize)], spads: Range<u8>, stage: Time) -> Together {
    if pulses.len() <= 1 || spads.len() == 1 {
        return pulses.into();
    }
    let middle = spads.start + (spads.end - spads.start) / 2;
    let is_low = |pulse: &(Time, u8, usize)| pulse.1 < middle;
    let (low, high): (Together, Together) = pulses.iter().copied().partition(is_low);
    let mut inputs = edges(&low, spads.start..middle, stage);
    inputs.extend(edges(&high, middle..spads.end, stage));
    inputs.sort_unstable();
    let mut outputs = Together::new();
    for input in inputs {
        // An edge that is still on its way through the XOR is taken back.
        match outputs.last() {
            Some(pending) if input.0 < pending.0 + stage => {
                outputs.pop();
            }
            _ => outputs.push(input),
        }
    }
    outputs
}
