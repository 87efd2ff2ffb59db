//! Sentences on why surfaces of a frame have no depth, with the numbers behind it and what would help: on the commonest reason if most have none, and
//! hints on rarer reasons that settings can change.

use serde::Serialize;

use super::circumstances::{Circumstances, signal_in_window};
use super::lost_peaks::LostPeaks;
use super::pixel::{NoDepth, PixelDepth};
use crate::chip::{EventType, Mode, SensorConfig, WindowLaw};
use crate::photon::PixelLight;
use crate::ranging::{EchoLight, Response};
use crate::units::{SPEED_OF_LIGHT_M_PER_S, Time, TimeOfFlight};

/// Share of laser cycles in which background alone counts in a bin, from which on less of it is advised instead of more light: chosen.
const FULL_OF_BACKGROUND: f64 = 0.2;

/// Least share of surfaces without a depth for a reason that is worth a hint: chosen.
const WORTH_A_HINT: f64 = 0.01;

/// What would help against a reason for missing depths.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DepthHint {
    /// The reason.
    pub reason: NoDepth,
    /// Surfaces that have no depth for it.
    pub surfaces: usize,
    /// How many they are, why, and what to change.
    pub sentence: String,
}

impl Circumstances<'_> {
    /// The sentence, if fewer than half of the macropixels that see a surface have a depth.
    pub(super) fn remark(&self) -> Option<String> {
        let surfaces = self.surfaces();
        if surfaces == 0 {
            return Some("no depths, because no macropixel sees a surface".to_owned());
        }
        let commonest = self.reason_of_most()?;
        let missing: usize = NoDepth::ALL
            .into_iter()
            .map(|r| self.count_without(r))
            .sum();
        let why = match commonest {
            NoDepth::NoSurface => return None,
            NoDepth::NoGuide => self.no_guide(),
            NoDepth::OutOfReach => self.out_of_reach(),
            NoDepth::SpadsOff => {
                "with pde = 0 and dark_count_hz = 0, or without excess bias in the heat, no SPAD ever fires; give pde above 0".to_owned()
            }
            NoDepth::Saturated => self.saturated(),
            NoDepth::OutsideWindow => self.outside_window(),
            NoDepth::NoSignificantPeak => self.no_significant_peak(),
            NoDepth::BehindLidar => {
                "a fit puts these echoes before the laser's pulse; light so near or so strong does not tell its place".to_owned()
            }
        };
        let (name, count) = (commonest.name(), self.count_without(commonest));
        Some(format!(
            "{missing} of {surfaces} surfaces have no depth, {count} of them for the reason {name:?}: {why}"
        ))
    }

    /// One for each reason that settings can change and that is not rare, except the remark's.
    pub(super) fn hints(&self) -> Vec<DepthHint> {
        let is_said = self.reason_of_most();
        let is_worth_it = |reason: NoDepth| {
            is_said != Some(reason)
                && self.count_without(reason) as f64 > WORTH_A_HINT * self.surfaces() as f64
        };
        let hint = |reason: NoDepth, what: String| {
            let surfaces = self.count_without(reason);
            DepthHint {
                reason,
                surfaces,
                sentence: format!("{surfaces} surfaces {what}"),
            }
        };
        let mut hints = Vec::new();
        if is_worth_it(NoDepth::NoGuide) {
            let why = self.no_guide();
            let what = format!(
                "have no guide: {why}; unguided = \"neighbour\" takes over the estimates of neighbours"
            );
            hints.push(hint(NoDepth::NoGuide, what));
        }
        if is_worth_it(NoDepth::Saturated) {
            let what = format!("are saturated: {}", self.saturated());
            hints.push(hint(NoDepth::Saturated, what));
        }
        if is_worth_it(NoDepth::NoSignificantPeak) {
            let what = format!(
                "have no significant peak: {}",
                LostPeaks::new(self).advice()
            );
            hints.push(hint(NoDepth::NoSignificantPeak, what));
        }
        hints
    }

    /// Macropixels that see a surface.
    fn surfaces(&self) -> usize {
        self.pixels.iter().filter(|p| p.true_m.is_some()).count()
    }

    /// Surfaces without a depth for this reason.
    fn count_without(&self, reason: NoDepth) -> usize {
        let has_reason = |p: &&PixelDepth| p.true_m.is_some() && p.no_depth == Some(reason);
        self.pixels.iter().filter(has_reason).count()
    }

    /// The commonest reason, if more than half of the surfaces have no depth.
    fn reason_of_most(&self) -> Option<NoDepth> {
        let missing: usize = NoDepth::ALL
            .into_iter()
            .map(|r| self.count_without(r))
            .sum();
        if 2 * missing <= self.surfaces() {
            return None;
        }
        // Of equally common reasons the one that comes first holds first.
        let reasons = NoDepth::ALL.into_iter().rev();
        reasons.max_by_key(|&reason| self.count_without(reason))
    }

    /// Nearest and farthest of what macropixels without a depth for this reason have of `distance`.
    fn span_m(&self, reason: NoDepth, distance: fn(&PixelDepth) -> Option<f64>) -> String {
        let with_reason = self.pixels.iter().filter(|p| p.no_depth == Some(reason));
        let metres: Vec<f64> = with_reason.filter_map(distance).collect();
        span(&metres)
    }

    fn no_guide(&self) -> String {
        let surfaces = self.span_m(NoDepth::NoGuide, |p| p.true_m);
        match self.guide.reach(self.scene) {
            Some(reach) => format!("they are {surfaces} away, and {reach}"),
            None => format!(
                "the guide ({}) has no estimate of surfaces {surfaces} away",
                self.guide.name()
            ),
        }
    }

    fn out_of_reach(&self) -> String {
        let law = WindowLaw::new(self.sensor, self.exposure);
        let open = (0..=self.sensor.largest_start()).filter_map(|start| law.window(start).open());
        let ends: Vec<f64> = open
            .map(|window| law.interval(&window))
            .flat_map(|within| [within.start, within.end])
            .map(|time| time.as_range_m().max(0.0))
            .collect();
        if ends.is_empty() {
            return "no start value opens a window".to_owned();
        }
        let wanted = self.span_m(NoDepth::OutOfReach, |p| p.guide_m);
        let (bits, periods) = (self.sensor.counter_bits, self.exposure.stop_periods);
        let law = self.sensor.counter_law();
        let silent = law.filter(|law| law.silent_codes().len() > 1);
        let cure = match silent.and_then(|law| law.silent_in_words()) {
            Some(codes) => format!(
                "its P-counter never raises LOCAL_STOP with COUNTER_INIT {codes}; give one that does"
            ),
            None => "give more counter_bits or a longer laser cycle".to_owned(),
        };
        format!(
            "start values of {bits} bits (counter_bits) and a STOP every {periods} CLK periods open windows {} away, and the guide's estimates lie {wanted}; {cure}",
            span(&ends)
        )
    }

    fn saturated(&self) -> String {
        let full = (1u32 << self.sensor.bin_bits) - 1;
        let cycles = self.exposure.laser_cycles;
        let most = self.greatest_chance(NoDepth::Saturated);
        // Three standard deviations of counts that a full bin would hold.
        let nearly_full = (f64::from(full) - 3.0 * f64::from(full).sqrt()).max(1.0);
        if most * f64::from(cycles) < nearly_full {
            return "no bin is full, but light fills the window so evenly that its counts do not tell where the echo lies; give less of it (a narrower filter, a smaller lens, less laser energy)".to_owned();
        }
        let fitting = nearly_full / most;
        format!(
            "bins are full at {full} counts (bin_bits = {}), and {cycles} laser cycles bring up to {:.0}; give more bits, or about {fitting:.0} laser cycles",
            self.sensor.bin_bits,
            most * f64::from(cycles),
        )
    }

    fn outside_window(&self) -> String {
        if self.sensor.mode == Mode::Conventional {
            let law = WindowLaw::new(self.sensor, self.exposure);
            let window = law.window(0).open().map(|window| law.interval(&window));
            let ends = window.map_or(Vec::new(), |within| {
                [within.start, within.end].map(Time::as_range_m).to_vec()
            });
            return format!(
                "mode = \"conventional\" opens every window at the STOP that ends the laser cycle, {} away, and these surfaces lie {}; give a STOP period that ends there, or mode = \"guided\"",
                span(&ends),
                self.span_m(NoDepth::OutsideWindow, |p| p.true_m)
            );
        }
        let errors = self.pixels.iter().filter(|p| p.start.is_some());
        let errors: Vec<f64> = errors
            .filter_map(|p| Some((p.guide_m? - p.true_m?).abs()))
            .collect();
        let largest = errors.iter().fold(0.0, |a: f64, &b| a.max(b));
        let window_s = self.bin_s * self.sensor.bins as f64;
        let window_m = window_s * SPEED_OF_LIGHT_M_PER_S / 2.0;
        format!(
            "a window is {window_m:.1} m long, and the guide is wrong by up to {largest:.1} m; give more bins, a slower CLK or a better guide"
        )
    }

    fn no_significant_peak(&self) -> String {
        let SensorConfig {
            threshold,
            event_type,
            ..
        } = &**self.sensor;
        let wanted = match event_type {
            EventType::Less => "fewer than",
            EventType::Equal => "exactly",
            EventType::Greater => "more than",
        };
        let chance = self.greatest_chance(NoDepth::NoSignificantPeak);
        let cycles = self.exposure.laser_cycles;
        if (*event_type, *threshold) != (EventType::Greater, 0) {
            let asked = format!(
                "threshold = {threshold} asks for {wanted} {threshold} SPADs in one CLK period, which"
            );
            return if chance > 0.0 {
                format!(
                    "{asked} a bin of the brightest echo has with a probability of {chance:.1e} in each of {cycles} laser cycles; give event_type = \"greater\" and a lower threshold"
                )
            } else {
                format!(
                    "{asked} the {} of a macropixel never have; give event_type = \"greater\" and a lower threshold",
                    self.sensor.spads()
                )
            };
        }
        let brightest = self.brightest(NoDepth::NoSignificantPeak);
        let (signal, background) = brightest.map_or((0.0, 0.0), |(signal, light)| {
            (signal, light.background_hz() * self.bin_s)
        });
        let counted = -libm::expm1(-background);
        let advice = if counted > FULL_OF_BACKGROUND {
            format!(
                ". Background alone counts in a bin in {:.0} % of them; give less of it (a narrower filter, fewer dark counts, shorter bins), or a threshold",
                100.0 * counted
            )
        } else {
            "; give more of them, or more light".to_owned()
        };
        format!(
            "the brightest of these echoes brings {signal:.2e} photons a laser cycle into its window, to a background of {background:.2e} a bin, for {cycles} laser cycles{advice}"
        )
    }

    /// The light of the brightest echo without a depth for this reason, and its photons in a laser cycle: of what arrives in the window,
    /// where there is one.
    fn brightest(&self, reason: NoDepth) -> Option<(f64, &PixelLight)> {
        let law = WindowLaw::new(self.sensor, self.exposure);
        let with_reason = self.pixels.iter().zip(self.light);
        with_reason
            .filter(|(pixel, _)| pixel.no_depth == Some(reason) && pixel.true_m.is_some())
            .map(|(pixel, light)| (signal_in_window(&law, pixel, light), light))
            .max_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// The chance that the fullest bin of that echo counts in a laser cycle.
    fn greatest_chance(&self, reason: NoDepth) -> f64 {
        let Some((signal, light)) = self.brightest(reason) else {
            return 0.0;
        };
        let response = Response::new(self.sensor, self.bin_s, self.scene.echo_width());
        let chances = response.chances(&EchoLight {
            position_bins: (self.sensor.bins / 2) as f64,
            signal,
            background_per_bin: light.background_hz() * self.bin_s,
            sigma_bins: response.pulse_sigma_bins,
        });
        chances.into_iter().fold(0.0, f64::max)
    }
}

