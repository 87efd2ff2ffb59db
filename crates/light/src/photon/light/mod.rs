//! The light on one macropixel: a list of what shines on it.
//!
//! ```text
//!   laser cycle   0 …                                  1000 …
//!   segment       ├──────────────────────────────────────┼───────────────────────────    what shines changes there
//!   within a      ▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂▂  background: constant
//!   laser cycle   ▇▅▃▂▁                                              profile: e.g. what fog sends back
//!                      ▁█▁            ▂▅█▅▂                          echoes: a pane of glass, a slanted wall
//!   in some of them       ▁█▁  …  ▁█▁  …                              trains: pulses of other lidars
//! ```
//!
//! Each part is a Poisson process of its own, so the light is their sum. Mean numbers are of *detected* photons of all
//! SPADs of the macropixel: photons times the detection efficiency, each SPAD having the same share. Where SPADs differ,
//! [`SpadSpread`] says how.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::units::Time;
pub(super) use echo::MOST_PER_PULSE;
pub use echo::{Echo, OtherLaser, PulseTrain};
pub use error::LightError;
use error::is_amount;
pub(super) use layer::Layer;
pub use mean::MeanLight;
pub use profile::Profile;
pub use spad_spread::SpadSpread;

mod echo;
mod error;
mod layer;
mod mean;
mod profile;
mod spad_spread;

/// The light of some successive laser cycles.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    /// Its first laser cycle; it lasts until the next segment begins.
    pub first_cycle: u32,
    /// Constant rate of detected background photons and dark counts of all SPADs, per second.
    pub background_hz: f64,
    /// What is added to it within each laser cycle.
    pub profile: Option<Arc<Profile>>,
    echo: Echo,
    further: Vec<Echo>,
    trains: Vec<PulseTrain>,
}

impl Segment {
    /// The echoes of each laser cycle.
    pub fn echoes(&self) -> impl Iterator<Item = &Echo> {
        let echoes = std::iter::once(&self.echo).chain(&self.further);
        echoes.filter(|echo| echo.photons > 0.0)
    }

    fn signal_per_cycle(&self) -> f64 {
        self.echoes().map(|echo| echo.photons).sum()
    }

    fn layers(&self) -> impl Iterator<Item = Layer<'_>> {
        let first = Layer {
            background_hz: self.background_hz,
            ..Layer::of_echo(&self.echo)
        };
        let profile = self.profile.as_ref().map(|profile| Layer {
            profile: Some(profile),
            ..Layer::constant(profile.greatest_hz)
        });
        let further = self.further.iter().map(Layer::of_echo);
        let trains = self.trains.iter().map(Layer::of_train);
        let layers = std::iter::once(first).chain(further).chain(profile);
        layers.chain(trains)
    }
}

/// The light on one macropixel.
///
/// ```
/// use guided_dtof_light::photon::{Echo, PixelLight};
/// use guided_dtof_light::units::Time;
///
/// // A pane of glass, and a slanted wall behind it, in sunlight.
/// let wall = Echo::new(0.2, Time::from_ns(400)).with_sigma(Time::from_ns(4));
/// let light = PixelLight::echo(0.8, Time::from_ns(60))
///     .with_echo(wall)
///     .with_background(8e6);
/// // The wall comes nearer half way through an exposure of 2000 laser cycles.
/// let later = PixelLight::echo(0.25, Time::from_ns(396)).with_background(8e6);
/// let moving = PixelLight::timeline([(0, light), (1000, later)])?;
/// assert_eq!(moving.segments().count(), 2);
/// # Ok::<(), guided_dtof_light::photon::LightError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct PixelLight {
    first: Segment,
    later: Vec<Segment>,
    spads: Option<SpadSpread>,
}

impl PixelLight {
    /// No light.
    pub const fn dark() -> Self {
        Self::echo(0.0, Time::ZERO)
    }

    /// Background photons and dark counts of all SPADs at this mean rate, finite and ≥ 0, and no echo.
    pub const fn background(hz: f64) -> Self {
        Self::dark().with_background(hz)
    }

