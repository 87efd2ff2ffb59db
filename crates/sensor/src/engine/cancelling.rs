//! Photons that cancel: two pulses of one SPAD between the same two CLK edges.
//!
//! ```text
//!   SPAD_RAW  ▁▁▁▔▁▁▁▔▁▁▁▁▁▁        CLK's next edge finds TOGGLE where the last one left it: both photons are lost
//!   TOGGLE    ▁▁▁▔▔▔▔▁▁▁▁▁▁▁
//!   CLK       ▔▁▁▁▁▁▁▁▁▁▔▔▔▔
//! ```
//!
//! Only a dead time shorter than a CLK period lets them (thesis 4.2: one toggle flip-flop for each SPAD). What engines
//! count has them left out, as the chip has; this tells how many there were. Which CLK edge takes a pulse is the window
//! law's to say, so that every engine reports the same.

use rayon::prelude::*;

use super::{PulsedPixel, Replay};
use crate::chip::{MOST_SPADS, SensorConfig, WindowLaw, window_law};
use crate::photon::SpadEvent;
use crate::units::{Frequency, Time};

/// Finds the pulses that cancel, in a sensor where some may.
#[derive(Debug, Clone)]
pub struct Cancelling {
    law: WindowLaw,
}

impl Cancelling {
    /// `None` where the dead time keeps the pulses of a SPAD farther apart than CLK edges; `law` is not asked for then. Nor is
    /// anything told of bins that are not CLK periods, of SPADs that share a wire, and of a front end or METDC of one's own.
    pub fn from_law(
        dead_time: Time,
        clock: Frequency,
        law: impl FnOnce() -> WindowLaw,
    ) -> Option<Self> {
        let law = (dead_time <= clock.period()).then(law)?;
        let sensor = law.sensor();
        let is_built_in = sensor.front_end_block.is_none() && sensor.metdc_block.is_none();
        let tells = law.has_clk_bins() && !sensor.front_end.joins() && is_built_in;
        tells.then_some(Cancelling { law })
    }

    /// Second pulses of the pairs among the pulses of a macropixel, with the CLK edge that would have taken them, counted
    /// from the exposure's first STOP edge; `pulses` are sorted by time.
    pub fn pairs<'p>(
        &'p self,
        pulses: &'p [SpadEvent],
    ) -> impl Iterator<Item = (i64, SpadEvent)> + 'p {
        let mut last = [None; MOST_SPADS];
        pulses.iter().filter_map(move |&pulse| {
            let edge = self.law.edge_of(pulse.time);
            let last = &mut last[usize::from(pulse.spad)];
            let cancels = *last == Some(edge);
            *last = (!cancels).then_some(edge);
            cancels.then_some((edge, pulse))
        })
    }

    /// How many of a macropixel's pulses cancel in the windows of this start value: two to a pair. All count where no
    /// single window says which matter.
    pub(crate) fn cancelled_pulses(&self, start: u16, pulses: &[SpadEvent]) -> u64 {
        let window = self.law.window(start);
        let is_seen = |edge: i64| match &window {
            window_law::WindowOutcome::Open(window) => {
                self.law.bins_of_edge(window, edge).next().is_some()
            }
            window_law::WindowOutcome::Never => false,
            window_law::WindowOutcome::Irregular(_) | window_law::WindowOutcome::Race(_) => true,
        };
        2 * self
            .pairs(pulses)
            .filter(|&(edge, _)| is_seen(edge))
            .count() as u64
    }
}

/// How many pulses of these macropixels cancel, two to a pair, in windows and outside.
pub fn cancelled<R: Replay + ?Sized>(
    engine: &R,
    config: &SensorConfig,
    pixels: &[PulsedPixel<'_>],
) -> u64 {
    let cancelling = Cancelling::from_law(config.pulse_width(), config.clock(), || engine.law());
    let Some(cancelling) = cancelling else {
        return 0;
    };
    let of_pixel = |pixel: &PulsedPixel<'_>| {
        let pulses = engine.as_the_law_sees(pixel.number, pixel.pulses);
        2 * cancelling.pairs(&pulses).count() as u64
    };
    pixels.par_iter().map(of_pixel).sum()
}
