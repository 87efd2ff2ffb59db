//! The limits of one flip-flop in one corner: those of the library, or its own from a delay file.

use super::check_limits::{CheckKind, CheckLimits};
use super::corner::Corner;
use super::corner::Edge;

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
    /// What the library says in one corner.
    pub(crate) fn of(limits: &CheckLimits, corner: Corner) -> Self {
        let by_edge = |check| Edge::BOTH.map(|edge| limits.toward(check, edge, corner));
        InstanceLimits([CheckKind::ALL.map(by_edge); 2])
    }

    /// One limit, fs.
    #[inline]
    pub const fn at(&self, control: Control, check: CheckKind, edge: Edge) -> u32 {
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
