//! Errors of the library as exceptions of the package, with the sentences of the command line.

use guided_dtof::engine::EngineError;
use guided_dtof::files::InputError;
use guided_dtof::guide::GuideError;
use guided_dtof::ranging::UnequalBins;
use guided_dtof::request::{Spelling, is_bad_input, of_engine, sentence};
use guided_dtof::system::FrameError;
use pyo3::PyErr;

mod python {
    pyo3::import_exception!(gdtof.errors, InputError);
    pyo3::import_exception!(gdtof.errors, SimulationError);
}

/// Why something could not be done, in a sentence.
#[derive(Debug)]
pub(crate) enum Failure {
    /// Something the user gave cannot be.
    Input(String),
    /// Something went wrong that the user cannot mend.
    Simulation(String),
    /// Nobody waits for it any more.
    Stopped,
}

impl Failure {
    /// Something wrong with an argument.
    pub(crate) fn argument(name: &str, message: impl std::fmt::Display) -> Self {
        Failure::Input(format!("{name}: {message}"))
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Input(sentence) => python::InputError::new_err(sentence),
            Failure::Simulation(sentence) => python::SimulationError::new_err(sentence),
            Failure::Stopped => python::SimulationError::new_err("this was stopped before its end"),
        }
    }
}

impl From<InputError> for Failure {
    fn from(error: InputError) -> Self {
        Failure::Input(error.to_string())
    }
}

impl From<GuideError> for Failure {
    fn from(error: GuideError) -> Self {
        Failure::Input(error.to_string())
    }
}

impl From<UnequalBins> for Failure {
    fn from(error: UnequalBins) -> Self {
        Failure::Input(error.to_string())
    }
}

impl From<EngineError> for Failure {
    fn from(error: EngineError) -> Self {
        match error {
            EngineError::Stopped => Failure::Stopped,
            _ if error.is_refusal() => Failure::Input(of_engine(&error, Spelling::Keys)),
            _ => Failure::Simulation(of_engine(&error, Spelling::Keys)),
        }
    }
}

impl From<FrameError> for Failure {
    fn from(error: FrameError) -> Self {
        match error {
            FrameError::Engine(why) => why.into(),
            FrameError::Ranging(why) => why.into(),
            _ if is_bad_input(&error) => Failure::Input(sentence(&error, Spelling::Keys)),
            _ => Failure::Simulation(sentence(&error, Spelling::Keys)),
        }
    }
}
