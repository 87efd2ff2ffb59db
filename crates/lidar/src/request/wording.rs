//! What users read of an error: what the library says, and the cure in the settings that they gave.

use super::spelling::Spelling;
use crate::chip::Irregular;
use crate::chip::race::{Cure, NoAim};
use crate::chip::{Exposure, ExposureError, Sensor, SensorConfig, WindowLaw};
use crate::engine::EngineError;
use crate::files::InputError;
use crate::system::FrameError;

/// Why there is no frame, with the cure if there is one.
pub fn sentence(error: &FrameError, spelling: Spelling) -> String {
    match error {
        FrameError::Engine(why) => of_engine(why, spelling),
        FrameError::Refused { why, .. } => {
            let cure = cure(why, spelling).unwrap_or_default();
            let tolerance = spelling.name("tolerance");
            format!("{error}; {cure}, or {tolerance}, which leaves them to the window engine")
        }
        _ => error.to_string(),
    }
}

/// Why an engine cannot run something, with the cure if there is one.
pub fn of_engine(error: &EngineError, spelling: Spelling) -> String {
    match cure(error, spelling) {
        Some(cure) => format!("{error}; {cure}"),
        None => error.to_string(),
    }
}

/// Whether the user can mend it.
pub fn is_bad_input(error: &FrameError) -> bool {
    match error {
        FrameError::Input(_) | FrameError::Guide(_) => true,
        FrameError::Engine(error) | FrameError::Refused { why: error, .. } => error.is_refusal(),
        _ => false,
    }
}

fn cure(error: &EngineError, spelling: Spelling) -> Option<String> {
    let engine = |name| spelling.assignment("engine", name);
    Some(match error {
        EngineError::Race { race, .. } => {
            let cure = of_race(&race.cure, spelling);
            format!("use {}, or {cure}", engine("gate"))
        }
        EngineError::Irregular(why) => {
            let cure = of_irregular(why, spelling);
            format!("use {} or gate, or {cure}", engine("cycle"))
        }
        EngineError::Joined(_) => format!(
            "use {} or cycle, or give front_end = \"summation\"",
            engine("gate")
        ),
        EngineError::FrontEnd(too_short) => too_short.cure(),
        EngineError::NoPhotons
        | EngineError::NotInCohorts(_)
        | EngineError::CoarseCohorts { .. } => format!("use {}", engine("window")),
        EngineError::CyclesNotIndependent { .. } => format!(
            "use {}, a longer laser cycle ({}) or less light",
            engine("window"),
            spelling.name("stop_periods")
        ),
        EngineError::Blinding { most_hz, .. } => format!(
            "give less than {:.1} Mcounts/s (less light, a smaller or darker lens, a narrower filter, a shorter dead time), or fewer macropixels or laser cycles",
            most_hz / 1e6
        ),
        EngineError::Flooded { .. } => {
            "give less light (a smaller pulse_energy_uj, a darker or farther target, a thinner medium or a larger overlap_m)".to_owned()
        }
        EngineError::OwnLaws => format!("use {}, cohort or gate", engine("window")),
        EngineError::Mismatch
        | EngineError::OtherSpads { .. }
        | EngineError::Stopped
        | EngineError::Unknown { .. } => return None,
    })
}

/// Why windows cannot be aimed, and the cure.
pub fn of_no_aim(why: &NoAim, spelling: Spelling) -> (String, String) {
    let cure = match why {
        NoAim::Race(race) => of_race(&race.cure, spelling),
        NoAim::Irregular(why) => of_irregular(why, spelling),
    };
    (why.to_string(), cure)
}

fn of_race(cure: &Cure, spelling: Spelling) -> String {
    match cure {
        Cure::LaserCycle => format!(
            "give other {}, or start values whose windows end elsewhere in the laser cycle",
            spelling.name("stop_periods")
        ),
        Cure::Period { .. }
        | Cure::Phase { .. }
        | Cure::LoadPeriod(_)
        | Cure::Tap
        | Cure::ResetChain
        | Cure::Cells => cure.to_string(),
    }
}

