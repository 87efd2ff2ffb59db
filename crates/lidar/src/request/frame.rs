//! The request for a frame, with a default for everything.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::spelling::Spelling;
use super::wording::guided_exposure;
use crate::chip::{Sensor, SensorConfig, Tdc};
use crate::engine::CohortOptions;
use crate::files::{InputError, parse_json, read_text};
use crate::guide::{BehaviouralStereo, Guide, GuideInput, options};
use crate::ranging::{BinProfile, DepthOptions};
use crate::scene::Scene;
use crate::settings::Range::{Above, Within};
use crate::settings::keys;
use crate::system::{EngineKind, FrameError, FrameSettings, NoBins, WindowPolicy};

keys! {
    /// Settings of a frame besides its sensor and scene ([`Sources`](super::Sources)). Defaults are those of `gdtof frame`.
    #[non_exhaustive]
    pub struct FrameRequest {
        /// CLK periods in a laser cycle.
        stop_periods: u32 = 520, in Within(1.0, u32::MAX as f64);
        /// Laser cycles of the exposure.
        laser_cycles: u32 = 1000, in Within(1.0, u32::MAX as f64);
        /// Seed of photons and guide errors.
        seed: u64 = 1, in Within(0.0, f64::MAX);
        /// Engine of the macropixels.
        engine: EngineKind = EngineKind::default();
        /// Depth error that a cheaper engine may add on average; one engine takes all macropixels, if left out.
        tolerance_m: Option<f64> ["m"] = None, in Within(0.0, f64::MAX);
        /// Leave out what the engine can do without, for the same histograms.
        skip: bool = true;
        /// Share of macropixels without an echo that may get a depth.
        false_alarm_rate: f64 = 1e-3, in Above(0.0, 1.0);
        /// Correct the range walk of strong echoes.
        correct_walk: bool = true;
        /// File of a bin profile, for sensors with delay lines.
        calibration: Option<PathBuf> = None;
        /// List of guides, such as "radar:range_sigma_m=0.2"; the scene's camera pair, if empty.
        ///
        /// [`options::KINDS`] lists them. Several are fused.
        guides: Vec<String> = Vec::new();
        /// Changes of the window policy, such as "unguided=neighbour,overlap=0.3".
        windows: String = String::new();
        /// Slow CLK down until windows are as long as the guide's reported uncertainty requires.
        bins_from_guide: bool = false;
        .. {
            /// What complaints call these settings.
            #[serde(skip)]
            spelling: Spelling = Spelling::default();
        }
    }
}

impl FrameRequest {
    /// The guide that is asked for.
    ///
    /// # Errors
    /// Unknown guides, bad keys and values, unreadable maps.
    pub fn guide(&self) -> Result<Arc<dyn Guide>, InputError> {
        if self.guides.is_empty() {
            return Ok(Arc::new(BehaviouralStereo));
        }
        let guides = self.guides.iter().map(String::as_str);
        options::parse_all(guides, &self.spelling.name("guide"))
    }

    /// `policy` with what is asked of it.
    ///
    /// # Errors
    /// Unknown keys and bad values.
    pub fn policy(&self, policy: WindowPolicy) -> Result<WindowPolicy, InputError> {
        policy.with_changes(&self.windows, &self.spelling.name("windows"))
    }

    /// Everything that a frame depends on, and how its windows are chosen. Of a calibration the file is read.
    ///
    /// # Errors
    /// Impossible values, named by the setting at fault; a guide without a map, if bins are to follow it.
    pub(crate) fn settings(
        &self,
        sensor: Sensor,
        scene: Scene,
    ) -> Result<(FrameSettings, WindowPolicy), FrameError> {
        let guide = self.guide()?;
        let policy = self.policy(WindowPolicy::default())?;
        Ok((self.settings_by(sensor, scene, guide, &policy)?, policy))
    }

