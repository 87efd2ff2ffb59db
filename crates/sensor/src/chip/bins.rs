//! Where bins begin and end, before a window is opened: at CLK edges, or at the taps of delay lines.

use std::sync::Arc;

use super::sensors::Sensor;
use crate::units::Time;

/// Where bins begin and end.
#[derive(Debug, Clone)]
pub(super) enum Bins {
    /// At rising CLK edges.
    Clk,
    /// At these times after the window opens, or, where delay lines time photons, before they are frozen; there is one more
    /// than there are bins. Start values take the lines in turn.
    Taps(Arc<[Vec<Time>]>),
}

impl Bins {
    /// Those of a macropixel with delay lines. What is at the last tap came first.
    pub(super) fn of_delay_lines(sensor: &Sensor, number: usize) -> Self {
        let taps = sensor.taps(number).expect("the TDC has delay lines");
        let line = |taps: &Vec<Time>| taps.iter().rev().map(|&tap| Time::ZERO - tap).collect();
        Bins::Taps(taps.iter().map(line).collect())
    }
}
