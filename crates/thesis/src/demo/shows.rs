//! What is shown in each demo, by its name.

use std::sync::Arc;

use super::Demonstrator;
use super::scenes;
use super::show::{Show, Target};
use crate::guide::{BehaviouralStereo, Fused, Kalman};
use crate::scene::Scene;
use crate::system::{Unguided, WindowPolicy};

/// The van of Fig. 99 and 100: four frames at each of some distances up to 75 m, at a walking pace; and at the 5 m/s of the built-in scene,
/// as the stereo guide sees it and with a guide that predicts.
pub fn van(demonstrator: &Demonstrator, seed: u64) -> Vec<Show> {
    let mut shows: Vec<Show> = VAN_LEGS_M
        .iter()
        .map(|&distance_m| van_at(demonstrator, VAN_M_S, distance_m, seed))
        .collect();
    shows[VAN_LEGS_M.len() - 1].compares = true;
    shows.push(van_at(demonstrator, 5.0, 70.0, seed));
    shows.push(predicted(van_at(demonstrator, 5.0, 70.0, seed)));
    shows
}

/// Four frames of the van from `distance_m` on.
pub(crate) fn van_at(
    demonstrator: &Demonstrator,
    speed_m_s: f64,
    distance_m: f64,
    seed: u64,
) -> Show {
    let name = format!("van_{speed_m_s}mps_{distance_m:.0}m");
    let mut show = target_show(demonstrator, name, scenes::van(speed_m_s), "van", seed);
    show.settings.start_s = (distance_m - 20.0) / speed_m_s;
    show
}

/// Distances of the van when its frames begin, m.
const VAN_LEGS_M: [f64; 5] = [22.0, 35.0, 50.0, 62.0, 72.0];
/// Its speed, which is not published, m/s: chosen, such that it “gradually distances itself”.
pub(crate) const VAN_M_S: f64 = 2.0;

/// The same with a guide that predicts from earlier frames beside the stereo pair.
fn predicted(mut show: Show) -> Show {
    let guides = Fused::new(vec![
        Arc::new(BehaviouralStereo),
        Arc::new(Kalman::default()),
    ]);
    show.settings.frame.guide = Arc::new(guides);
    show.name += "_predicted";
    show
}

/// A pedestrian comes nearer while the right camera has turned (Fig. 70, 107).
pub fn yaw(demonstrator: &Demonstrator, seed: u64) -> Vec<Show> {
    [0.0, -0.05, -0.1, 0.1]
        .map(|yaw_deg| pedestrian(demonstrator, yaw_deg, seed))
        .into()
}

/// The pedestrian, after the right camera has turned by `yaw_deg`.
pub(crate) fn pedestrian(demonstrator: &Demonstrator, yaw_deg: f64, seed: u64) -> Show {
    let scene = scenes::pedestrian(yaw_deg);
    let name = format!("yaw_{yaw_deg:+.2}deg");
    target_show(demonstrator, name, scene, "pedestrian", seed)
}

/// A car drives away at up to 65 mph while frames come three times a second (6.5.3), the last time with a guide that predicts.
pub fn speed(demonstrator: &Demonstrator, seed: u64) -> Vec<Show> {
    let mut shows: Vec<Show> = [0.0, 5.0, 30.0, 65.0]
        .map(|mph| car(demonstrator, mph, seed))
        .into();
    shows.push(predicted(car(demonstrator, 65.0, seed)));
    shows
}

/// The car at `mph`.
pub(crate) fn car(demonstrator: &Demonstrator, mph: f64, seed: u64) -> Show {
    let scene = scenes::car(metres_per_second(mph));
    target_show(
        demonstrator,
        format!("speed_{mph:.0}mph"),
        scene,
        "car",
        seed,
    )
}

/// A pedestrian and a car in fogs of several visibilities, which is not published (Fig. 101).
pub fn fog(demonstrator: &Demonstrator, seed: u64) -> Vec<Show> {
    let mut shows = vec![pedestrian_in_fog(demonstrator, seed)];
    shows[0].compares = true;
    let cars = CAR_VISIBILITIES_M.iter();
    shows.extend(cars.map(|&visibility_m| car_in_fog(demonstrator, visibility_m, seed)));
    shows
}

