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
//! Windows of small start values begin in the cycle before, so that slots of two cycles are drawn. Photons that trigger others are
//! drawn from as much earlier on as afterpulses may take.

use smallvec::SmallVec;

use super::past::Past;
use crate::chip::window_law::{OpenWindow, WindowLaw};
use crate::chip::{Tdc, photon_line};
use crate::photon::{PhotonStream, PixelLight, Span};

/// By how much times relative to a cycle differ from cycle to cycle, fs: STOP and CLK edges are rounded to whole
/// femtoseconds, and so is the cycle before.
pub(super) const ROUNDING_FS: i64 = 4;

/// What is drawn of every laser cycle and the one before it.
#[derive(Debug, Clone, Default)]
pub(super) struct Spans {
    /// Of the window's own cycle, with its echo.
    pub own: Span,
    /// Slots of the cycle before.
    pub previous: Span,
    /// From when on every photon is in these, but for those of other cycles' echoes; after the start of the window's cycle.
    pub from_fs: i64,
}

impl Spans {
    /// From `from_fs` until `until_fs`, times after the start of the window's cycle; `None` where that does not fit into
    /// the cycle and the one before.
    fn new(stream: &PhotonStream, from_fs: i64, until_fs: i64) -> Option<Self> {
        let (cycle_fs, all, ends) = (stream.cycle_fs(), stream.slots, stream.ends_fs());
        if from_fs <= ends.start - cycle_fs || until_fs >= ends.end {
            return None;
        }
        let slots = |from_fs: i64, until_fs: i64| {
            if until_fs <= ends.start || from_fs >= ends.end {
                return 0..0;
            }
            let background_until_fs = (until_fs - all.margin_fs()).max(ends.start + 1);
            let last = all
                .slot_at(background_until_fs.min(ends.end) - 1)
                .min(all.count - 1);
            let first = all.slot_at(from_fs.max(ends.start)).min(last);
            first..last + 1
        };
        let own = slots(from_fs, until_fs);
        let previous = slots(cycle_fs + from_fs, cycle_fs + until_fs);
        let from_fs = if previous.is_empty() {
            all.start_fs(own.start)
        } else {
            all.start_fs(previous.start) - cycle_fs
        };
        Some(Spans {
            own: Span {
                slots: own,
                // The cycle before may be longer by a femtosecond.
                within_fs: from_fs - 1..until_fs,
            },
            previous: Span {
                slots: previous,
                within_fs: 0..0,
            },
            from_fs,
        })
    }

    /// What came before, seen from `laser_cycle`.
    pub(super) fn past<'a>(&self, stream: &'a PhotonStream, laser_cycle: u32) -> Past<'a> {
        if self.previous.slots.is_empty() {
            Past::new(stream, laser_cycle, self.own.slots.start)
        } else if let Some(before) = laser_cycle.checked_sub(1) {
            Past::new(stream, before, self.previous.slots.start)
        } else {
            Past::new(stream, 0, 0)
        }
    }

    /// Whether the window of the first cycle that has photons may see a slot that begins before the exposure.
    fn sees_the_beginning(&self) -> bool {
        self.own.slots.contains(&0) || self.previous.slots.contains(&0)
    }
}

/// Where the bins of a window lie in every laser cycle, to within [`ROUNDING_FS`].
#[derive(Debug, Clone)]
pub(super) struct Rows {
    /// Edges of the bins after the start of the window's cycle, rising, fs; one more than there are bins.
    edges_fs: SmallVec<[i64; 17]>,
}

impl Rows {
    fn new(law: &WindowLaw, window: &OpenWindow) -> Self {
        let edges = law.edges(window, 0);
        Rows {
            edges_fs: edges.edges().iter().map(|edge| edge.as_fs()).collect(),
        }
    }

    /// Edges of the bins after the start of the window's cycle, fs.
    pub(super) fn edges_fs(&self) -> &[i64] {
        &self.edges_fs
    }

