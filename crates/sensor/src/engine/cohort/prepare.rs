//! From a macropixel's light to what its cohorts are made of: classes of laser cycles, each with its state at the start of
//! the window, its light by steps, and dead time followed as finely as that light asks for.
//!
//! ```text
//!   light, window, SPADs ──► refused by name, or
//!     Scene ──► Class, Class, …  (cycles.rs)
//!                  ├─ even enough within a CLK period ──► Blindness of even light, one step a bin
//!                  └─ otherwise ──► fine.rs: cells that are halved until the error is small enough
//! ```

use smallvec::SmallVec;

use super::blindness::Blindness;
use super::cycles::{self, Class, CohortLight, LikeCycles};
use super::secondaries::Secondaries;
use super::spad_light::SpadLight;
use super::{Cohort, FEW_STEPS, Means, Opening, events, fine};
use crate::chip::Tdc;
use crate::engine::{EngineError, NotModelled, follows, has_a_line_a_spad};
use crate::photon::{DeadTimeLaw, PixelLight, Segment, SpadModel, StreamConfig};
use crate::units::Time;

impl Cohort {
    /// The laser cycles of an exposure by what they have in common; `None` where no window opens.
    pub(super) fn cohorts(
        &self,
        stream: &StreamConfig,
        start: u16,
        light: &PixelLight,
    ) -> Result<Option<Vec<LikeCycles>>, EngineError> {
        follows(&self.sensor, &self.law.timing().pulses)?;
        if self.sensor.has_own_laws() && !self.is_of_macropixel {
            return Err(EngineError::OwnLaws);
        }
        has_a_line_a_spad(&self.sensor)?;
        let Opening { window, from_fs } = self.opening(start);
        let Some(window) = window.settled()? else {
            return Ok(None);
        };
        let edges_fs: Option<Vec<f64>> = (!self.law.has_clk_bins()).then(|| {
            let edges = self.law.edges(&window, 0);
            let edges = edges.edges().iter();
            edges.map(|edge| edge.as_fs() as f64 - from_fs).collect()
        });
        let clk_fs = 1e15 / stream.clock.as_hz();
        let [shortest_fs, longest_fs] = match &edges_fs {
            None => [clk_fs; 2],
            Some(edges_fs) => cycles::shortest_and_longest(edges_fs),
        };
        let spads = &stream.spads;
        let refusal = self.refusal(stream, light, [shortest_fs, longest_fs]);
        if let Some(what) = refusal {
            return Err(EngineError::NotInCohorts(what));
        }
        let [dead_fs, pending_fs] =
            [spads.dead_time, spads.reach()].map(|time| time.as_fs() as f64);
        let scene = CohortLight::new(
            SpadLight::new(stream, light),
            [dead_fs, pending_fs, shortest_fs],
            [from_fs, stream.cycle_s() * 1e15],
            self.sensor.bins,
            edges_fs,
        );
        if self.sensor.tdc == Tdc::DelayLine {
            let stage = self.law.timing().photon_line_stage;
            let (spads, error) = (self.sensor.spads(), self.options.error);
            events::check_meetings(&scene, spads, stage, stream.laser_cycles, error)?;
        }
        let classes = scene.classes(&self.sensor, &self.law, &window, &self.options)?;
        let like = |class| self.like_cycles(&scene, spads, class);
        classes.iter().map(like).collect::<Result<_, _>>().map(Some)
    }