    /// As `FrameRequest::settings`, with a guide and a policy of the caller's own.
    ///
    /// # Errors
    /// As those of `FrameRequest::settings`.
    pub fn settings_by(
        &self,
        sensor: Sensor,
        scene: Scene,
        guide: Arc<dyn Guide>,
        policy: &WindowPolicy,
    ) -> Result<FrameSettings, FrameError> {
        let wrong = |key: &str, message: String| {
            FrameError::Input(InputError::new(self.spelling.name(key), message))
        };
        let sensor = as_warm_as(&scene, sensor)?;
        let (sensor, stop_periods) = if self.bins_from_guide {
            self.with_bins(sensor, &scene, &*guide, policy)?
        } else {
            (sensor, self.stop_periods)
        };
        let exposure = guided_exposure(&sensor, stop_periods, self.laser_cycles, self.spelling)?;
        if let Some(metres) = self.tolerance_m.filter(|m| !(m.is_finite() && *m >= 0.0)) {
            let message = format!("{metres} is not a depth error; give metres, 0 or more");
            return Err(wrong("tolerance", message));
        }
        let rate = self.false_alarm_rate;
        check_false_alarm_rate(rate, self.spelling)?;
        let calibration = match &self.calibration {
            Some(path) => Some(read_calibration(path, &sensor)?),
            None => None,
        };
        Ok(FrameSettings {
            seed: self.seed,
            engine: self.engine,
            cohort: CohortOptions::default(),
            tolerance_m: self.tolerance_m,
            skip: self.skip,
            depth: DepthOptions {
                false_alarm_rate: rate,
                correct_walk: self.correct_walk,
                ..DepthOptions::default()
            },
            calibration,
            guide,
            ..FrameSettings::new(sensor, scene, exposure)
        })
    }

    /// The sensor and the CLK periods of a laser cycle, with the bins that the guide's errors ask for.
    fn with_bins(
        &self,
        sensor: Sensor,
        scene: &Scene,
        guide: &dyn Guide,
        policy: &WindowPolicy,
    ) -> Result<(Sensor, u32), FrameError> {
        let input = GuideInput::still(scene, sensor.rows as u32, sensor.cols as u32, self.seed);
        let map = guide.estimate(&input)?;
        let slowed = policy.slowed(&map, &sensor, self.stop_periods);
        Ok(slowed.map_err(|no_bins| {
            let cure = match no_bins {
                NoBins::DelayLines => String::new(),
                NoBins::Unsure { .. } => format!(
                    "; give another guide or a smaller {} within",
                    self.spelling.name("windows")
                ),
            };
            let name = self.spelling.name("bins_from_guide");
            InputError::new(name, format!("{no_bins}{cure}"))
        })?)
    }
}

/// The sensor in the scene's lidar: at its temperature, unless it has one of its own.
pub(super) fn as_warm_as(scene: &Scene, sensor: Sensor) -> Result<Sensor, InputError> {
    let (None, Some(junction_c)) = (sensor.temperature_c, scene.lidar.junction_c()) else {
        return Ok(sensor);
    };
    let warm = Sensor::new(SensorConfig {
        temperature_c: Some(junction_c),
        ..(*sensor).clone()
    });
    warm.map_err(|fault| {
        let message = format!("{fault}; or give sensor.temperature_c = 50, to leave the chip out");
        InputError::new("scene.lidar.temperature_c", message)
    })
}

/// Holds a share of false alarms to what it can be.
///
/// # Errors
/// When it is not above 0 and at most 1.
pub fn check_false_alarm_rate(rate: f64, spelling: Spelling) -> Result<(), InputError> {
    if rate > 0.0 && rate <= 1.0 {
        return Ok(());
    }
    let message = format!("{rate} is not a share of macropixels; give a number above 0, up to 1");
    Err(InputError::new(spelling.name("false_alarm_rate"), message))
}

