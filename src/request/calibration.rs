//! A bin profile from a file.

use std::path::Path;

use crate::chip::{SensorConfig, Tdc};
use crate::files::{InputError, read_text};
use crate::ranging::BinProfile;

/// Reads a profile (JSON, as `gdtof calibrate` writes it), which must be of this sensor.
///
/// # Errors
/// A file that is none, and another sensor's.
pub fn read_calibration(path: &Path, sensor: &SensorConfig) -> Result<BinProfile, InputError> {
    let text = read_text(path)?;
    let profile: BinProfile = serde_json::from_str(&text).map_err(|error| {
        let message = format!("this is not a bin profile ({error}); make one with gdtof calibrate");
        InputError::at(path.display(), error.line(), message)
    })?;
    let is_whole = profile.macropixels.len() == profile.sensor.pixels()
        && profile.macropixels.iter().flatten().all(|line| {
            let lengths = [line.middle_s.len(), line.length_s.len()];
            lengths == [profile.sensor.bins; 2]
                && line
                    .length_s
                    .iter()
                    .chain(&line.middle_s)
                    .all(|s| s.is_finite())
        });
    let refused = match profile.check(sensor) {
        Ok(()) if sensor.tdc == Tdc::Clocked => {
            Some("it is of delay lines, and this sensor's TDC is clocked".to_owned())
        }
        Ok(()) if is_whole => None,
        Ok(()) => Some("it does not have every bin of every macropixel".to_owned()),
        Err(other) => Some(other.to_string()),
    };
    match refused {
        None => Ok(profile),
        Some(why) => {
            let message = format!("{why}; make one for this sensor with gdtof calibrate");
            Err(InputError::new(path.display(), message))
        }
    }
}
