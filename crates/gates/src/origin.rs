//! The program that files name as their writer.

use std::sync::OnceLock;

/// Names that waveforms, layouts, activity and delay files carry in their heads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Origin {
    /// Project or maker.
    pub vendor: &'static str,
    /// Program.
    pub program: &'static str,
    /// Version of the program.
    pub version: &'static str,
}

static ORIGIN: OnceLock<Origin> = OnceLock::new();

impl Origin {
    /// Files that this process writes from now on carry these names. The first call counts; without one, files carry the
    /// name and version of this library.
    pub fn sign_files(self) {
        ORIGIN.get_or_init(|| self);
    }

    pub(crate) fn of_files() -> Origin {
        *ORIGIN.get().unwrap_or(&Origin {
            vendor: env!("CARGO_PKG_NAME"),
            program: env!("CARGO_PKG_NAME"),
            version: env!("CARGO_PKG_VERSION"),
        })
    }

    /// Vendor and version, as waveforms name them.
    pub(crate) fn vendor_and_version(self) -> String {
        format!("{} {}", self.vendor, self.version)
    }
}
