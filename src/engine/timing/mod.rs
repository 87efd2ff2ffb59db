//! How fast the chip can be clocked: static timing beside what the event kernel does.
//!
//! ```text
//!   CLK falls ─► COUNTER_CLK ─► ripple ─► LOCAL_STOP ─► STROBE      must come, with the hold time, before
//!   CLK rises (T/2 later) ─► SHIFT changes                          ⇒ T ≥ 2 (strobe + hold − clk-to-Q)
//!   CLK rises ─► SPAD_TIMED ─► SPAD_EVENT                           must come, with the setup time, before the next rise
//!   LOAD_CLK rises ─► bit counter, ROW_DONE; falls ─► MEMORY_LOAD   must leave half a period to the data
//! ```
//!
//! | file | question |
//! |---|---|
//! | `macropixel` | paths of one macropixel, and the CLK periods they allow |
//! | `gates` | the same, asked of the event kernel |
//! | `correlation` | the photons that excite the longest correlation path |
//! | `load` | how fast start values can be loaded |
//! | `spread` | ripple and margin of every macropixel under mismatch |
//! | `corners` | process, voltage and temperature at which a clock fails |
//! | `verdict` | whether all of it is met: what `timing`, `frame` and `replay` say |

mod corners;
mod correlation;
mod gates;
mod load;
mod macropixel;
mod spread;
mod verdict;

pub use corners::{CornerLimit, FactorRange, corner_limits, factor_range};
pub use correlation::{CorrelationTiming, WORST_PHOTONS};
pub use gates::{ResetTiming, gate_works, reset, ripple};
pub use load::{LoadTiming, load_works};
pub use macropixel::{Aim, LocalClocks, MacropixelTiming, longest};
pub use spread::{PixelTiming, Spread, spread};
pub use verdict::{Margin, TimingVerdict, VerdictReport};

use crate::netlist::{Corner, Library, Mismatch, Netlist, Timing, derated_limits, varied_as};
use crate::units::Time;

/// What the analysed chip is made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Silicon {
    /// Corner of the library.
    pub corner: Corner,
    /// Factor on every delay and limit: process, voltage, temperature.
    pub factor: f64,
    /// Random differences between cells, on delays only.
    pub mismatch: Option<Mismatch>,
}

/// Whether flip-flops' limits count, or only what they capture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Limits {
    /// Setup, hold, recovery, removal and pulse widths must be kept.
    Kept,
    /// A flip-flop captures what is at D in the instant of its clock edge.
    Ignored,
}

impl Silicon {
    /// The library as it stands, without mismatch.
    pub const fn nominal(corner: Corner) -> Self {
        Silicon {
            corner,
            factor: 1.0,
            mismatch: None,
        }
    }

    /// The same chip with every delay and limit times `factor`, instead of its own.
    #[must_use]
    pub const fn at(mut self, factor: f64) -> Self {
        self.factor = factor;
        self
    }

    /// Delays of a netlist.
    pub fn timing(&self, netlist: &Netlist) -> Timing {
        self.timing_as(netlist, |cell| netlist.cell_path(cell))
    }

    /// Delays of another netlist that differs from this one in names only: there each cell is at `path` of its index.
    pub fn timing_as(&self, netlist: &Netlist, path: impl Fn(usize) -> String) -> Timing {
        let nominal = Timing::nominal(netlist, &Library::default(), self.corner);
        varied_as(netlist, &nominal, self.factor, self.mismatch, path)
    }

    /// The library with this silicon's limits (and nominal delays).
    pub fn limits(&self, limits: Limits) -> Library {
        let factor = match limits {
            Limits::Kept => self.factor,
            Limits::Ignored => 0.0,
        };
        derated_limits(&Library::default(), factor)
    }
}

/// STOP phases that are tried: sixteenths of a CLK period, half a period either way.
pub fn phases(period: Time) -> impl Iterator<Item = Time> {
    (-8..=8).map(move |k| Time::from_fs(period.as_fs() * k / 16))
}

/// The shortest period (to 1 ps) from which on `works` holds up to `limit`, found by bisection; none if it does
/// not hold at `limit`.
pub fn shortest_period(limit: Time, works: impl Fn(Time) -> bool) -> Option<Time> {
    let (mut good, mut bad) = (limit.as_fs() / 1_000, 100);
    if !works(Time::from_ps(good)) {
        return None;
    }
    while good - bad > 1 {
        let middle = (good + bad) / 2;
        if works(Time::from_ps(middle)) {
            good = middle;
        } else {
            bad = middle;
        }
    }
    Some(Time::from_ps(good))
}