    /// One echo of the laser pulse: mean number of detected photons per laser cycle, finite and ≥ 0, and when its centre
    /// comes after the start of its cycle.
    pub const fn echo(photons_per_cycle: f64, arrival: Time) -> Self {
        PixelLight {
            first: Segment {
                first_cycle: 0,
                background_hz: 0.0,
                profile: None,
                echo: Echo::new(photons_per_cycle, arrival),
                further: Vec::new(),
                trains: Vec::new(),
            },
            later: Vec::new(),
            spads: None,
        }
    }

    /// Light that changes during the exposure, as of something that moves: what shines from a laser cycle on, until the next
    /// segment begins. Echoes belong to the laser cycle of their pulse, background to its time.
    ///
    /// # Errors
    /// No segment, a first one that does not begin with laser cycle 0, segments out of order, and light that is a timeline
    /// itself or has a [`SpadSpread`].
    pub fn timeline(
        segments: impl IntoIterator<Item = (u32, PixelLight)>,
    ) -> Result<Self, LightError> {
        let mut all: Vec<Segment> = Vec::new();
        for (first_cycle, light) in segments {
            match all.last() {
                None if first_cycle > 0 => return Err(LightError::LateStart(first_cycle)),
                Some(last) if last.first_cycle >= first_cycle => {
                    return Err(LightError::Order {
                        before: last.first_cycle,
                        next: first_cycle,
                    });
                }
                _ => (),
            }
            if !light.later.is_empty() || light.spads.is_some() {
                return Err(LightError::Nested);
            }
            all.push(Segment {
                first_cycle,
                ..light.first
            });
        }
        let mut all = all.into_iter();
        Ok(PixelLight {
            first: all.next().ok_or(LightError::NoSegment)?,
            later: all.collect(),
            spads: None,
        })
    }

    /// The same with this constant background in all segments, mean photons and dark counts of all SPADs per second.
    pub const fn with_background(mut self, hz: f64) -> Self {
        debug_assert!(is_amount(hz), "a rate is finite and not negative");
        self.first.background_hz = hz;
        let mut segment = 0;
        while segment < self.later.len() {
            self.later.as_mut_slice()[segment].background_hz = hz;
            segment += 1;
        }
        self
    }

    /// The same with one more echo in all segments.
    pub fn with_echo(mut self, echo: Echo) -> Self {
        for segment in self.segments_mut() {
            if segment.echo.photons > 0.0 {
                segment.further.push(echo.clone())
            } else {
                segment.echo = echo.clone()
            }
        }
        self
    }

    /// The same with these pulses of another laser in all segments.
    pub fn with_train(mut self, train: PulseTrain) -> Self {
        for segment in self.segments_mut() {
            segment.trains.push(train);
        }
        self
    }

    /// The same without other lasers, but for pulses that `arrivals` tells of a train: laser cycle, and when after its start. Each is an echo of
    /// that laser cycle, which is a segment of its own.
    pub(super) fn with_trains_as_echoes(
        &self,
        arrivals: impl Fn(&PulseTrain) -> Vec<(u32, Time)>,
    ) -> Self {
        let mut segments: Vec<Segment> = Vec::new();
        let ends = self.later.iter().map(|segment| segment.first_cycle);
        for (segment, end) in self.segments().zip(ends.chain([u32::MAX])) {
            let mut by_cycle: BTreeMap<u32, Segment> = BTreeMap::new();
            let since = |first_cycle: u32| Segment {
                first_cycle,
                trains: Vec::new(),
                ..segment.clone()
            };
            for train in &segment.trains {
                let within = arrivals(train).into_iter();
                for (cycle, at) in within.filter(|at| (segment.first_cycle..end).contains(&at.0)) {
                    let lit = by_cycle.entry(cycle).or_insert_with(|| since(cycle));
                    lit.further
                        .push(Echo::new(train.photons, at).with_sigma(train.sigma));
                }
            }
            let mut next = segment.first_cycle;
            for (cycle, lit) in by_cycle {
                segments.extend((next < cycle).then(|| since(next)));
                segments.push(lit);
                next = cycle + 1;
            }
            segments.extend((next < end).then(|| since(next)));
        }
        let mut segments = segments.into_iter();
        PixelLight {
            first: segments.next().expect("each has one at least"),
            later: segments.collect(),
            spads: self.spads.clone(),
        }
    }

    /// Whether another laser shines on it.
    pub fn has_trains(&self) -> bool {
        self.segments().any(|segment| !segment.trains.is_empty())
    }

