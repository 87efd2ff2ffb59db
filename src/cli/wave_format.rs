//! The option `--wave-format`.

use crate::waves::WaveFormat;

/// How a waveform is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub(super) enum WaveFormatOption {
    /// Value change dump: text that every tool reads.
    #[default]
    Vcd,
    /// GTKWave's compressed format, several times smaller.
    Fst,
}

impl From<WaveFormatOption> for WaveFormat {
    fn from(option: WaveFormatOption) -> Self {
        match option {
            WaveFormatOption::Vcd => WaveFormat::Vcd,
            WaveFormatOption::Fst => WaveFormat::Fst,
        }
    }
}
