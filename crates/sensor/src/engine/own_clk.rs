//! A macropixel's pulses by its own CLK.
//!
//! ```text
//!   CLK of column 0  ▔▔▁▁▔▔▁▁▔▔▁▁        what a macropixel does is the same at another time: the engines run all of them by
//!   CLK of column c  ▔▔▔▁▁▔▔▁▁▔▔▁        column 0's CLK, and pulses come earlier instead
//!                      └ Sensor::clk_skew(c)
//! ```

use std::borrow::Cow;

use crate::chip::Sensor;
use crate::photon::SpadEvent;
use crate::units::Time;

/// The pulses of macropixel `number` as one sees them to whose column CLK comes as to the first.
pub(super) fn by_own_clk<'p>(
    sensor: &Sensor,
    number: u32,
    pulses: &'p [SpadEvent],
) -> Cow<'p, [SpadEvent]> {
    let skew = sensor.clk_skew(number as usize % sensor.cols);
    if skew == Time::ZERO {
        return Cow::Borrowed(pulses);
    }
    let earlier = pulses.iter().map(|pulse| SpadEvent {
        time: pulse.time - skew,
        ..*pulse
    });
    earlier.collect()
}
