//! Why an engine has no answer: facts and numbers. What may be done about it depends on who asked; the command line words
//! its cures itself.

use std::collections::{BTreeMap, BTreeSet};

use crate::chip::Irregular;
use crate::chip::front_end::{DeadTimeTooShort, PulseLimits};
use crate::chip::race::NoAim;
use crate::chip::window_law::WindowOutcome;
use crate::chip::{FrontEnd, Race, Sensor, Tdc, WindowLaw};
use crate::units::Time;

/// Why an engine has no answer.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EngineError {
    /// The window law finds two signals too close to call.
    #[error("{}{race}, so only the gate engine can tell what is counted", listed(.starts))]
    Race {
        /// What meets what, for the first of the start values.
        race: Race,
        /// The start values concerned, in ascending order; none where it does not depend on them.
        starts: Vec<u16>,
    },
    /// The window law has no single window for this start value.
    #[error("{0}, so the window law cannot tell what is counted")]
    Irregular(Irregular),
    /// Pulses are shorter, or follow each other faster, than the front end's flip-flops.
    #[error("{0}")]
    FrontEnd(DeadTimeTooShort),
    /// SPADs share a wire, and what a pulse does depends on those of others.
    #[error(
        "front_end = {:?} joins all SPADs on one wire, on which the delays of gates decide what is counted, so only the gate engine can tell",
        .0.name()
    )]
    Joined(FrontEnd),
    /// The cohort engine works without photons.
    #[error("the cohort engine knows no single photons and cannot replay recorded ones")]
    NoPhotons,
    /// The cohort engine's model of light and SPADs leaves this out.
    #[error("the cohort engine cannot follow {0}")]
    NotInCohorts(NotModelled),
    /// Laser cycles depend on each other: a bound on the probability, over a macropixel's exposure.
    #[error(
        "SPADs may stay busy from one laser cycle's window to the next (probability up to {bound:.1e}), which the cohort engine cannot follow"
    )]
    CyclesNotIndependent {
        /// The bound.
        bound: f64,
    },
    /// The finest cells of the cohort engine do not keep its error.
    #[error(
        "the cohort engine, with {cells} cells to a CLK period, may put the mean of bin {bin} off by {off:.2e} counts where its counting noise is {noise:.2e}"
    )]
    CoarseCohorts {
        /// First bin concerned.
        bin: usize,
        /// What its mean may be off, counts.
        off: f64,
        /// Standard deviation of its count.
        noise: f64,
        /// Cells of a CLK period at least.
        cells: u32,
    },
    /// Background light blinds SPADs more than half of the time, and there are too many such photons to follow.
    #[error(
        "background light of {:.1} Mcounts/s a SPAD keeps it blind for {:.0} % of the time, which it does for more than half of it from {:.1} Mcounts/s on, and the exposure has {photons:.1e} such photons, of which {most_photons:.0e} are simulated",
        background_hz / 1e6,
        100.0 * background_hz / (background_hz + most_hz),
        most_hz / 1e6,
    )]
    Blinding {
        /// Background photons and dark counts of a SPAD, 1/s, where there are most.
        background_hz: f64,
        /// From that rate on a SPAD is blind more than half of the time, 1/s.
        most_hz: f64,
        /// Photons of all macropixels in such light in the exposure.
        photons: f64,
        /// As many are simulated.
        most_photons: f64,
    },
    /// An echo whose photons are held in memory has too many.
    #[error(
        "an echo has {photons:.1e} photons a laser cycle on a macropixel, of which {most_photons:.0e} are held in memory"
    )]
    Flooded {
        /// Photons of the echo, on average.
        photons: f64,
        /// As many are held.
        most_photons: f64,
    },
    /// Each macropixel has delays of its own, and this engine has one set of them.
    #[error(
        "cells differ at random (mismatch), so that each macropixel has delays of its own, which only the engine with per-macropixel delays follows"
    )]
    Mismatch,
    /// Each macropixel has a window law of its own by description, and this engine has one law.
    #[error(
        "each macropixel has delay lines of its own, or a CLK that comes later than another's, which only the engines gate, window and cohort follow"
    )]
    OwnLaws,
    /// Light is given for SPADs one by one, but for another number of them than a macropixel has.
    #[error("light is given for {given} SPADs, but a macropixel has {spads}; give as many")]
    OtherSpads {
        /// SPADs that light is given for.
        given: usize,
        /// SPADs of a macropixel.
        spads: usize,
    },
    /// Who was told of its progress wanted no more of it.
    #[error("the exposure was stopped before its end")]
    Stopped,
    /// A histogram bin of the netlist holds X.
    #[error("bin {bin} of {macropixel} is unknown (X) at the end of the exposure")]
    Unknown {
        /// Name of the macropixel, or its lane.
        macropixel: String,
        /// First unknown bin.
        bin: usize,
    },
}