/// Holds a drive's times to what they can be: how late its guide comes, ms, and when it begins, s.
///
/// # Errors
/// When the latency is not 0 to 100 s, or the beginning more than 10⁵ s from the scene's.
pub fn check_drive_times(
    guide_latency_ms: f64,
    start_s: f64,
    spelling: Spelling,
) -> Result<(), InputError> {
    let wrong = |key: &str, message: String| Err(InputError::new(spelling.name(key), message));
    if !(0.0..=1e5).contains(&guide_latency_ms) {
        let message =
            format!("{guide_latency_ms} is not a latency; give milliseconds, 0 to 100000");
        return wrong("guide_latency_ms", message);
    }
    if !(-1e5..=1e5).contains(&start_s) {
        let message = format!("{start_s} is not a time; give seconds, -100000 to 100000");
        return wrong("start_s", message);
    }
    Ok(())
}

/// Reads a profile (JSON, as `gdtof calibrate` writes it), which must be of this sensor.
///
/// # Errors
/// A file that is none, and another sensor's.
pub fn read_calibration(path: &Path, sensor: &SensorConfig) -> Result<BinProfile, InputError> {
    let wanted = "a bin profile, as gdtof calibrate makes it";
    let profile: BinProfile = parse_json(path.display(), &read_text(path)?, wanted)?;
    let is_whole = profile.macropixels.len() == profile.sensor.pixels()
        && profile.macropixels.iter().flatten().all(|line| {
            let lengths = [line.middle_s.len(), line.length_s.len()];
            lengths == [profile.sensor.bins; 2]
                && line
                    .length_s
                    .iter()
                    .chain(&line.middle_s)
                    .all(|s| s.is_finite())
        });
    let refused = match profile.check(sensor) {
        Ok(()) if sensor.tdc != Tdc::DelayLine => {
            Some("it is of delay lines, and this sensor's TDC is clocked".to_owned())
        }
        Ok(()) if is_whole => None,
        Ok(()) => Some("it does not have every bin of every macropixel".to_owned()),
        Err(other) => Some(other.to_string()),
    };
    match refused {
        None => Ok(profile),
        Some(why) => {
            let message = format!("{why}; make one for this sensor with gdtof calibrate");
            Err(InputError::new(path.display(), message))
        }
    }
}

#[cfg(test)]
mod tests {
    use toml::Table;

    use super::*;
    use crate::settings::Settings;

    #[test]
    fn defaults_are_within_their_ranges_and_read_back() {
        let all = FrameRequest {
            tolerance_m: Some(0.01),
            calibration: Some("calibration.json".into()),
            ..FrameRequest::default()
        };
        let table = Table::try_from(&all).unwrap();
        for key in FrameRequest::KEYS {
            assert_eq!(key.fault(&table[key.name]), None, "{}", key.name);
        }
        assert_eq!(table.try_into::<FrameRequest>().unwrap(), all);
    }

    #[test]
    fn what_is_wrong_is_called_as_it_was_written() {
        let cases: [(FrameRequest, &str); 4] = [
            (
                FrameRequest {
                    laser_cycles: 0,
                    ..FrameRequest::default()
                },
                "laser_cycles",
            ),
            (
                FrameRequest {
                    false_alarm_rate: f64::NAN,
                    ..FrameRequest::default()
                },
                "false_alarm_rate",
            ),
            (
                FrameRequest {
                    windows: "x=1".into(),
                    ..FrameRequest::default()
                },
                "windows",
            ),
            (
                FrameRequest {
                    guides: vec!["lidar".into()],
                    ..FrameRequest::default()
                },
                "guide",
            ),
        ];
        for (request, key) in cases {
            for spelling in [Spelling::Keys, Spelling::Options] {
                let request = FrameRequest {
                    spelling,
                    ..request.clone()
                };
                let refused = request.settings(Sensor::default(), Scene::outdoor());
                let sentence = refused.unwrap_err().to_string();
                assert!(sentence.starts_with(&spelling.name(key)), "{sentence}");
            }
        }
    }
}
