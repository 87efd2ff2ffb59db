//! Photons of another laser's pulses: an inhomogeneous background, of which only the pulses are drawn that are asked for.
//!
//! A photon belongs to the laser cycle and slot in which it comes, as background does. `strays` draws them.

use std::ops::Range;
use std::sync::Arc;

use super::exposure::PhotonStream;
use super::schedule::Schedule;
use crate::photon::light::{MOST_PER_PULSE, PixelLight, PulseTrain};
use crate::photon::quantile::NormalSampler;
use crate::units::Time;

/// Mean photons of a SPAD in a pulse beyond which those that come later are not drawn: e⁻⁴⁰ of the SPADs would have seen none
/// before them, and all others are blind by then.
const MOST_PER_SPAD: f64 = 40.0;

/// When photons of another laser come.
#[derive(Debug, Clone)]
pub(super) struct Foreign {
    pub(super) schedule: Arc<Schedule>,
    pub(super) delay_fs: i64,
    /// Share of each pulse, its earliest photons, that is drawn.
    pub(super) share: f64,
}

impl Foreign {
    /// Those of a train, and how many of its `photons` a pulse are drawn. No photon comes farther than `reach_fs` from its pulse's centre.
    pub(super) fn new(
        train: &PulseTrain,
        stream: &PhotonStream,
        photons: f64,
        reach_fs: f64,
    ) -> (Self, f64) {
        let spads = &stream.config.spads;
        let most = MOST_PER_SPAD * spads.grid.spads() as f64;
        let is_blinding = 2.0 * reach_fs < spads.shortest_dead_time().as_fs() as f64;
        let (share, drawn) = if is_blinding && photons > most {
            (most / photons, most)
        } else {
            (1.0, photons.min(MOST_PER_PULSE))
        };
        let foreign = Foreign {
            schedule: stream.schedule(&train.laser),
            delay_fs: train.delay.as_fs(),
            share,
        };
        (foreign, drawn)
    }
}

impl PhotonStream {
    /// Light in which pulses of other lasers are echoes of single laser cycles, for those who see only what comes `within_fs` after the start
    /// of each; pulses at other times are left out. The times may begin before the cycle, by less than its length.
    pub fn with_trains_as_echoes(&self, light: &PixelLight, within_fs: Range<i64>) -> PixelLight {
        light.with_trains_as_echoes(|train| {
            let (schedule, delay_fs) = (self.schedule(&train.laser), train.delay.as_fs());
            let reach_fs = NormalSampler::new(train.sigma.as_fs() as f64)
                .reach()
                .ceil() as i64;
            let mut seen = Vec::new();
            // As the laser cycle itself has them, and the one before.
            for moved_fs in [0, self.cycle_fs()] {
                let from_fs = within_fs.start + moved_fs - reach_fs;
                let until_fs = (within_fs.end + moved_fs + reach_fs).min(self.cycle_fs() + 2);
                if from_fs < until_fs {
                    let pulses = schedule.arriving_within(from_fs.max(0)..until_fs, delay_fs);
                    seen.extend(pulses);
                }
            }
            seen.sort_unstable();
            seen.dedup();
            let arrivals = seen
                .into_iter()
                .filter_map(|pulse| schedule.arrival(pulse, delay_fs));
            arrivals
                .map(|(cycle, at_fs)| (cycle, Time::from_fs(at_fs)))
                .collect()
        })
    }
}
