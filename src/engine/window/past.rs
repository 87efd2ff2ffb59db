//! The photons before those that were drawn at first, slot by slot.
//!
//! ```text
//!     …   ?        ┊  drawn next    ┊   drawn from here        ┊ window     ┊
//!                  ┊  ╰ a slot of its cycle, and what echoes of any cycle have in that time
//! ```
//!
//! What a window's photons do depends on the SPADs' state before. Where that is not known, the slot before is drawn as
//! well, and so on, over cycles and groups, at the worst to the beginning of the exposure.

use crate::photon::{Draw, Photon, PhotonStream, PixelStream, Span};
use crate::units::Time;

/// Photons of a macropixel from some slot on, ever further back.
#[derive(Debug, Clone, Copy)]
pub(super) struct Past<'a> {
    stream: &'a PhotonStream,
    /// First slot drawn so far, and its cycle.
    slot: u32,
    cycle: u32,
}

impl<'a> Past<'a> {
    /// The past of `slot` in laser cycle `cycle`.
    pub(super) fn new(stream: &'a PhotonStream, cycle: u32, slot: u32) -> Self {
        Past {
            stream,
            slot,
            cycle,
        }
    }

    /// Whether all photons since the beginning of the exposure are known.
    fn is_everything(&self) -> bool {
        self.cycle == 0 && self.slot == 0
    }

    /// From when on all photons are known; `None` if that is the whole exposure.
    pub(super) fn known_from(&self) -> Option<Time> {
        let start = || self.stream.cycle_start(self.cycle);
        let slot_fs = self.stream.slots().start_fs(self.slot);
        (!self.is_everything()).then(|| start() + Time::from_fs(slot_fs))
    }

    /// Draws the slot before, if there is one, and appends its photons that fall on SPADs of the set `spads`, in no
    /// particular order. Returns how many photons were drawn.
    pub(super) fn extend(
        &mut self,
        pixel: &PixelStream<'_>,
        spads: u64,
        draw: &mut Draw,
        photons: &mut Vec<Photon>,
    ) -> u64 {
        if self.is_everything() {
            return 0;
        }
        let start = |cycle| self.stream.cycle_start(cycle);
        let end = self.known_from().expect("not everything is known");
        if self.slot > 0 {
            self.slot -= 1;
        } else {
            self.cycle -= 1;
            self.slot = self.stream.slots().count() - 1;
        }
        let slot_fs = self.stream.slots().start_fs(self.slot);
        let end_fs = (end - start(self.cycle)).as_fs();
        let background = Span {
            slots: self.slot..self.slot + 1,
            within_fs: 0..0,
        };
        let mut drawn = draw_part(pixel, self.cycle, &background, spads, draw, photons);
        for later in pixel.echoes_within(&(slot_fs..end_fs)) {
            if let Some(cycle) = self.cycle_after(later) {
                let moved_fs = (start(cycle) - start(self.cycle)).as_fs();
                let echo = Span {
                    slots: 0..0,
                    within_fs: slot_fs - moved_fs..end_fs - moved_fs,
                };
                drawn += draw_part(pixel, cycle, &echo, spads, draw, photons);
            }
        }
        photons.retain(|photon| photon.time >= Time::ZERO);
        drawn
    }

    /// The laser cycle so many later, if the exposure has it.
    fn cycle_after(&self, later: i64) -> Option<u32> {
        let cycle = u32::try_from(i64::from(self.cycle) + later).ok()?;
        (cycle < self.stream.config().laser_cycles).then_some(cycle)
    }
}

/// Appends the photons in a part of one laser cycle that fall on SPADs of a set. Returns how many photons were drawn.
fn draw_part(
    pixel: &PixelStream<'_>,
    cycle: u32,
    span: &Span,
    spads: u64,
    draw: &mut Draw,
    photons: &mut Vec<Photon>,
) -> u64 {
    let group = pixel.group_of(cycle);
    pixel.draw(group, span, draw);
    let start = pixel.cycle_start(cycle);
    let wanted = cycle - group.first_cycle();
    photons.extend(draw.photons(pixel).filter_map(|(place, time_fs)| {
        let (cycle, spad) = group.split(place);
        (cycle == wanted && spads >> spad & 1 != 0).then(|| Photon {
            time: start + Time::from_fs(time_fs),
            spad,
            breeds: pixel.breeds(),
        })
    }));
    draw.len() as u64
}
