//! Macropixels as options name them.

use crate::chip::SensorConfig;
use crate::files::InputError;

/// The macropixel that an option names as row,col.
///
/// # Errors
/// When the array has no such macropixel.
pub(super) fn pixel(
    option: &str,
    text: &str,
    sensor: &SensorConfig,
) -> Result<(usize, usize), InputError> {
    let place = text
        .split_once(',')
        .and_then(|(row, col)| Some((row.trim().parse().ok()?, col.trim().parse().ok()?)));
    let message = match place {
        Some((row, col)) if row < sensor.rows && col < sensor.cols => return Ok((row, col)),
        Some((row, col)) => format!(
            "macropixel ({row}, {col}) is outside the {}x{} array; give rows 0 to {} and columns 0 to {}",
            sensor.rows,
            sensor.cols,
            sensor.rows - 1,
            sensor.cols - 1
        ),
        None => format!("{text:?} is not a macropixel; give row,col such as 10,20"),
    };
    Err(InputError::new(option, message))
}
