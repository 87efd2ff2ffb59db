//! Frames that are stopped, and frames ranged again.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::*;
use crate::chip::SensorConfig;
use crate::scene::Scene;
use crate::system::range_counts;

fn settings() -> FrameSettings {
    let sensor = SensorConfig {
        rows: 16,
        cols: 16,
        ..SensorConfig::default()
    };
    let exposure = Exposure::new(&sensor, 520, 200);
    FrameSettings::new(sensor, Scene::outdoor(), exposure)
}

#[test]
fn a_frame_that_is_no_longer_wanted_begins_no_other_batch() {
    let settings = settings();
    let exposed = AtomicUsize::new(0);
    let stop_at_first = |macropixels| {
        let before = exposed.fetch_add(macropixels, Ordering::Relaxed);
        if before + macropixels > 0 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let refused = alone
        .unwrap()
        .install(|| take_frame(&settings, |_| Vec::new(), stop_at_first));
    assert!(matches!(
        refused,
        Err(FrameError::Engine(EngineError::Stopped))
    ));
    let engine = Window::new(&settings.sensor, &settings.exposure);
    assert_eq!(
        exposed.load(Ordering::Relaxed),
        crate::engine::Engine::batch(&engine)
    );
    // Nobody's cohorts were at fault.
    let cohort = FrameSettings {
        engine: EngineKind::Cohort,
        ..settings
    };
    let refused = take_frame(&cohort, |_| Vec::new(), |_| ControlFlow::Break(()));
    assert!(matches!(
        refused,
        Err(FrameError::Engine(EngineError::Stopped))
    ));
}

#[test]
fn a_frames_own_counts_have_its_depths() {
    let settings = settings();
    let frame = take_frame(&settings, |_| Vec::new(), |_| {}).unwrap();
    let starts: Vec<Option<u16>> = frame.pixels.iter().map(|pixel| pixel.start).collect();
    let readings = range_counts(
        (&settings.sensor, &settings.exposure),
        &settings.scene,
        &settings.depth,
        None,
        &starts,
        &frame.histograms,
    )
    .unwrap();
    assert!(readings.iter().any(|reading| reading.no_depth.is_none()));
    for (reading, pixel) in readings.iter().zip(&frame.pixels) {
        assert_eq!(reading.measured_m, pixel.measured_m);
        assert_eq!(reading.peak_m, pixel.peak_m);
        assert_eq!(reading.confidence, pixel.confidence);
        assert_eq!(reading.no_depth.is_none(), pixel.no_depth.is_none());
        let is_off = reading.no_depth == Some(crate::system::NoDepth::NoGuide);
        assert!(!is_off || pixel.start.is_none());
    }
}