/// What the cohort engine's model of light and SPADs leaves out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NotModelled {
    /// Bins have a length.
    #[error("bins without length")]
    EmptyBins,
    /// Two pulses of a SPAD may fall into one bin.
    #[error("a dead time ({dead_time}) shorter than a bin ({bin})")]
    ShortDeadTime {
        /// The SPADs' dead time.
        dead_time: Time,
        /// The longest bin of the window.
        bin: Time,
    },
    /// Pulses that leave no edge on a photon line because they are closer than an XOR's delay.
    #[error("light in which many pulses meet on the photon line at an edge of bin {bin}")]
    Meetings {
        /// First bin concerned.
        bin: usize,
    },
    /// Avalanches that prolong a dead time and trigger others.
    #[error("afterpulses and crosstalk of paralysable SPADs")]
    SecondariesOfParalysable,
    /// Neighbours that fire together, where events depend on how many do.
    #[error("crosstalk where an event takes more than one SPAD")]
    CrosstalkInCoincidence,
    /// A laser pulse that is not Gaussian as it is detected.
    #[error("a measured laser pulse, or late avalanches of a diffusion tail")]
    MeasuredPulse,
    /// SPADs with a detection efficiency, dark count rate or dead time of their own.
    #[error("SPADs that differ")]
    SpadsThatDiffer,
    /// Bins that count several photons of a laser cycle.
    #[error("a counter TDC, whose bins add up all SPADs that fire in a CLK period")]
    CounterTdc,
    /// Pulses of other lasers, which come at another time of each laser cycle, where no stream tells when.
    #[error("other lidars")]
    OtherLasers,
}

impl EngineError {
    /// Whether the user asked for what this engine cannot do, and another can.
    pub fn is_refusal(&self) -> bool {
        !matches!(self, EngineError::Unknown { .. } | EngineError::Stopped)
    }
}

impl From<NoAim> for EngineError {
    fn from(why: NoAim) -> Self {
        match why {
            NoAim::Race(race) => EngineError::Race {
                race,
                starts: Vec::new(),
            },
            NoAim::Irregular(why) => EngineError::Irregular(why),
        }
    }
}

/// Start values before the sentence that concerns them: runs of more than two as their ends.
fn listed(starts: &[u16]) -> String {
    let runs = starts.chunk_by(|before, after| before + 1 == *after);
    let runs = runs.flat_map(|run| match run {
        [first, .., last] if run.len() > 2 => vec![format!("{first} to {last}")],
        _ => run.iter().map(u16::to_string).collect(),
    });
    let runs: Vec<String> = runs.collect();
    match starts.len() {
        0 => String::new(),
        1 => format!("start value {}: ", runs[0]),
        _ => format!("start values {}: ", runs.join(", ")),
    }
}

/// The windows of these start values, where each has one or never opens.
///
/// # Errors
/// What keeps the law from telling, with all of the start values whose signals race if the first one does.
pub(super) fn refuse_races(
    law: &WindowLaw,
    starts: impl Iterator<Item = u16>,
) -> Result<(), EngineError> {
    let mut racing: BTreeMap<u16, Race> = BTreeMap::new();
    let mut known: BTreeSet<u16> = BTreeSet::new();
    for start in starts.filter(|&start| known.insert(start)) {
        if let WindowOutcome::Race(race) = law.window(start) {
            racing.insert(start, race);
            if !race.what.depends_on_start() {
                break;
            }
        }
    }
    let Some((_, &race)) = racing.first_key_value() else {
        return Ok(());
    };
    let of_start = race.what.depends_on_start();
    let starts = racing.into_keys().filter(|_| of_start).collect();
    Err(EngineError::Race { race, starts })
}

/// Whether one set of delays describes all macropixels of this sensor, and its front end, with these limits, follows the pulses of
/// its SPADs.
pub(super) fn follows(sensor: &Sensor, limits: &PulseLimits) -> Result<(), EngineError> {
    if sensor.silicon().mismatch.is_some() {
        return Err(EngineError::Mismatch);
    }
    let followed = limits.follow(sensor);
    followed.map_err(EngineError::FrontEnd)
}

/// Whether macropixels of this sensor differ in nothing but when CLK comes to them.
pub(super) fn has_no_delay_lines(sensor: &Sensor) -> Result<(), EngineError> {
    match sensor.tdc {
        Tdc::DelayLine => Err(EngineError::OwnLaws),
        Tdc::Clocked | Tdc::Counter => Ok(()),
    }
}

/// Whether each SPAD has a line of its own, as engines without gates take it.
pub(super) fn has_a_line_a_spad(sensor: &Sensor) -> Result<(), EngineError> {
    if !sensor.front_end.joins() {
        Ok(())
    } else {
        Err(EngineError::Joined(sensor.front_end))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::{Exposure, quantic4x4};
    use crate::engine::{Cycle, Gate, PulsedPixel, Replay, Runner, Timed};
    use crate::netlist::Mismatch;

    #[test]
    fn start_values_are_listed_as_runs() {
        assert_eq!(listed(&[]), "");
        assert_eq!(listed(&[40]), "start value 40: ");
        assert_eq!(
            listed(&[1, 2, 5, 6, 7, 511]),
            "start values 1, 2, 5 to 7, 511: "
        );
    }

    #[test]
    fn engines_with_one_set_of_delays_refuse_mismatch_by_name() {
        let nominal = quantic4x4();
        let mismatch = Some(Mismatch {
            sigma: 0.02,
            seed: 1,
        });
        let sensor = nominal.made_of(&crate::chip::Silicon {
            mismatch,
            ..*nominal.silicon()
        });
        let exposure = Exposure::new(&sensor, 60, 2);
        let pixel = PulsedPixel {
            number: 0,
            start: 30,
            pulses: &[],
        };
        let engines: [&dyn Replay; 3] = [
            &Gate::new(&sensor, &exposure),
            &Cycle::new(&sensor, &exposure),
            &crate::engine::Window::new(&sensor, &exposure),
        ];
        for engine in engines {
            assert_eq!(engine.replay(&[pixel]), Err(EngineError::Mismatch));
        }
        assert!(
            Timed::new(&sensor, &exposure, Runner::Window)
                .replay(&[pixel])
                .is_ok()
        );
    }
}
