//! The program that files name as their writer.

/// Names that waveforms, layouts, activity and delay files carry in their heads: by default those of this library.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Origin {
    /// Project or maker.
    pub vendor: &'static str,
    /// Program.
    pub program: &'static str,
    /// Version of the program.
    pub version: &'static str,
}

impl Default for Origin {
    fn default() -> Self {
        Origin {
            vendor: env!("CARGO_PKG_NAME"),
            program: env!("CARGO_PKG_NAME"),
            version: env!("CARGO_PKG_VERSION"),
        }
    }
}

impl Origin {
    /// Vendor and version, as waveforms name them.
    pub(crate) fn vendor_and_version(self) -> String {
        format!("{} {}", self.vendor, self.version)
    }
}