    /// Whether a time is in any bin; `None` where it may be on either side of the first or the last edge.
    #[inline]
    pub(super) fn are_around(&self, time_fs: i64) -> Option<bool> {
        let [first_fs, .., end_fs] = self.edges_fs[..] else {
            return Some(false);
        };
        let is_near = |edge_fs: i64| (edge_fs - time_fs).abs() <= ROUNDING_FS;
        let is_certain = !is_near(first_fs) && !is_near(end_fs);
        is_certain.then_some(first_fs <= time_fs && time_fs < end_fs)
    }

    /// Bin + 1 of a time, 0 outside the window; `None` where it may be on either side of an edge.
    #[inline]
    pub(super) fn row_of(&self, time_fs: i64) -> Option<usize> {
        let edges_fs = &self.edges_fs;
        let passed = edges_fs.iter().filter(|edge| **edge <= time_fs).count();
        let is_near = |at: usize| {
            let edge_fs = edges_fs.get(at);
            edge_fs.is_some_and(|edge_fs| (edge_fs - time_fs).abs() <= ROUNDING_FS)
        };
        let is_inside = passed < edges_fs.len();
        let is_certain = !is_near(passed) && !is_near(passed.wrapping_sub(1));
        is_certain.then_some(if is_inside { passed } else { 0 })
    }
}

/// The part of every laser cycle that decides a histogram. Times are in fs after the start of the cycle, within
/// [`ROUNDING_FS`].
#[derive(Debug, Clone)]
pub(super) struct Sight {
    /// The window.
    pub window: OpenWindow,
    /// Its bins.
    pub rows: Rows,
    /// Where bin 0 begins, or what decides of it.
    pub first_fs: i64,
    /// Where the last bin is over for certain.
    pub until_fs: i64,
    /// What is drawn of photons that trigger no others.
    pub plain: Spans,
    /// What is drawn of those that do.
    pub triggering: Spans,
}

impl Sight {
    /// The sight of a window; `None` where it and what the SPADs remember do not fit into a laser cycle and the one
    /// before, so that most photons matter anyway, and where bins are not CLK periods, which is what photons are binned by when
    /// they are drawn together.
    pub(super) fn new(law: &WindowLaw, window: &OpenWindow, stream: &PhotonStream) -> Option<Self> {
        let interval = law.interval(window);
        let (mut first_fs, mut end_fs) = (interval.start.as_fs(), interval.end.as_fs());
        if law.sensor().tdc == Tdc::DelayLine {
            // Pulses before and after it may keep others in it from leaving an edge.
            first_fs -= photon_line::REACH.as_fs();
            end_fs += photon_line::REACH.as_fs();
        } else if !law.has_clk_bins() {
            return None;
        }
        if end_fs - first_fs > stream.cycle_fs() {
            // A pulse in two windows would be judged twice.
            return None;
        }
        let spads = &stream.config().spads;
        let from_fs = first_fs - spads.longest_dead_time().as_fs() - ROUNDING_FS;
        let until_fs = end_fs + ROUNDING_FS;
        let plain = Spans::new(stream, from_fs, until_fs)?;
        let triggering_from_fs = plain.from_fs - spads.reach().as_fs() - 2 * ROUNDING_FS;
        Some(Sight {
            window: *window,
            rows: Rows::new(law, window),
            first_fs,
            until_fs,
            triggering: Spans::new(stream, triggering_from_fs, until_fs)?,
            plain,
        })
    }

    /// Whether the first window that has photons may see one that comes before the exposure and is none.
    pub(super) fn sees_the_beginning(&self) -> bool {
        self.plain.sees_the_beginning() || self.triggering.sees_the_beginning()
    }
}

/// Whether SPADs are blind so much of the time that their state before a window is found sooner by following all of their
/// exposure than by looking back for a gap.
pub(super) fn is_blinding(stream: &PhotonStream, light: &PixelLight) -> bool {
    let (dead_s, cycle_s) = (
        stream.config().spads.dead_time.as_s(),
        stream.config().cycle_s(),
    );
    let per_spad_hz = light.background_hz() / stream.spads() as f64;
    // Mean time to a gap of a dead time, and as often as the last of all SPADs takes longer.
    let wait_s = libm::expm1(per_spad_hz * dead_s) / per_spad_hz * libm::log(stream.spads() as f64);
    per_spad_hz > 0.0 && wait_s > 0.5 * cycle_s
}
