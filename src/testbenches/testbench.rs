//! What a testbench is.

use std::path::Path;

use crate::files::InputError;
use crate::report::Checks;

/// A testbench.
#[derive(Debug, Clone, Copy)]
pub struct Testbench {
    /// Its name, which is also its waveform's.
    pub name: &'static str,
    /// What it is about, in a line.
    pub about: &'static str,
    /// Fills in the checks and writes the waveform to the path it is given, with the views beside it.
    pub(super) run: fn(&Path, &mut Checks) -> Result<(), InputError>,
}

impl Testbench {
    /// Runs it. The waveform goes to `waves`, in the format of its name; what belongs to it goes beside it.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub(crate) fn run(&self, waves: &Path) -> Result<Checks, InputError> {
        let mut checks = Checks::new();
        (self.run)(waves, &mut checks)?;
        Ok(checks)
    }
}