/// "from 3.0 m to 7.0 m" of the least and the greatest.
fn span(metres: &[f64]) -> String {
    let least = metres.iter().copied().fold(f64::INFINITY, f64::min);
    let greatest = metres.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    format!("from {least:.1} m to {greatest:.1} m")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::{Exposure, SensorConfig};
    use crate::scene::{DVec3, Ray, Scene};
    use crate::system::{Frame, FrameSettings, take_frame};

    /// A small frame of the street.
    fn frame(sensor: &str, change: impl Fn(&mut Scene)) -> Frame {
        let text = format!("rows = 16\ncols = 16\n{sensor}");
        let sensor = SensorConfig::parse("test", &text).unwrap();
        let mut scene = Scene::outdoor();
        change(&mut scene);
        let exposure = Exposure::new(&sensor, 520, 1000);
        let settings = FrameSettings::new(sensor, scene, exposure);
        let frame = take_frame(&settings, |_| Vec::new(), |_| {}).unwrap();
        for pixel in &frame.pixels {
            assert_eq!(pixel.measured_m.is_some(), pixel.no_depth.is_none());
        }
        frame
    }

    #[test]
    fn empty_frames_say_why() {
        for (sensor, reason, words) in [
            (
                "counter_bits = 5",
                NoDepth::OutOfReach,
                "start values of 5 bits",
            ),
            (
                "mode = \"conventional\"",
                NoDepth::OutsideWindow,
                "the STOP that ends the laser cycle, from 196.",
            ),
            (
                "threshold = 10",
                NoDepth::NoSignificantPeak,
                "has with a probability of",
            ),
            ("bin_bits = 3", NoDepth::Saturated, "full at 7 counts"),
        ] {
            let frame = frame(sensor, |_| {});
            let remark = frame.remark.as_deref().unwrap_or("nothing");
            assert!(remark.contains(words), "{sensor}: {remark}");
            assert!(remark.contains(reason.name()), "{sensor}: {remark}");
            let summary = frame.summary();
            let most = summary
                .no_depth
                .iter()
                .filter(|(r, _)| **r != NoDepth::NoSurface);
            assert_eq!(
                most.max_by_key(|(_, n)| **n).unwrap().0,
                &reason,
                "{sensor}"
            );
        }
    }

    /// Cars nearer than the camera pair begins, and an exposure too long for the bins.
    #[test]
    fn rarer_reasons_that_settings_change_have_a_hint() {
        let short_sighted = frame("", |scene| scene.stereo.max_disparity_px = 180.0);
        assert_eq!(short_sighted.remark, None);
        let [hint, ..] = &short_sighted.hints[..] else {
            panic!("{:?}", short_sighted.hints)
        };
        for words in [
            "surfaces have no guide",
            "from 19.3 m (max_disparity_px)",
            "unguided = \"neighbour\"",
        ] {
            assert!(hint.sentence.contains(words), "{hint:?}");
        }
        let without = |p: &&PixelDepth| p.true_m.is_some() && p.no_depth == Some(NoDepth::NoGuide);
        let surfaces = short_sighted.pixels.iter().filter(without).count();
        assert_eq!((hint.reason, hint.surfaces), (NoDepth::NoGuide, surfaces));
        assert!(hint.sentence.starts_with(&surfaces.to_string()));
        // The same reason is not told twice.
        let blind = frame("", |scene| scene.stereo.max_disparity_px = 20.0);
        assert!(blind.remark.unwrap().contains("no guide"));
        let is_of_guide = |hint: &DepthHint| hint.reason == NoDepth::NoGuide;
        assert!(!blind.hints.iter().any(is_of_guide), "{:?}", blind.hints);
        let full = frame("bin_bits = 9", |scene| {
            scene.lidar.pulse_energy_uj = 1.0;
            scene.light.illuminance_klux = 5.0;
        });
        let is_of_full_bins = |hint: &DepthHint| {
            hint.sentence
                .contains("are saturated: bins are full at 511 counts")
        };
        assert!(full.hints.iter().any(is_of_full_bins), "{:?}", full.hints);
    }

    /// An echo before the window is no light in it, and more light is no help where bins are full of the sun's.
    #[test]
    fn what_helps_a_lost_peak_is_advised() {
        let dim = frame("", |scene| {
            scene.lidar.pulse_energy_uj = 1e-3;
            scene.light.illuminance_klux = 0.0;
        });
        let remark = dim.remark.unwrap();
        assert!(remark.contains("or more light"), "{remark}");
        let bright = frame("", |scene| {
            scene.lidar.pulse_energy_uj = 0.1;
            scene.light.illuminance_klux = 100.0;
        });
        let remark = bright.remark.unwrap();
        assert!(
            remark.contains("a narrower filter") && !remark.contains("more light"),
            "{remark}"
        );
    }

    #[test]
    fn dark_spads_and_empty_scenes_are_told_apart() {
        let off = frame("", |scene| {
            scene.lidar.pde = 0.0;
            scene.lidar.dark_count_hz = 0.0;
        });
        assert!(off.remark.unwrap().contains("no SPAD ever fires"));
        let empty = frame("", |scene| scene.objects.clear());
        assert!(
            empty
                .remark
                .unwrap()
                .contains("no macropixel sees a surface")
        );
        assert_eq!(empty.pixels[0].no_depth, Some(NoDepth::NoSurface));
    }

    #[test]
    fn a_window_that_misses_gives_a_depth_only_by_false_alarm() {
        let frame = frame("", |scene| scene.stereo.disparity_sigma_px = 1.0);
        assert_eq!(frame.remark, None);
        let summary = frame.summary();
        let missed = frame
            .pixels
            .iter()
            .filter(|p| p.start.is_some() && !p.in_window);
        let painted = missed.clone().filter(|p| p.measured_m.is_some()).count();
        // Echoes just outside leave a significant tail in the window.
        assert!(missed.count() > 20 && painted <= 3, "{painted}");
        assert!(summary.rms_error_of_every_peak_m > summary.rms_error_m);
        // The other outliers are depths of something that the macropixel sees, though not of what sends back most: of another surface, or
        // of another part of a road that it sees over many metres.
        let mut scene = Scene::outdoor();
        scene.stereo.disparity_sigma_px = 1.0;
        let camera = scene.lidar_camera(16, 16);
        let is_there = |pixel: usize, measured_m: f64| {
            let (row, col) = ((pixel / 16) as f64, (pixel % 16) as f64);
            let rays = (0..64 * 64).map(|ray| {
                let phase = |n: i32| (f64::from(n) + 0.5) / 64.0;
                let (u, v) = (col + phase(ray % 64), row + phase(ray / 64));
                Ray::new(DVec3::ZERO, camera.at_unit_depth((u, v)))
            });
            let mut hits = rays.filter_map(|ray| scene.hit(&ray));
            hits.any(|hit| (measured_m - hit.range_m).abs() <= frame.bin_m)
        };
        let pixels = frame.pixels.iter().enumerate().filter(|(_, p)| p.in_window);
        // Of a strong echo that is metres deep the first photons fill the bins: such a depth is early, and has no bound.
        let wrong: Vec<(usize, f64)> = pixels
            .filter(|(_, p)| p.bound_m.is_some())
            .filter_map(|(pixel, p)| Some((pixel, p.measured_m?)))
            .filter(|&(pixel, measured_m)| !is_there(pixel, measured_m))
            .collect();
        assert_eq!(wrong, []);
    }
}
