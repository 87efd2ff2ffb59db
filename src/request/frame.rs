//! A frame as it is asked for, with a default for everything.

use std::path::PathBuf;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::{Spelling, guided_exposure, read_calibration};
use crate::chip::Sensor;
use crate::engine::CohortOptions;
use crate::files::InputError;
use crate::guide::{BehaviouralStereo, Guide, GuideInput, options};
use crate::ranging::DepthOptions;
use crate::scene::Scene;
use crate::settings::{Key, Range};
use crate::system::{EngineKind, FrameError, FrameSettings, NoBins, WindowPolicy};

/// What is asked of a frame beside its sensor and scene ([`Sources`](super::Sources)). Defaults are those of `gdtof frame`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FrameRequest {
    /// CLK periods in a laser cycle.
    pub stop_periods: u32,
    /// Laser cycles of the exposure.
    pub laser_cycles: u32,
    /// Seed of photons and guide errors.
    pub seed: u64,
    /// Engine of the macropixels.
    pub engine: EngineKind,
    /// Steps to a CLK period of the cohort engine, 1 to 64; without it, as fine as its error needs.
    pub sub_bins: Option<u8>,
    /// Depth error that a cheaper engine may add on average, m; without it, `engine` takes all macropixels.
    pub tolerance_m: Option<f64>,
    /// Leave out what the engine can do without, for the same histograms.
    pub skip: bool,
    /// Share of macropixels without an echo that may be given a depth.
    pub false_alarm_rate: f64,
    /// Mend the range walk of strong echoes.
    pub correct_walk: bool,
    /// File of a bin profile, for sensors with delay lines.
    pub calibration: Option<PathBuf>,
    /// What guides the windows, as `radar` or `radar:range_sigma_m=0.2` ([`options::KINDS`]); several are fused, and without
    /// any it is the scene's camera pair with drawn errors.
    pub guides: Vec<String>,
    /// What is changed in the window policy, as `unguided=neighbour,overlap=0.3`.
    pub windows: String,
    /// Slow CLK down until windows hold what the guide claims of its errors.
    pub bins_from_guide: bool,
    /// What complaints call these settings.
    #[serde(skip)]
    pub spelling: Spelling,
}

impl Default for FrameRequest {
    fn default() -> Self {
        FrameRequest {
            stop_periods: 520,
            laser_cycles: 1000,
            seed: 1,
            engine: EngineKind::default(),
            sub_bins: None,
            tolerance_m: None,
            skip: true,
            false_alarm_rate: 1e-3,
            correct_walk: true,
            calibration: None,
            guides: Vec::new(),
            windows: String::new(),
            bins_from_guide: false,
            spelling: Spelling::default(),
        }
    }
}