    /// What of this light, or of SPADs in it, cohorts do not follow, if anything. Bins are between
    /// `shortest_fs` and `longest_fs` long.
    fn refusal(
        &self,
        stream: &StreamConfig,
        light: &PixelLight,
        [shortest_fs, longest_fs]: [f64; 2],
    ) -> Option<NotModelled> {
        let spads = &stream.spads;
        let has_secondaries = spads.has_secondaries();
        let mut echoes = light.segments().flat_map(Segment::echoes);
        let has_shape = echoes.any(|echo| echo.shape.is_some());
        let refusals = [
            (
                // A bin without length is left out of what is asked of steps.
                shortest_fs <= 0.0,
                NotModelled::EmptyBins,
            ),
            (
                (spads.dead_time.as_fs() as f64) < longest_fs,
                NotModelled::ShortDeadTime {
                    dead_time: spads.dead_time,
                    bin: Time::from_fs(longest_fs as i64),
                },
            ),
            (
                has_secondaries && spads.law == DeadTimeLaw::Paralysable,
                NotModelled::SecondariesOfParalysable,
            ),
            (
                spads.crosstalk_probability > 0.0 && !self.is_event.is_any_spad(),
                NotModelled::CrosstalkInCoincidence,
            ),
            (
                stream.pulse_shape.is_some() || has_shape,
                NotModelled::MeasuredPulse,
            ),
            (
                light.spads().is_some() || spads.dead_time_spread > 0.0,
                NotModelled::SpadsThatDiffer,
            ),
            (light.has_trains(), NotModelled::OtherLasers),
            (self.sensor.tdc == Tdc::Counter, NotModelled::CounterTdc),
        ];
        let refusal = refusals.into_iter().find(|(refuses, _)| *refuses);
        refusal.map(|(_, what)| what)
    }

    /// The state, light and dead time of a class of laser cycles, as finely as they have to be known.
    fn like_cycles(
        &self,
        scene: &CohortLight,
        spads: &SpadModel,
        class: &Class,
    ) -> Result<LikeCycles, EngineError> {
        let step_fs = scene.period_fs;
        let blindness = match &scene.edges_fs {
            None => Blindness::new(spads.law, scene.dead_fs / step_fs),
            Some(edges_fs) => {
                let [_, longest_fs] = cycles::shortest_and_longest(edges_fs);
                let [longest, shortest] = [longest_fs, step_fs].map(|fs| scene.dead_fs / fs);
                Blindness::of_unequal(spads.law, longest, shortest)
            }
        };
        let mut means = scene.means(&class.extent);
        let as_in_even_light =
            !spads.has_secondaries() && self.is_even_enough(scene, &blindness, class, &means);
        let (blindness, ages) = if as_in_even_light {
            let ages = scene.start(&blindness, class);
            (blindness, ages)
        } else {
            let secondaries = Secondaries::new(spads);
            let (is_event, error) = (&self.is_event, self.options.error);
            let fine = fine::solve(scene, &blindness, secondaries, class, is_event, error)?;
            means = fine.photons;
            (blindness.in_light(fine.able), fine.ages)
        };
        Ok(LikeCycles {
            cycles: class.cycles,
            blindness,
            ages,
            means,
            not_compared: class.not_compared,
        })
    }

    /// Whether a bound shows that taking light to be even within a CLK period keeps the error, for events of any SPAD.
    ///
    /// With μ photons on each of n SPADs in a CLK period, n·μ·μ′·|Δ| of the events of a bin are amiss where a SPAD that was hit by
    /// μ′ before is able with another probability, by Δ, than in even light; and what two photons before do, (Σμ′)²/2 of
    /// them, may be wrong altogether.
    fn is_even_enough(
        &self,
        scene: &CohortLight,
        blindness: &Blindness,
        class: &Class,
        means: &Means,
    ) -> bool {
        if !self.is_event.is_any_spad() {
            return false;
        }
        let Some(past) = scene.even_past(blindness.memory(), class) else {
            return false;
        };
        let memory = past.len();
        let photons: SmallVec<[f64; 2 * FEW_STEPS]> = past.iter().chain(means).copied().collect();
        let allowed = self.options.error * self.options.error / class.cycles as f64;
        photons[memory..].iter().enumerate().all(|(bin, &now)| {
            let (mut uneven, mut all) = (0.0, now);
            for (age, before) in (1..).zip(photons[bin..bin + memory].iter().rev()) {
                uneven += blindness.most_uneven(age) * before;
                all += before;
            }
            let events = self.is_event.spads() as f64 * now;
            let off = events * (uneven + 0.5 * all * all);
            let at_least = events * (1.0 - all - 0.5 * events);
            off * off <= allowed * at_least * (1.0 - events).max(0.0)
        })
    }
}
