//! What users read of an error: what the library says, and the cure in options of `gdtof`.

use crate::chip::race::{Cure, NoAim};
use crate::chip::window_law::Irregular;
use crate::chip::{Exposure, ExposureError, SensorConfig, WindowLaw};
use crate::engine::EngineError;
use crate::files::InputError;
use crate::system::FrameError;

/// The sentence for standard error.
pub(super) fn sentence(error: &anyhow::Error) -> String {
    if let Some(error) = error.downcast_ref::<EngineError>() {
        return with_cure(error);
    }
    match error.downcast_ref::<FrameError>() {
        Some(FrameError::Engine(why)) => with_cure(why),
        Some(refused @ FrameError::Refused { why, .. }) => {
            let cure = cure(why).unwrap_or_default();
            format!("{refused}; {cure}, or --tolerance, which leaves them to the window engine")
        }
        _ => format!("{error:#}"),
    }
}

/// Whether the user can mend it.
pub(super) fn is_bad_input(error: &anyhow::Error) -> bool {
    error.is::<InputError>()
        || matches!(error.downcast_ref::<EngineError>(), Some(e) if e.is_refusal())
        || match error.downcast_ref() {
            Some(FrameError::Input(_) | FrameError::Guide(_)) => true,
            Some(FrameError::Engine(error) | FrameError::Refused { why: error, .. }) => {
                error.is_refusal()
            }
            _ => false,
        }
}

fn with_cure(error: &EngineError) -> String {
    match cure(error) {
        Some(cure) => format!("{error}; {cure}"),
        None => error.to_string(),
    }
}

fn cure(error: &EngineError) -> Option<String> {
    Some(match error {
        EngineError::Race(race) => {
            format!("use --engine gate, or {}", of_race(&race.cure))
        }
        EngineError::Irregular(why) => {
            format!("use --engine cycle or gate, or {}", of_irregular(why))
        }
        EngineError::Joined(_) => {
            "use --engine gate or cycle, or give front_end = \"summation\"".to_owned()
        }
        EngineError::FrontEnd(too_short) => too_short.cure(),
        EngineError::NoPhotons | EngineError::NotInCohorts(_) => "use --engine window".to_owned(),
        EngineError::CyclesNotIndependent { .. } => {
            "use --engine window, a longer laser cycle (--stop-periods) or less light".to_owned()
        }
        EngineError::CoarseCohorts { .. } => {
            "use --engine window, or --sub-bins with less exactness".to_owned()
        }
        EngineError::Blinding { most_hz, .. } => format!(
            "give less than {:.1} Mcounts/s (less light, a smaller or darker lens, a narrower filter, a shorter dead time), or fewer macropixels or laser cycles",
            most_hz / 1e6
        ),
        EngineError::OwnLaws => "use --engine window, cohort or gate".to_owned(),
        EngineError::Mismatch | EngineError::OtherSpads { .. } | EngineError::Unknown { .. } => {
            return None;
        }
    })
}

/// Why windows cannot be aimed, and the cure.
pub(super) fn of_no_aim(why: &NoAim) -> (String, String) {
    let cure = match why {
        NoAim::Race(race) => of_race(&race.cure),
        NoAim::Irregular(why) => of_irregular(why),
    };
    (why.to_string(), cure)
}

fn of_race(cure: &Cure) -> String {
    match cure {
        Cure::LaserCycle => "give other --stop-periods, or start values whose windows end elsewhere in the laser cycle".to_owned(),
        Cure::Period { .. } | Cure::Phase { .. } | Cure::Tap => cure.to_string(),
    }
}

fn of_irregular(why: &Irregular) -> String {
    match why {
        Irregular::LocalStopRepeats { .. } => {
            "give after_borrow = \"hold\", or other --stop-periods".to_owned()
        }
        Irregular::OutOfStep { round, .. } => {
            format!("give --stop-periods {round}, or another p_counter")
        }
    }
}

/// An exposure whose length is given with `--stop-periods` and `--laser-cycles`.
///
/// # Errors
/// A length that cannot be, by the option at fault.
pub(super) fn exposure(
    config: &SensorConfig,
    stop_periods: u32,
    laser_cycles: u32,
) -> Result<Exposure, InputError> {
    Exposure::checked(config, stop_periods, laser_cycles).map_err(|fault| {
        let option = match fault {
            ExposureError::ShortCycle { .. } => "--stop-periods",
            ExposureError::NoCycle | ExposureError::TooLong { .. } => "--laser-cycles",
        };
        InputError::new(option, fault.to_string())
    })
}

/// As [`exposure`], of a sensor whose windows a guide can aim.
///
/// # Errors
/// As those of [`exposure`], and a sensor whose windows cannot be aimed.
pub(super) fn guided_exposure(
    config: &SensorConfig,
    stop_periods: u32,
    laser_cycles: u32,
) -> Result<Exposure, InputError> {
    let exposure = exposure(config, stop_periods, laser_cycles)?;
    match WindowLaw::new(config, &exposure).refusal() {
        None => Ok(exposure),
        Some(why) => {
            let (why, cure) = of_no_aim(&why);
            let message = format!("{why}, so the guide cannot aim time windows; {cure}");
            Err(InputError::new("--sensor", message))
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
        let timing = ChipTiming::of(&SensorConfig::default());
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
            let sentence = sentence(&refused.into());
            for part in says {
                assert!(sentence.contains(part), "{sentence}");
            }
        }
    }
}
