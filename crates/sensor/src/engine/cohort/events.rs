//! What makes an event of SPADs that fire in one bin.

use smallvec::SmallVec;

use super::cycles::CohortLight;
use crate::chip::{SensorConfig, Tdc, correlation};
use crate::engine::{EngineError, NotModelled};
use crate::units::Time;

/// Whether 0, 1, 2, … SPADs that fire in a CLK period make an event, up to all of a macropixel.
#[derive(Debug, Clone)]
pub(super) struct EventTable(pub(super) SmallVec<[bool; 17]>);

impl EventTable {
    /// By TYPE and THRESHOLD, or, where delay lines time photons, an odd number: each SPAD turns the photon line over.
    pub(super) fn from_sensor(sensor: &SensorConfig) -> Self {
        Self::new(sensor.spads(), |fired| match sensor.tdc {
            Tdc::DelayLine => fired % 2 == 1,
            // With a counter TDC nothing is drawn.
            Tdc::Clocked | Tdc::Counter => {
                let spads = ((1u128 << fired) - 1) as u64;
                correlation::model(spads, sensor.event_type, sensor.threshold)
            }
        })
    }

    pub(super) fn new(spads: usize, is_event: impl Fn(usize) -> bool) -> Self {
        EventTable((0..=spads).map(is_event).collect())
    }

    /// SPADs of a macropixel.
    pub(super) fn spads(&self) -> usize {
        self.0.len() - 1
    }

    /// Whether one SPAD makes an event, and more do, too.
    pub(super) fn is_any_spad(&self) -> bool {
        let mut counts = self.0.iter().enumerate();
        counts.all(|(spads, &is_event)| is_event == (spads > 0))
    }

    /// What tells bins without an event from the others, where it is so simple: events of any SPAD, and of odd numbers.
    pub(super) fn no_event(&self) -> Option<NoEvent> {
        let mut counts = self.0.iter().enumerate();
        if self.is_any_spad() {
            return Some(NoEvent {
                always: 0.0,
                by_pulses: 1.0,
                weight: 0.0,
            });
        }
        counts
            .all(|(spads, &is_event)| is_event == (spads % 2 == 1))
            .then_some(NoEvent {
                always: 0.5,
                by_pulses: 0.5,
                weight: -1.0,
            })
    }
}

/// Share of bins without an event, among those in which K SPADs of a macropixel fire: α + β·wᴷ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct NoEvent {
    /// α.
    always: f64,
    /// β.
    by_pulses: f64,
    /// w.
    pub(super) weight: f64,
}

impl NoEvent {
    /// Whether [`NoEvent::expectation`] looks at what it is without.
    #[inline(always)]
    pub(super) fn needs_unnamed(&self) -> bool {
        self.always != 0.0
    }

    /// Expectation of a product with this share, from that of the product without it, and with wᴷ in its place.
    #[inline(always)]
    pub(super) fn expectation(&self, without: f64, weighted: f64) -> f64 {
        self.always * without + self.by_pulses * weighted
    }
}

/// Counts of a bin that are no error.
const MEETINGS_THAT_DO_NOT_COUNT: f64 = 0.01;

/// Two pulses that meet on a photon line leave no edge ([`photon_line`](crate::chip::photon_line)). In one bin they cancel anyway; to either side of an
/// edge of a bin, which is all that is left out, each bin is off by a count.
///
/// # Errors
/// Where that may put the mean of a bin off by more than `error` of its counting noise: λ²·stage² of the laser
/// cycles at either edge, with λ photons a second on all SPADs together and `stage`, the delay of an XOR, at most.
pub(super) fn check_meetings(
    scene: &CohortLight,
    spads: usize,
    stage: Time,
    laser_cycles: u32,
    error: f64,
) -> Result<(), EngineError> {
    let stage_fs = stage.as_fs() as f64;
    let (spads, cycles) = (spads as f64, f64::from(laser_cycles));
    for bin in 0..scene.bins {
        let [from_fs, until_fs] = [bin, bin + 1].map(|n| scene.from_fs + scene.edge_fs(n));
        let meeting = [from_fs, until_fs].map(|edge_fs| {
            let near = scene.light.most(edge_fs - stage_fs, 2.0 * stage_fs);
            (0.5 * spads * near).powi(2)
        });
        let off = cycles * (meeting[0] + meeting[1]);
        let photons = spads * scene.light.most(from_fs, until_fs - from_fs);
        // Odd numbers of a Poisson variable.
        let odd = -0.5 * libm::expm1(-2.0 * photons);
        let noise = (cycles * odd * (1.0 - odd)).sqrt();
        if off > error * noise + MEETINGS_THAT_DO_NOT_COUNT {
            return Err(EngineError::NotInCohorts(NotModelled::Meetings { bin }));
        }
    }
    Ok(())
}
