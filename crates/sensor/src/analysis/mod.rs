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
//! | `power` | switching power, block by block |
//! | `readout` | how fast histograms can be read |
//! | `code_density` | how equal the steps of a time-to-digital converter are |
//! | `spread` | ripple and margin of every macropixel under mismatch |
//! | `clock_ranges` | the ranges of CLK in which every limit is kept |
//! | `corners` | process, voltage and temperature at which a clock fails |
//! | `verdict` | whether all of it is met: what `timing`, `frame` and `replay` say |

mod clock_ranges;
mod code_density;
mod corners;
mod correlation;
mod gates;
mod load;
mod macropixel;
mod power;
mod readout;
mod spread;
mod verdict;

pub use clock_ranges::{ClockRange, clock_ranges};
pub use code_density::Linearity;
pub use corners::{CornerLimit, FactorRange, corner_limits, factor_range};
pub use correlation::CorrelationTiming;
pub use gates::{ResetTiming, RippleTiming, gate_works, reset, ripple};
pub use load::{LoadTiming, load_works};
pub use macropixel::{Aim, LocalClocks, MacropixelTiming, longest};
pub use power::{BlockSilicon, Capacitances, MacropixelPower};
pub use readout::{ReadTiming, read_works};
pub use spread::{PixelTiming, Spread, spread};
pub use verdict::{Margin, TimingAnalysis, TimingVerdict, VerdictReport};

use crate::units::Time;

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
