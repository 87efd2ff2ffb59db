//! Range walk: how far pile-up moves a peak, from what is known of the pulse and the SPADs.
//!
//! SPADs that fired in the early part of a strong echo are blind for its late part, and a bin counts once a laser
//! cycle however many photons come. So the centre of mass lies before the echo's centre, the more the brighter
//! it is. The walk is the distance between the two in the mean histogram of such an echo ([`Response`]). Its light is not
//! known, but follows from the histogram:
//!
//! * the background from the counts per bin outside the peak,
//! * arrival and signal such that the mean histogram has its peak where, and with as many counts as, the measured one.
//!
//! The same peak region and the same background estimate are used in both histograms, so that whatever else they do to
//! the centre of mass (a tail cut off, a pulse of few bins) is taken out, too. What is left is the noise of the counts.
//!
//! The thesis assumes pile-up away (3.2.2); the correction is ours.

use super::expected::{EchoLight, Response};
use super::peak::{Peak, PeakOptions, interpolate_at};

/// Most rounds of matching arrival and signal. Most take fewer; counts that hardly rise with the signal take them all.
const ROUNDS: usize = 12;

/// Bins and relative counts to which arrival and signal are matched: 0.1 mm at 384 MHz, where counting noise is millimetres.
const CLOSE: f64 = 3e-4;

/// Photons of an echo beyond which its counts no longer tell how many: each SPAD has fired for certain.
const MOST_SIGNAL: f64 = 64.0;

/// A correction is at most so many bins. Walk is below a quarter of a bin up to 12 photons an echo; what wants more is an
/// echo that the edge of the histogram cuts in two.
const MOST_BINS: f64 = 1.0;

/// Takes the range walk out of peaks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WalkCorrection {
    /// What the macropixels make of light.
    pub response: Response,
    /// Laser cycles of the exposure.
    pub laser_cycles: u32,
    /// How the peaks were found.
    pub peak: PeakOptions,
}

/// A peak after correction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corrected {
    /// Position without walk, bins.
    pub position_bins: f64,
    /// The light that gives such a peak.
    pub light: EchoLight,
}

impl WalkCorrection {
    /// Corrects a peak; `None` where no light gives such counts, or not this light alone.
    pub fn correct(&self, measured: &Peak) -> Option<Corrected> {
        let cycles = f64::from(self.laser_cycles);
        let background_per_bin = self
            .response
            .background_for(measured.background_per_bin / cycles)?;
        let mut light = EchoLight {
            position_bins: measured.position_bins,
            signal: measured.signal_counts / cycles,
            background_per_bin,
        };
        // How ln counts answer to ln signal: as 1 without pile-up.
        let mut slope: f64 = 1.0;
        let mut before: Option<(f64, f64)> = None;
        for _ in 0..ROUNDS {
            let chances = self.response.chances(&light);
            let counts: Vec<f64> = chances.iter().map(|chance| chance * cycles).collect();
            let modelled = interpolate_at(&counts, measured.peak_bin, &self.peak)?;
            let off_bins = measured.position_bins - modelled.position_bins;
            let off_counts = (measured.signal_counts / modelled.signal_counts).ln();
            let ln_signal = light.signal.ln();
            if let Some((signal_then, counts_then)) = before
                && (ln_signal - signal_then).abs() > 1e-6
            {
                let secant =
                    (modelled.signal_counts.ln() - counts_then) / (ln_signal - signal_then);
                slope = secant.clamp(0.2, 1.5);
            }
            before = Some((ln_signal, modelled.signal_counts.ln()));
            light.position_bins = (light.position_bins + off_bins).clamp(
                measured.position_bins - MOST_BINS,
                measured.position_bins + MOST_BINS,
            );
            light.signal = (ln_signal + off_counts / slope).exp().min(MOST_SIGNAL);
            if off_bins.abs() < CLOSE && off_counts.abs() < CLOSE {
                break;
            }
        }
        Some(Corrected {
            position_bins: light.position_bins,
            light,
        })
    }
}
