//! What a start value can see of the photon stream, and from when on photons matter to it.
//!
//! ```text
//!   laser cycle n    │STOP                                                                        │STOP
//!   slots            ├──────┬──────┬──────┬──────┬──────┬──────┬──────┬──────┬──────┬──────┬──────┤
//!   window                              ├ bin 0 │ bin 1 │ … ┤
//!   memory of SPADs             ├───────┤
//!   drawn            ·      ·   ╰──────┴──────┴──────┴──────┴──────╯      ·      ·      ·      ·
//! ```
//!
//! Windows of small start values begin in the cycle before, so that slots of two cycles are drawn. Where slots are bins,
//! the last of both end together but for the rounding of CLK edges: that much longer signal photons belong to it.

use super::history::Past;
use crate::chip::window_law::{OpenWindow, WindowLaw};
use crate::photon::{GROUP, PhotonStream, PixelLight, SPADS, Span};

/// By how much times relative to a cycle differ from cycle to cycle, fs: STOP and CLK edges are rounded to whole
/// femtoseconds, and so is the cycle before.
pub const ROUNDING_FS: i64 = 4;

/// The part of every laser cycle that decides a histogram. Times are in fs after the start of the cycle, within
/// [`ROUNDING_FS`].
#[derive(Debug, Clone)]
pub struct Sight {
    /// The rising CLK edge that takes the photons of bin 0, counted in the window's cycle.
    pub first_edge: i64,
    /// Where bin 0 begins.
    pub first_fs: i64,
    /// What is drawn of the window's own cycle.
    pub own: Span,
    /// What is drawn of the cycle before.
    pub previous: Span,
    /// From when on every photon is in these.
    pub drawn_from_fs: i64,
}

impl Sight {
    /// The sight of a window; `None` where it and what the SPADs remember do not fit into a laser cycle and the one
    /// before, so that most photons matter anyway.
    pub fn new(law: &WindowLaw, window: &OpenWindow, stream: &PhotonStream) -> Option<Self> {
        let interval = law.interval(window);
        let (first_fs, end_fs) = (interval.start.as_fs(), interval.end.as_fs());
        let (cycle_fs, all, ends) = (stream.cycle_fs(), stream.slots(), stream.ends_fs());
        let memory_fs = stream.config().spads.memory().as_fs();
        let from_fs = first_fs - memory_fs - ROUNDING_FS;
        let until_fs = end_fs + ROUNDING_FS;
        if from_fs <= ends.start - cycle_fs || until_fs >= ends.end {
            return None;
        }
        let span = |from_fs: i64, until_fs: i64| {
            if until_fs <= ends.start || from_fs >= ends.end {
                return Span::default();
            }
            let background_until_fs = (until_fs - all.margin_fs()).max(ends.start + 1);
            let last = all.at(background_until_fs - 1).min(all.count() - 1);
            let first = all.at(from_fs.max(ends.start)).min(last);
            let mut span = stream.span(first..last + 1);
            span.within_fs.end = span.within_fs.end.max(until_fs).min(ends.end);
            span
        };
        let own = span(from_fs, until_fs);
        let previous = span(cycle_fs + from_fs, cycle_fs + until_fs);
        let drawn_from_fs = match previous.slots.is_empty() {
            true => own.within_fs.start,
            false => previous.within_fs.start - cycle_fs,
        };
        Some(Sight {
            first_edge: window.first_edge,
            first_fs,
            own,
            previous,
            drawn_from_fs,
        })
    }

    /// Whether the window of the first cycle that has photons may see one that comes before the exposure.
    pub fn sees_the_beginning(&self) -> bool {
        self.own.slots.contains(&0) || self.previous.slots.contains(&0)
    }

    /// What came before the drawn slots of the window of `laser_cycle`.
    pub fn past<'a>(&self, stream: &'a PhotonStream, laser_cycle: u32) -> Past<'a> {
        if self.previous.slots.is_empty() {
            Past::new(stream, laser_cycle, self.own.slots.start)
        } else if let Some(before) = laser_cycle.checked_sub(1) {
            Past::new(stream, before, self.previous.slots.start)
        } else {
            Past::new(stream, 0, 0)
        }
    }

    /// Whether it pays to draw only these slots. Where light blinds, most cycles have a SPAD whose state at the window is
    /// not known, and looking back for a gap draws a slot of a whole group each time.
    pub fn suits(&self, stream: &PhotonStream, light: &PixelLight) -> bool {
        let spads = &stream.config().spads;
        let tied = if spads.has_secondaries() { 1 } else { SPADS };
        let memory_s = spads.memory().as_s();
        let tied_hz = light.background_hz / tied as f64;
        let blind = tied_hz * memory_s;
        // A photon within the memory before the window, and another one soon after it.
        let uncertain = tied as f64 * libm::expm1(-blind) * libm::expm1(-blind);
        // How long one waits for a gap; without any photon, as long as the memory itself.
        let wait_s = match blind > 0.0 {
            true => memory_s * libm::expm1(blind) / blind,
            false => memory_s,
        };
        let group = f64::from(stream.config().laser_cycles.min(GROUP));
        let slot_s = stream.slots().length_s();
        let slot = light.background_hz * slot_s;
        let looked_back = uncertain * (wait_s / slot_s + 1.0) * slot * group;
        let slots = (self.own.slots.len() + self.previous.slots.len()) as f64;
        let seen = slot * slots + light.signal_per_cycle;
        seen + looked_back < light.photons_per_cycle(stream.config())
    }
}