/// What can be asked of a frame, for files that ask for one.
pub const FRAME_KEYS: &[Key] = &[
    Key::chosen(
        "stop_periods",
        Range::Within(1.0, u32::MAX as f64),
        "CLK periods in a laser cycle",
    ),
    Key::chosen(
        "laser_cycles",
        Range::Within(1.0, u32::MAX as f64),
        "Laser cycles of the exposure",
    ),
    Key::chosen(
        "seed",
        Range::Within(0.0, f64::MAX),
        "Seed of photons and guide errors",
    ),
    Key::chosen(
        "engine",
        Range::OneOf(&["gate", "cycle", "window", "cohort"]),
        "Engine of the macropixels",
    ),
    Key::chosen(
        "sub_bins",
        Range::Within(1.0, 64.0),
        "Steps to a CLK period of the cohort engine; as fine as its error needs, if left out",
    ),
    Key::new(
        "tolerance_m",
        "m",
        Range::Within(0.0, f64::MAX),
        "Depth error that a cheaper engine may add on average; one engine takes all macropixels, if left out",
        "chosen",
    ),
    Key::chosen(
        "skip",
        Range::Switch,
        "Leave out what the engine can do without, for the same histograms",
    ),
    Key::chosen(
        "false_alarm_rate",
        Range::Above(0.0, 1.0),
        "Share of macropixels without an echo that may be given a depth",
    ),
    Key::chosen(
        "correct_walk",
        Range::Switch,
        "Mend the range walk of strong echoes",
    ),
    Key::chosen(
        "calibration",
        Range::Text,
        "File of a bin profile, for sensors with delay lines",
    ),
    Key::chosen(
        "guides",
        Range::Text,
        "List of what guides the windows, as \"radar:range_sigma_m=0.2\"; the scene's camera pair, if empty",
    ),
    Key::chosen(
        "windows",
        Range::Text,
        "What is changed in the window policy, as \"unguided=neighbour,overlap=0.3\"",
    ),
    Key::chosen(
        "bins_from_guide",
        Range::Switch,
        "Slow CLK down until windows hold what the guide claims of its errors",
    ),
];

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
        policy.with(&self.windows, &self.spelling.name("windows"))
    }

    /// Everything that a frame depends on, and how its windows are chosen. Of a calibration the file is read.
    ///
    /// # Errors
    /// What cannot be, by the setting at fault; a guide without a map, where bins are to follow it.
    pub fn settings(
        &self,
        sensor: Sensor,
        scene: Scene,
    ) -> Result<(FrameSettings, WindowPolicy), FrameError> {
        let guide = self.guide()?;
        let policy = self.policy(WindowPolicy::default())?;
        Ok((self.settings_by(sensor, scene, guide, &policy)?, policy))
    }

    /// As [`FrameRequest::settings`], with a guide and a policy of the caller's own.
    ///
    /// # Errors
    /// As those of [`FrameRequest::settings`].
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
        let (sensor, stop_periods) = match self.bins_from_guide {
            true => self.with_bins(sensor, &scene, &*guide, policy)?,
            false => (sensor, self.stop_periods),
        };
        let exposure = guided_exposure(&sensor, stop_periods, self.laser_cycles, self.spelling)?;
        if let Some(metres) = self.tolerance_m.filter(|m| !(m.is_finite() && *m >= 0.0)) {
            let message = format!("{metres} is no depth error; give metres, 0 or more");
            return Err(wrong("tolerance", message));
        }
        let rate = self.false_alarm_rate;
        check_false_alarm_rate(rate, self.spelling)?;
        if let Some(steps) = self.sub_bins.filter(|steps| !(1..=64).contains(steps)) {
            return Err(wrong(
                "sub_bins",
                format!("{steps} is impossible; give 1 to 64"),
            ));
        }
        let calibration = match &self.calibration {
            Some(path) => Some(read_calibration(path, &sensor)?),
            None => None,
        };
        Ok(FrameSettings {
            seed: self.seed,
            engine: self.engine,
            cohort: CohortOptions {
                sub_bins: self.sub_bins.map(usize::from),
                ..CohortOptions::default()
            },
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

/// Holds a share of false alarms to what it can be.
///
/// # Errors
/// When it is not above 0 and at most 1.
pub fn check_false_alarm_rate(rate: f64, spelling: Spelling) -> Result<(), InputError> {
    if rate > 0.0 && rate <= 1.0 {
        return Ok(());
    }
    let message = format!("{rate} is no share of macropixels; give a number above 0, up to 1");
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
        let message = format!("{guide_latency_ms} is no latency; give milliseconds, 0 to 100000");
        return wrong("guide_latency_ms", message);
    }
    if !(-1e5..=1e5).contains(&start_s) {
        let message = format!("{start_s} is no time; give seconds, -100000 to 100000");
        return wrong("start_s", message);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use toml::Table;

    use super::*;

    /// Keys of the table are those of the struct, with defaults within their ranges.
    #[test]
    fn the_table_of_keys_is_whole() {
        let all = FrameRequest {
            sub_bins: Some(4),
            tolerance_m: Some(0.01),
            calibration: Some("calibration.json".into()),
            ..FrameRequest::default()
        };
        let table = Table::try_from(&all).unwrap();
        assert_eq!(table.len(), FRAME_KEYS.len());
        for key in FRAME_KEYS {
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
