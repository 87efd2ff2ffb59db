//! Numbers of the steps of a window, one for each.

use smallvec::SmallVec;

/// Steps of a window that need no memory of their own.
pub(super) const FEW_STEPS: usize = 16;

/// Laser cycles with an event, for every bin of a window.
pub(super) type Counts = SmallVec<[u64; FEW_STEPS]>;

/// Mean photons on one SPAD in every bin of a window.
pub(super) type Means = SmallVec<[f64; FEW_STEPS]>;
