//! The limits of one flip-flop in one corner: those of the library, or its own from a delay file.

#[cfg(feature = "liberty")]
use super::check_limits::DataLimit;
use super::check_limits::{CheckKind, CheckLimits};
use super::corner::{Corner, Delay, Edge};
use crate::units::Time;

/// Which of a flip-flop's controls a check is about. D and CK have no such choice and are under `Reset`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Control {
    /// Pin R.
    Reset,
    /// Pin S.
    Set,
}

/// Limits (fs) by control, check and direction of D; zero means that the check always passes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct InstanceLimits([[[u32; 2]; CheckKind::ALL.len()]; 2]);

impl InstanceLimits {
    /// Limits that everything keeps.
    #[cfg(feature = "liberty")]
    pub(crate) const fn none() -> Self {
        InstanceLimits([[[0; 2]; CheckKind::ALL.len()]; 2])
    }

    /// The larger of each limit.
    #[cfg(feature = "liberty")]
    pub(crate) fn larger(self, other: &Self) -> Self {
        let mut larger = self;
        let (all, others) = (larger.0.as_flattened_mut(), other.0.as_flattened());
        let (all, others) = (all.as_flattened_mut(), others.as_flattened());
        for (limit, &other) in all.iter_mut().zip(others) {
            *limit = (*limit).max(other);
        }
        larger
    }

    /// Limits of one flip-flop as those of its kind, the same in every corner; of set and reset the larger.
    #[cfg(feature = "liberty")]
    pub(crate) fn of_kind(&self) -> CheckLimits {
        let larger_limit = |check, edge| {
            let controls = [Control::Reset, Control::Set];
            let limits = controls.map(|control| self.limit(control, check, edge));
            Delay::fixed(limits[0].max(limits[1]))
        };
        let data = |check| DataLimit {
            rise: larger_limit(check, Edge::Rise),
            fall: larger_limit(check, Edge::Fall),
        };
        let either = |check| larger_limit(check, Edge::Rise);
        CheckLimits {
            setup: data(CheckKind::Setup),
            hold: data(CheckKind::Hold),
            recovery: either(CheckKind::Recovery),
            removal: either(CheckKind::Removal),
            clock_high: either(CheckKind::ClockHigh),
            clock_low: either(CheckKind::ClockLow),
            control_high: either(CheckKind::ControlHigh),
        }
    }

    /// What the library says in one corner.
    pub(crate) fn from_library(limits: &CheckLimits, corner: Corner) -> Self {
        let limit_fs = |check, edge| Delay::kept_fs(limits.edge_limit(check, edge, corner));
        let by_edge = |check| Edge::BOTH.map(|edge| limit_fs(check, edge));
        InstanceLimits([CheckKind::ALL.map(by_edge); 2])
    }

    /// One limit.
    pub const fn limit(&self, control: Control, check: CheckKind, edge: Edge) -> Time {
        Time::from_fs(self.limit_fs(control, check, edge) as i64)
    }

    #[inline]
    pub(crate) const fn limit_fs(&self, control: Control, check: CheckKind, edge: Edge) -> u32 {
        self.0[control as usize][check as usize][edge as usize]
    }

    /// Every limit times `factor`, rounded to whole femtoseconds.
    #[must_use]
    pub(crate) fn times(self, factor: f64) -> Self {
        let scale = |fs: u32| (f64::from(fs) * factor).round() as u32;
        InstanceLimits(self.0.map(|control| control.map(|check| check.map(scale))))
    }

    /// Changes one limit, fs.
    pub(crate) fn set(&mut self, control: Control, check: CheckKind, edge: Edge, limit_fs: u32) {
        self.0[control as usize][check as usize][edge as usize] = limit_fs;
    }
}