/// Visibilities in which the car is looked for, m.
pub(crate) const CAR_VISIBILITIES_M: [f64; 4] = [400.0, 300.0, 200.0, 150.0];

/// The pedestrian who crosses at 1 m/s in the built-in fog, 18 m ahead.
pub(crate) fn pedestrian_in_fog(demonstrator: &Demonstrator, seed: u64) -> Show {
    in_fog(
        demonstrator,
        150.0,
        "pedestrian",
        WHILE_THE_PEDESTRIAN_CROSSES_S,
        seed,
    )
}

/// The car, 60 m ahead, in a fog of this visibility.
pub(crate) fn car_in_fog(demonstrator: &Demonstrator, visibility_m: f64, seed: u64) -> Show {
    in_fog(demonstrator, visibility_m, "car", WITH_THE_CAR_FAR_S, seed)
}

/// Two frames of the fog.
fn in_fog(
    demonstrator: &Demonstrator,
    visibility_m: f64,
    target: &'static str,
    start_s: f64,
    seed: u64,
) -> Show {
    let scene = scenes::fog(visibility_m);
    let name = format!("fog_{visibility_m:.0}m_{target}");
    let mut show = target_show(demonstrator, name, scene, target, seed);
    show.settings.start_s = start_s;
    show.frames = 2;
    show.pictures = vec![1];
    show
}

/// When the frames of the fog begin that are about the pedestrian, s: 18 m ahead and 1 m to the right by then.
const WHILE_THE_PEDESTRIAN_CROSSES_S: f64 = 1.0;

/// And those about the car: it has 60 m by the middle of the first exposure, where it stops.
const WITH_THE_CAR_FAR_S: f64 = 5.65;

/// A figure behind a glass door (Fig. 102).
pub fn glass(demonstrator: &Demonstrator, seed: u64) -> Vec<Show> {
    let mut show = target_show(
        demonstrator,
        "glass".into(),
        scenes::built_in("glass"),
        "figure",
        seed,
    );
    show.range_m = (12.0, 24.0);
    show.compares = true;
    vec![show]
}

/// A street at night without a guide: macropixels step their windows over the range, as HSLIDAR was built to (4.9), in exposures of 25 ms,
/// and hold what they find.
pub fn night(demonstrator: &Demonstrator, seed: u64) -> Vec<Show> {
    let scene = scenes::built_in("night");
    let mut show = target_show(
        demonstrator,
        "night".into(),
        scene.clone(),
        "pedestrian",
        seed,
    );
    show.targets.push(Target::in_scene(&scene, "parked car"));
    show.settings.frame.guide = Arc::new(Kalman::default());
    show.settings.policy = WindowPolicy::for_sequences();
    show.settings.policy.unguided = Unguided::Sweep;
    show.settings.frame.exposure.laser_cycles = NIGHT_LASER_CYCLES;
    // The pedestrian moves by 3 cm meanwhile, a fourth of a macropixel and a ninth of the pulse's standard deviation.
    show.settings.segments = 1;
    // What a prediction takes is next to nothing.
    show.settings.clock.guide_latency_s = 0.001;
    show.frames = 120;
    show.pictures = vec![119];
    vec![show]
}

fn metres_per_second(mph: f64) -> f64 {
    mph * 1609.344 / 3600.0
}

/// Four frames of a scene with one target.
fn target_show(
    demonstrator: &Demonstrator,
    name: String,
    scene: Scene,
    target: &'static str,
    seed: u64,
) -> Show {
    Show {
        name,
        targets: vec![Target::in_scene(&scene, target)],
        settings: demonstrator.drive(scene, seed),
        frames: FRAMES,
        range_m: (20.0, 90.0),
        pictures: vec![FRAMES - 1],
        compares: false,
    }
}

/// Laser cycles of an exposure at night: 25 ms, between which windows step.
pub const NIGHT_LASER_CYCLES: u32 = 2_000;

/// Frames of Fig. 99 and 100 together.
const FRAMES: u32 = 4;
