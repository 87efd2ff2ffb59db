//! A drive between two frames.

use super::reuse::PreviousFrame;
use super::self_calibration::SelfCalibration;
use super::settings::{DriveSettings, FrameClock, FrameTimes};
use crate::engine::load;
use crate::guide::{CameraViews, PastFrame};
use crate::netlist::Netlist;
use crate::system::error::FrameError;
use crate::system::policy::Pointing;
use crate::system::ranger::Ranger;
use crate::system::settings::FrameSettings;
use crate::units::Time;

/// A drive that goes on from frame to frame; its memory does not grow.
#[derive(Debug)]
pub struct DriveSimulation<'a> {
    pub(super) settings: &'a DriveSettings,
    pub(super) pointing: Pointing<'a>,
    pub(super) ranger: Ranger<'a>,
    pub(super) load_netlist: Netlist,
    pub(super) next: u32,
    pub(super) past: Vec<PastFrame>,
    pub(super) views: CameraViews,
    pub(super) last: Option<PreviousFrame>,
    pub(super) self_calibration: Option<SelfCalibration>,
}

impl<'a> DriveSimulation<'a> {
    /// Before the first frame.
    ///
    /// # Errors
    /// Bins in which no depths are found.
    pub fn new(settings: &'a DriveSettings) -> Result<Self, FrameError> {
        debug_assert!(settings.segments > 0);
        let FrameSettings {
            sensor,
            scene,
            exposure,
            depth,
            calibration,
            ..
        } = &settings.frame;
        let calibration = calibration.as_ref();
        Ok(DriveSimulation {
            settings,
            pointing: Pointing::new(settings.policy, sensor, exposure, calibration),
            ranger: Ranger::new(sensor, exposure, scene, depth, calibration)?,
            load_netlist: load::load_netlist(sensor),
            next: 0,
            past: Vec::new(),
            views: CameraViews::default(),
            last: None,
            self_calibration: (settings.self_calibrates)
                .then(|| SelfCalibration::new(scene, sensor.rows as u32, sensor.cols as u32)),
        })
    }

    /// From one frame to the next, s.
    pub fn period_s(&self) -> f64 {
        let FrameClock {
            guide_latency_s,
            pipelined,
        } = self.settings.clock;
        let chip_s = self.chip_s().iter().sum::<f64>();
        let able_s = if pipelined {
            guide_latency_s.max(chip_s)
        } else {
            guide_latency_s + chip_s
        };
        self.settings.frame.scene.lidar.frame_s(able_s)
    }

    /// What load, exposure and readout take, s.
    pub fn chip_s(&self) -> [f64; 3] {
        let FrameSettings {
            sensor, exposure, ..
        } = &self.settings.frame;
        [sensor.load_time(), exposure.end(), sensor.readout_time()].map(Time::as_s)
    }

    /// When the parts of a frame begin and end.
    pub(super) fn times(&self, number: u32) -> FrameTimes {
        let [load_s, exposure_s, readout_s] = self.chip_s();
        let images = self.settings.start_s + f64::from(number) * self.period_s();
        let loads = images + self.settings.clock.guide_latency_s;
        let exposes = loads + load_s;
        let reads = exposes + exposure_s;
        FrameTimes {
            images_s: images,
            load_s: loads,
            exposure_s: exposes,
            readout_s: reads,
            end_s: reads + readout_s,
        }
    }
}
