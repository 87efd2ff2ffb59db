//! Work that frames share: what follows from the same settings is done once.
//!
//! ```text
//!   sensor, start values ───────────► load at gate level
//!   look of the scene, exposure ──┬─► what is really there
//!                                 ├─► light, of each strength
//!                 guide's seed ───┴─► guide's map ─► windows
//!   light, start value ─────────────► classes of laser cycles of the engine `cohort`
//! ```
//!
//! Nothing is kept but what is a function of what it is kept under, so frames are the same as each by itself. Frames of a study have it, whose
//! points often differ in the strength of light or in seeds alone.

use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use super::error::FrameError;
use super::light::{light_in, truth_in};
use super::load::load_starts;
use super::policy::{Pointing, WindowPolicy};
use super::settings::FrameSettings;
use crate::chip::{Exposure, Sensor};
use crate::engine::{Cohort, CohortOptions, load};
use crate::guide::{GuideInput, GuideMap};
use crate::netlist::Netlist;
use crate::photon::{PhotonStream, PixelLight};
use crate::scene::{GroundTruth, Lidar, Light, Scene};
use crate::units::Time;

/// Seeds whose start values and windows are kept.
const MOST_SEEDS: u64 = 128;

/// Sensors whose load path is kept, and looks.
const MOST_SENSORS: usize = 4;
const MOST_LOOKS: usize = 4;

/// Lights of a look, and engines that keep what they compute of a light: each thread may be at another one.
const MOST_LIGHTS: usize = 4;
const MOST_ENGINES: usize = 2;

/// The latest results of some work, with what they follow from.
#[derive(Debug)]
struct Latest<K, V> {
    most: usize,
    known: Mutex<Vec<(K, Arc<V>)>>,
}

impl<K: PartialEq, V> Latest<K, V> {
    fn new(most: usize) -> Self {
        Latest {
            most,
            known: Mutex::default(),
        }
    }

    fn lock(&self) -> MutexGuard<'_, Vec<(K, Arc<V>)>> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What follows from `key`: what is known, or what `work` gives. Two threads may do the same work.
    ///
    /// # Errors
    /// What `work` reports.
    fn get<E>(&self, key: K, work: impl FnOnce(&K) -> Result<V, E>) -> Result<Arc<V>, E> {
        if let Some((_, value)) = self.lock().iter().find(|(known, _)| *known == key) {
            return Ok(Arc::clone(value));
        }
        let value = Arc::new(work(&key)?);
        let mut known = self.lock();
        // Another thread may have been faster.
        if let Some((_, value)) = known.iter().find(|(known, _)| *known == key) {
            return Ok(Arc::clone(value));
        }
        if known.len() == self.most {
            known.remove(0);
        }
        known.push((key, Arc::clone(&value)));
        Ok(value)
    }
}

/// What frames of one process may share, on any threads.
pub(crate) struct SharedWork {
    load_paths: Latest<Sensor, Netlist>,
    loads: Latest<(Sensor, Vec<u16>), Time>,
    looks: Mutex<Vec<Arc<SharedView>>>,
    engines: Latest<(Arc<SharedView>, Lidar, Light, CohortOptions), Cohort>,
    /// How many seeds frames have that are else the same.
    seeds: u64,
}

/// A guide's map, and the windows that it leads to: a start value for every macropixel, `None` where SPADs are off.
pub(super) type GuidedWindows = (GuideMap, Vec<Option<u16>>);

/// What frames share whose scenes look alike, in one exposure of one array.
#[derive(Debug)]
pub(super) struct SharedView {
    /// One of the scenes.
    scene: Scene,
    sensor: Sensor,
    exposure: Exposure,
    truth: OnceLock<Arc<GroundTruth>>,
    lights: Latest<(Lidar, Light), Vec<PixelLight>>,
    windows: Latest<(String, u64, WindowPolicy), GuidedWindows>,
}

/// A look is itself alone.
impl PartialEq for SharedView {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self, other)
    }
}

impl SharedWork {
    /// For frames with the same settings but `seeds` different seeds.
    pub(crate) fn new(seeds: u64) -> Self {
        let kept_seeds = seeds.clamp(1, MOST_SEEDS) as usize;
        SharedWork {
            load_paths: Latest::new(MOST_SENSORS),
            loads: Latest::new(kept_seeds),
            looks: Mutex::default(),
            engines: Latest::new(MOST_ENGINES),
            seeds,
        }
    }

    /// The engine `cohort` for settings with this look.
    pub(super) fn cohort(&self, look: &Arc<SharedView>, settings: &FrameSettings) -> Arc<Cohort> {
        let FrameSettings { scene, cohort, .. } = settings;
        let engine = || Cohort::new(&look.sensor, &look.exposure, *cohort);
        if self.seeds < 2 {
            return Arc::new(engine());
        }
        let key = (Arc::clone(look), scene.lidar.clone(), scene.light, *cohort);
        let keeping = |_: &_| Ok::<_, std::convert::Infallible>(engine().keeping());
        let Ok(engine) = self.engines.get(key, keeping);
        engine
    }

    /// Loads start values at gate level, and tells how long the chip takes for it.
    ///
    /// # Errors
    /// Another start value in the array than was sent.
    pub(super) fn load(&self, sensor: &Sensor, starts: Vec<u16>) -> Result<Time, FrameError> {
        let load = |(sensor, starts): &(Sensor, Vec<u16>)| {
            let elaborate = |sensor: &Sensor| Ok::<_, FrameError>(load::load_netlist(sensor));
            let load_path = self.load_paths.get(sensor.clone(), elaborate)?;
            Ok::<_, FrameError>(load_starts(sensor, &load_path, starts)?.duration)
        };
        Ok(*self.loads.get((sensor.clone(), starts), load)?)
    }