fn of_irregular(why: &Irregular, spelling: Spelling) -> String {
    let periods = spelling.name("stop_periods");
    match why {
        Irregular::LocalStopRepeats { .. } => {
            format!("give after_borrow = \"hold\", or other {periods}")
        }
        Irregular::CutWindow | Irregular::StartStaysHigh => {
            format!("give more {periods}, or a lower start value")
        }
        Irregular::OwnCounter(_) => {
            "give a P-counter that raises LOCAL_STOP once, a step later from each start value on"
                .to_owned()
        }
        Irregular::Miscounts { .. } => "give another p_counter or library".to_owned(),
        Irregular::OwnBlock(key) => format!("leave out {key}"),
        Irregular::OwnCodes => "give tdc = \"clocked\"".to_owned(),
        Irregular::OutOfStep { round, .. } => {
            format!("give {periods} {round}, or another p_counter")
        }
    }
}

/// An exposure of `laser_cycles` laser cycles of `stop_periods` CLK periods.
///
/// # Errors
/// An impossible length, named by the setting at fault.
pub fn exposure(
    config: &SensorConfig,
    stop_periods: u32,
    laser_cycles: u32,
    spelling: Spelling,
) -> Result<Exposure, InputError> {
    Exposure::checked(config, stop_periods, laser_cycles).map_err(|fault| {
        let key = match fault {
            ExposureError::ShortCycle { .. } => "stop_periods",
            ExposureError::NoCycle | ExposureError::TooLong { .. } => "laser_cycles",
        };
        InputError::new(spelling.name(key), fault.to_string())
    })
}

/// As [`exposure`], of a sensor whose windows a guide can aim.
///
/// # Errors
/// As those of [`exposure`], and a sensor whose windows cannot be aimed.
pub fn guided_exposure(
    sensor: &Sensor,
    stop_periods: u32,
    laser_cycles: u32,
    spelling: Spelling,
) -> Result<Exposure, InputError> {
    let exposure = exposure(sensor, stop_periods, laser_cycles, spelling)?;
    match WindowLaw::new(sensor, &exposure).refusal() {
        None => Ok(exposure),
        Some(why) => {
            let (why, cure) = of_no_aim(&why, spelling);
            let message = format!("{why}, so the guide cannot aim time windows; {cure}");
            Err(InputError::new(spelling.name("sensor"), message))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::{AfterBorrow, ChipTiming};
    use crate::engine::{Replay, Window};

    #[test]
    fn refusals_come_with_options_that_help() {
        let timing = ChipTiming::new(&SensorConfig::default());
        let strobe = timing.ripple() + timing.local_stop_to_strobe - timing.clk_to_shift;
        let at_the_strobe = SensorConfig {
            clk_hz: 0.5 / strobe.as_s(),
            ..SensorConfig::default()
        };
        let wrapping = SensorConfig {
            after_borrow: AfterBorrow::Wrap,
            ..SensorConfig::default()
        };
        for (config, says) in [
            (
                at_the_strobe,
                [
                    "so only the gate engine",
                    "use --engine gate, or give clk_hz of at most",
                ],
            ),
            (
                wrapping,
                [
                    "LOCAL_STOP rises more than once",
                    "use --engine cycle or gate, or give after_borrow = \"hold\", or other --stop-periods",
                ],
            ),
        ] {
            let exposure = Exposure::new(&config, 4096, 1);
            let window = Window::new(&config, &exposure);
            let refused = window.histogram(100, &[]).unwrap_err();
            assert!(!refused.to_string().contains("--"), "{refused}");
            let sentence = of_engine(&refused, Spelling::Options);
            for part in says {
                assert!(sentence.contains(part), "{sentence}");
            }
        }
    }
}
