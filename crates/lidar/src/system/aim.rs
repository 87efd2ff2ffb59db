//! Where guide and ranging assume windows and bins. If all macropixels follow the window law, that is it; if each has
//! delay lines of its own, it is the bin profile, calibrated or ideal (thesis 6.3.1, Eq. 28 and 29).
//!
//! The chip itself always does what its netlist says. What is assumed of it and wrong shows in the depths.

use std::borrow::Cow;
use std::ops::Range;

use crate::chip::window_law::OpenWindow;
use crate::chip::{Exposure, Mode, Sensor, Tdc, WindowLaw};
use crate::ranging::{BinProfile, EchoFinder, PeakOptions, Sighting, centre_of_mass};
use crate::units::{Time, TimeOfFlight};

/// The law of a macropixel by its number, given that of the first.
pub(super) fn own_law(law: &WindowLaw, pixel: usize) -> Cow<'_, WindowLaw> {
    if law.sensor().has_own_laws() {
        Cow::Owned(law.of_macropixel(pixel as u32))
    } else {
        Cow::Borrowed(law)
    }
}

/// Where windows are taken to be.
#[derive(Debug)]
pub(super) struct Aims<'p> {
    law: WindowLaw,
    profile: Option<Cow<'p, BinProfile>>,
    is_calibrated: bool,
}

impl<'p> Aims<'p> {
    /// For a sensor, with its calibration if there is one.
    pub(super) fn new(
        sensor: &Sensor,
        exposure: &Exposure,
        calibration: Option<&'p BinProfile>,
    ) -> Self {
        let ideal = || Cow::Owned(BinProfile::ideal(sensor, exposure));
        let has_lines = sensor.tdc == Tdc::DelayLine;
        Aims {
            law: WindowLaw::new(sensor.alike(), exposure),
            is_calibrated: calibration.is_some(),
            profile: has_lines.then(|| calibration.map_or_else(ideal, Cow::Borrowed)),
        }
    }

    /// When bins are, where that is no law's.
    pub(super) fn profile(&self) -> Option<&BinProfile> {
        self.profile.as_deref()
    }

    /// Photon times that the window of a start value sees, from STOP; `None` where it does not open.
    pub(super) fn seen_by(&self, start: u16) -> Option<Range<Time>> {
        let window = self.law.window(start).open()?;
        Some(self.law.interval(&window))
    }

    /// The start value of a macropixel with this estimate of the guide, if it has any use for light.
    pub(super) fn start_of(&self, pixel: usize, guide_m: Option<f64>) -> Option<u16> {
        match self.law.sensor().mode {
            Mode::Guided => self.start_for(pixel, Time::of_flight(guide_m?)),
            // The window is that of STOP, whatever the start value, and needs no guide.
            Mode::Conventional => self.law.window(0).open().map(|window| window.start),
        }
    }

    /// The start value that looks at `time` after STOP: its window contains it, and has it nearest to its middle.
    fn start_for(&self, pixel: usize, time: Time) -> Option<u16> {
        let aimed = self.law.start_for(time)?;
        let Some(profile) = self.profile.as_ref().filter(|_| self.is_calibrated) else {
            return Some(aimed);
        };
        // A macropixel's own lines and clock are off by less than a step.
        let off_s = |start: &u16| {
            let middles = profile.middles_s(pixel, *start);
            ((middles[0] + middles[middles.len() - 1]) / 2.0 - time.as_s()).abs()
        };
        let largest = self.law.sensor().largest_start();
        let near = aimed.saturating_sub(1)..=(aimed + 1).min(largest);
        let opening = near.filter(|&start| self.law.window(start).open().is_some());
        opening.min_by(|a, b| off_s(a).total_cmp(&off_s(b)))
    }
}

/// A macropixel's histogram, as far as ranging knows it.
pub(super) struct AimedHistogram<'a> {
    pub(super) pixel: usize,
    pub(super) start: u16,
    pub(super) law: &'a WindowLaw,
    pub(super) profile: Option<&'a BinProfile>,
    pub(super) peak: &'a PeakOptions,
}

impl AimedHistogram<'_> {
    /// The echo in `counts`.
    pub(super) fn find(&self, finder: &EchoFinder, counts: &[u32]) -> Option<Sighting> {
        match self.profile {
            Some(profile) => finder.find_in(counts, &profile.shares(self.pixel, self.start)),
            None => finder.find(counts),
        }
    }

    /// Distance of a peak at `position_bins` of `counts`, whose fullest bin is `peak_bin`, m.
    pub(super) fn range_m(
        &self,
        window: OpenWindow,
        counts: &[u32],
        position_bins: f64,
        peak_bin: usize,
    ) -> Option<f64> {
        let Some(profile) = self.profile else {
            return Some(self.law.time_of(&window, position_bins).as_range_m());
        };
        let middles_s = profile.middles_s(self.pixel, self.start);
        let counts: Vec<f64> = counts.iter().map(|&n| f64::from(n)).collect();
        let mass = centre_of_mass(&counts, peak_bin, self.peak, |bin| middles_s[bin])?;
        Some(Time::from_s(mass.place).as_range_m())
    }
}