    /// What frames with these settings share with those whose scenes look like this one.
    pub(super) fn shared_look(&self, settings: &FrameSettings) -> Arc<SharedView> {
        let FrameSettings {
            sensor,
            scene,
            exposure,
            ..
        } = settings;
        let mut looks = self.looks.lock().unwrap_or_else(PoisonError::into_inner);
        let is_its = |look: &&Arc<SharedView>| {
            look.exposure == *exposure && look.sensor == *sensor && look.scene.looks_like(scene)
        };
        if let Some(look) = looks.iter().find(is_its) {
            return Arc::clone(look);
        }
        if looks.len() == MOST_LOOKS {
            looks.remove(0);
        }
        let look = Arc::new(SharedView {
            scene: scene.clone(),
            sensor: sensor.clone(),
            exposure: *exposure,
            truth: OnceLock::new(),
            lights: Latest::new(MOST_LIGHTS),
            windows: Latest::new(self.seeds.clamp(1, MOST_SEEDS) as usize),
        });
        looks.push(Arc::clone(&look));
        look
    }
}

impl SharedView {
    /// What is really there.
    pub(super) fn truth(&self) -> Arc<GroundTruth> {
        let render = || Arc::new(truth_in(&self.sensor, &self.exposure, &self.scene));
        Arc::clone(self.truth.get_or_init(render))
    }

    /// The light of an exposure to `scene`, which has this look, on the SPADs of `stream`, which are the sensor's.
    pub(super) fn light(&self, scene: &Scene, stream: &PhotonStream) -> Arc<Vec<PixelLight>> {
        let key = (scene.lidar.clone(), scene.light);
        let light = |_: &_| {
            let light = light_in(&self.exposure, scene, &self.truth(), stream);
            Ok::<_, std::convert::Infallible>(light)
        };
        let Ok(light) = self.lights.get(key, light);
        light
    }

    /// The map of the guide that `settings` have, and the windows of a policy; `None` where they depend on more than the look.
    ///
    /// # Errors
    /// A guide without a map.
    pub(super) fn windows(
        &self,
        settings: &FrameSettings,
        policy: WindowPolicy,
    ) -> Result<Option<Arc<GuidedWindows>>, FrameError> {
        let guide = &settings.guide;
        if settings.calibration.is_some() || !guide.follows_from_look() {
            return Ok(None);
        }
        let windows = |_: &_| {
            let (rows, cols) = (self.sensor.rows as u32, self.sensor.cols as u32);
            let input = GuideInput::still(&self.scene, rows, cols, settings.seed);
            let map = guide.estimate(&input)?;
            let mut pointing = Pointing::new(policy, &self.sensor, &self.exposure, None);
            let wanted = pointing.windows(&map, &[]);
            Ok::<_, FrameError>((map, wanted))
        };
        let key = (guide.name().to_owned(), settings.seed, policy);
        Ok(Some(self.windows.get(key, windows)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::SensorConfig;
    use crate::system::frame::take_shared_frame;
    use crate::system::{EngineKind, Frame, take_frame};
    use proptest::prelude::*;

    fn settings(
        (energy, klux, turn_deg): (usize, usize, usize),
        (seed, rows): (u64, usize),
    ) -> FrameSettings {
        let mut scene = Scene::outdoor();
        scene.lidar.pulse_energy_uj = [2.0, 20.0, 100.0][energy];
        scene.light.illuminance_klux = [10.0, 50.0][klux];
        scene.stereo.yaw_error_deg = [0.0, 0.05][turn_deg];
        let sensor = SensorConfig {
            rows,
            cols: 8,
            ..SensorConfig::default()
        };
        let exposure = Exposure::new(&sensor, 520, 50);
        FrameSettings {
            seed,
            engine: EngineKind::Cohort,
            ..FrameSettings::new(sensor, scene, exposure)
        }
    }

    fn results(frame: &Frame) -> impl PartialEq + std::fmt::Debug + use<> {
        (
            frame.histograms.clone(),
            frame.pixels.clone(),
            frame.remark.clone(),
            (frame.load_time, frame.photons_expected.to_bits()),
        )
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(6))]

        /// Frames in any order, some of them with the light, the look, the seed or the sensor of earlier ones, are those that each is by itself.
        #[test]
        fn frames_that_share_work_are_those_without(
            asked in prop::collection::vec(((0usize..3, 0usize..2, 0usize..2), (1u64..4, 6usize..8)), 4..16),
        ) {
            let shared = SharedWork::new(3);
            let policy = WindowPolicy::default();
            for (scene, sensor) in asked {
                let settings = settings(scene, sensor);
                let together = take_shared_frame(&settings, policy, &shared, |_| ()).unwrap();
                let alone = take_frame(&settings, |_| Vec::new(), |_| ()).unwrap();
                prop_assert_eq!(results(&together), results(&alone));
            }
        }
    }

    #[test]
    fn the_same_work_is_done_once_and_the_oldest_is_forgotten() {
        let latest: Latest<u32, u32> = Latest::new(2);
        let done = std::cell::Cell::new(0);
        let square = |n: u32| {
            let work = |n: &u32| {
                done.set(done.get() + 1);
                Ok::<_, std::convert::Infallible>(n * n)
            };
            let Ok(value) = latest.get(n, work);
            *value
        };
        assert_eq!([3, 4, 3, 4].map(square), [9, 16, 9, 16]);
        assert_eq!(done.get(), 2);
        assert_eq!([5, 3, 5].map(square), [25, 9, 25]);
        assert_eq!(done.get(), 4);
    }
}
