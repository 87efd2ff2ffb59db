//! One laser cycle of an exposure at gate level, without the ones before it.
//!
//! ```text
//!   power-up, load │ at rest: counts of cycles 0 … k−2 are set │ end of cycle k−2 │ cycle k−1 │ cycle k │
//!                                                                CLK, SPADs         all        all, as in the whole run
//! ```
//!
//! A macropixel remembers little of earlier laser cycles. Each STOP edge resets its P-counter and HIT, the shift register
//! holds the CLK periods of a window, and front ends know a SPAD's earlier pulses by their parity at most. So the end of a laser
//! cycle, with one pulse for every SPAD that had an odd number of them before, and a whole laser cycle or two bring all of that
//! to where it would be. What is left are the counts: the window engine has them, as it equals the gates, and they are set in the
//! counters' flip-flops while the chip is at rest ([`Kernel::preset`](crate::kernel::Kernel::preset)).
//!
//! Where that is not so, all laser cycles are simulated: a P-counter without memory goes on through STOP edges, and some
//! windows only gates can tell. Tests compare every change of every net with the whole run's.

use super::gate::GateSimulation;
use super::{Histograms, PulsedPixel, Replay, Window};
use crate::chip::{Exposure, Mode, Sensor};
use crate::photon::SpadEvent;
use crate::stimulus::Skip;

/// Whole laser cycles that are simulated before the one that is wanted. In the conventional mode RUN first rises with a STOP edge, and a Gray
/// counter whose start value is 0 and which holds at its borrow stands still in the laser cycle that begins so, and counts in all later ones.
fn warm_up(mode: Mode) -> u32 {
    match mode {
        Mode::Guided => 1,
        Mode::Conventional => 2,
    }
}

/// CLK periods from a SPAD's pulse to the last stage of the shift register, besides the stages. The front end takes three.
const LATENCY: u32 = 8;

/// A simulation of the macropixel `at` (row, col) that is, from the STOP edge of laser cycle `cycle` on, that of the whole
/// exposure: same changes of every net at the same times. `start` and `pulses` are those of the whole exposure as well.
pub fn late_cycle(
    sensor: impl Into<Sensor>,
    exposure: &Exposure,
    at: (usize, usize),
    start: u16,
    pulses: &[SpadEvent],
    cycle: u32,
) -> GateSimulation {
    let sensor = &sensor.into();
    let whole = GateSimulation::new(sensor, exposure, at, (1, 1), &[start], &[pulses]);
    let Some(first_cycle) = cycle.checked_sub(warm_up(sensor.mode)) else {
        return whole;
    };
    let pixel = PulsedPixel {
        number: (at.0 * sensor.cols + at.1) as u32,
        start,
        pulses,
    };
    match counted_before(sensor, exposure, pixel, first_cycle) {
        None => whole,
        Some(counted) => {
            let busy = sensor.pulse_width() + sensor.longest_delay_line() + sensor.clk_skew(at.1);
            let busy = busy.as_fs() / exposure.clock.period().as_fs() + 1;
            let skip = Skip {
                first_cycle,
                lead_periods: sensor.bins as u32 + LATENCY + busy as u32,
            };
            whole.skipping(skip, &counted)
        }
    }
}

/// What is counted before the STOP edge of laser cycle `cycle`, where that follows from the window law.
fn counted_before(
    sensor: &Sensor,
    exposure: &Exposure,
    pixel: PulsedPixel<'_>,
    cycle: u32,
) -> Option<Histograms> {
    // Random chips in a library's cells, near their limits, had another HIT before the cycle than in the whole run.
    let is_of_library = sensor.silicon().cell_library.from_file().is_some();
    if !sensor.p_counter.row().has_memory || is_of_library {
        return None;
    }
    // In the conventional mode the STOP edge that ends a laser cycle counts it.
    let laser_cycles = match sensor.mode {
        Mode::Guided => cycle,
        Mode::Conventional => cycle.checked_sub(1)?,
    };
    if laser_cycles == 0 {
        return None;
    }
    let part = Exposure {
        laser_cycles,
        ..*exposure
    };
    // The last window of a column to which CLK comes late ends later.
    let until = part.end() + sensor.clk_skew(pixel.number as usize % sensor.cols);
    let end = pixel.pulses.partition_point(|pulse| pulse.time < until);
    let window = Window::new(sensor, &part);
    let pixel = PulsedPixel {
        pulses: &pixel.pulses[..end],
        ..pixel
    };
    window.replay(&[pixel]).ok()
}
