//! The load of a frame's start values, checked.

use super::error::FrameError;
use crate::chip::SensorConfig;
use crate::engine::load;
use crate::netlist::Netlist;

/// Sends start values through the serial pin of the load path, at gate level.
///
/// # Errors
/// Another start value in the array than was sent.
pub(super) fn load_starts(
    sensor: &SensorConfig,
    load_netlist: &Netlist,
    starts: &[u16],
) -> Result<load::Load, FrameError> {
    let load = load::load(sensor, load_netlist, starts, &mut ());
    let mut arrived = starts.iter().zip(&load.starts).enumerate();
    let wrong = arrived.find(|(_, (sent, found))| **found != Some(**sent));
    match wrong {
        None => Ok(load),
        Some((pixel, (&sent, &found))) => Err(FrameError::Load {
            row: pixel / sensor.cols,
            col: pixel % sensor.cols,
            sent,
            found,
        }),
    }
}