    /// Greatest mean rate of photons of other lasers, per second, where each pulse blinds all SPADs at most some times.
    pub(crate) fn trains_hz(&self) -> f64 {
        let rate_hz = |train: &PulseTrain| train.photons.min(MOST_PER_PULSE) / train.laser.period_s;
        let each = self
            .segments()
            .map(|segment| segment.trains.iter().map(rate_hz).sum());
        each.fold(0.0, f64::max)
    }

    /// The same with this profile on top of the background in all segments.
    pub fn with_profile(mut self, profile: Profile) -> Self {
        let profile = Arc::new(profile);
        for segment in self.segments_mut() {
            segment.profile = Some(profile.clone());
        }
        self
    }

    /// The same on SPADs that differ.
    pub fn with_spads(self, spads: SpadSpread) -> Self {
        PixelLight {
            spads: Some(spads),
            ..self
        }
    }

    /// Its segments in their order; the first one begins with laser cycle 0.
    pub fn segments(&self) -> impl Iterator<Item = &Segment> {
        std::iter::once(&self.first).chain(&self.later)
    }

    fn segments_mut(&mut self) -> impl Iterator<Item = &mut Segment> {
        std::iter::once(&mut self.first).chain(&mut self.later)
    }

    /// How its SPADs differ; `None` where they do not.
    pub fn spads(&self) -> Option<&SpadSpread> {
        self.spads.as_ref()
    }

    /// Whether it is one echo at most and constant background, the same on all SPADs.
    pub fn is_plain(&self) -> bool {
        self.later.is_empty()
            && self.first.further.is_empty()
            && self.first.profile.is_none()
            && self.first.trains.is_empty()
            && self.spads.is_none()
    }

    /// Mean number of detected signal photons per laser cycle, of all echoes; of the segment that has most.
    pub fn signal_per_cycle(&self) -> f64 {
        let signals = self.segments().map(Segment::signal_per_cycle);
        signals.fold(0.0, f64::max) * self.greatest_factor()
    }

    /// Mean photons a laser cycle of the brightest echo.
    pub(in crate::photon) fn brightest_echo(&self) -> f64 {
        let echoes = self.segments().flat_map(Segment::echoes);
        echoes.map(|echo| echo.photons).fold(0.0, f64::max) * self.greatest_factor()
    }

    /// Greatest mean rate of background photons and dark counts of all SPADs per second: that at which photons are drawn.
    /// Where SPADs differ, as if all were the greatest.
    pub fn background_hz(&self) -> f64 {
        let rate_hz = |segment: &Segment| {
            let profile = segment.profile.as_ref();
            segment.background_hz + profile.map_or(0.0, |profile| profile.greatest_hz)
        };
        let rates_hz = self.segments().map(rate_hz);
        let dark_hz = self
            .spads
            .as_ref()
            .map_or(0.0, |spads| spads.greatest_dark_hz * spads.spads() as f64);
        rates_hz.fold(0.0, f64::max) * self.greatest_factor() + dark_hz
    }

    fn greatest_factor(&self) -> f64 {
        self.spads
            .as_ref()
            .map_or(1.0, |spads| spads.greatest_factor)
    }

    /// Centre of the first echo after the start of its cycle.
    pub fn arrival(&self) -> Time {
        self.first.echo.arrival
    }

    /// The same with its first echo at another time.
    pub fn with_arrival(mut self, arrival: Time) -> Self {
        self.first.echo.arrival = arrival;
        self
    }

    /// Its layers, by their numbers. The first one is the background and the first echo of the first segment.
    pub(super) fn layers(&self) -> impl Iterator<Item = Layer<'_>> {
        let factor = self.greatest_factor();
        let by_spad = self.spads.as_ref().map(|spads| &spads.efficiency);
        let ends = self.later.iter().map(|segment| segment.first_cycle);
        let segments = self.segments().zip(ends.chain([u32::MAX]));
        let of_segments = segments.flat_map(move |(segment, end)| {
            segment.layers().map(move |layer| Layer {
                cycles: segment.first_cycle..end,
                background_hz: layer.background_hz * factor,
                signal_per_cycle: layer.signal_per_cycle * factor,
                by_spad,
                ..layer
            })
        });
        of_segments.chain(self.spads.as_ref().map(SpadSpread::dark_counts))
    }
}
