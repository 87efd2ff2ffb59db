//! Looking back until the state of the SPADs is certain.
//!
//! ```text
//!   drawn from here ┊                 ┊ window                    ┊
//!     …   ?         ┊   ↓      ↓      ┊      ↓                    ┊        is the last photon seen?
//!                   ┊   ╰─ gap ─╯ longer than the memory: everything after it is certain
//! ```
//!
//! A photon after a gap longer than the memory of the SPADs finds them ready, whatever went before. Where there is no
//! such gap among the photons drawn so far, the slot before them is drawn as well, and so on, over cycles and groups, at
//! the worst to the beginning of the exposure.

use crate::photon::{Draw, Group, PhotonStream, PixelStream, Place, SPADS};
use crate::units::Time;

/// One photon on the way back: time from the first STOP edge, and SPAD.
pub type Photon = (Time, u8);

/// Photons of a macropixel from some slot on, ever further back.
pub struct Past<'a> {
    stream: &'a PhotonStream,
    /// First slot drawn so far, and its cycle.
    slot: u32,
    cycle: u32,
}

impl<'a> Past<'a> {
    /// The past of `slot` in laser cycle `cycle`.
    pub fn new(stream: &'a PhotonStream, cycle: u32, slot: u32) -> Self {
        Past {
            stream,
            slot,
            cycle,
        }
    }

    /// Whether all photons since the beginning of the exposure are known.
    pub fn is_everything(&self) -> bool {
        self.cycle == 0 && self.slot == 0
    }

    /// From when on all photons are known; `None` if that is the whole exposure.
    pub fn known_from(&self) -> Option<Time> {
        let start = || self.stream.config().cycle_start(self.cycle);
        let slot_fs = self.stream.slots().start_fs(self.slot);
        (!self.is_everything()).then(|| start() + Time::from_fs(slot_fs))
    }

    /// Draws one more slot, and gives its photons that fall on SPADs of the set `spads`, in no particular order.
    pub fn extend(
        &mut self,
        pixel: &PixelStream<'_>,
        spads: u16,
        draw: &mut Draw,
    ) -> impl Iterator<Item = Photon> {
        if self.slot > 0 {
            self.slot -= 1;
        } else {
            debug_assert!(self.cycle > 0, "nothing is before the exposure");
            self.cycle -= 1;
            self.slot = self.stream.slots().count() - 1;
        }
        let group = Group::of_cycle(self.cycle);
        let span = self.stream.span(self.slot..self.slot + 1);
        pixel.draw(group, &span, draw);
        let start = self.stream.config().cycle_start(self.cycle);
        let wanted = self.cycle - group.first_cycle();
        draw.photons(pixel).filter_map(move |(place, time_fs)| {
            let (cycle, spad) = split(place);
            (cycle == wanted && spads >> spad & 1 != 0)
                .then(|| (start + Time::from_fs(time_fs), spad))
        })
    }
}

/// Cycle within the group, and SPAD.
pub fn split(place: Place) -> (u32, u8) {
    let place = u32::from(place);
    (place / SPADS as u32, (place % SPADS as u32) as u8)
}

/// The first of `photons` (sorted by time) from which on everything is certain that matters from `seen_from` on; the
/// length where none of them matters. `None` if more of the past has to be known.
pub fn certain_from(
    photons: &[Photon],
    memory: Time,
    known_from: Option<Time>,
    seen_from: Time,
) -> Option<usize> {
    let mut last_possible = known_from.map(|time| time - Time::from_fs(1));
    let mut certain = None;
    for (index, &(time, _)) in photons.iter().enumerate() {
        match last_possible {
            Some(last) if last + memory >= seen_from => break,
            Some(last) if last + memory >= time => {}
            _ => certain = Some(index),
        }
        last_possible = Some(time);
    }
    // Nothing before the window reaches into it.
    if last_possible.is_none_or(|last| last + memory < seen_from) {
        return Some(photons.len());
    }
    certain
}

#[cfg(test)]
mod tests {
    use super::*;

    fn certain(times: &[i64], known_from: Option<i64>) -> Option<usize> {
        let photons: Vec<Photon> = times.iter().map(|&t| (Time::from_fs(t), 0)).collect();
        let known_from = known_from.map(Time::from_fs);
        certain_from(&photons, Time::from_fs(10), known_from, Time::from_fs(100))
    }

    #[test]
    fn a_gap_longer_than_the_memory_is_certain() {
        // 79 may have been seen at the end of what is not known, 69 + 10.
        assert_eq!(certain(&[79, 95], Some(70)), Some(1));
        assert_eq!(certain(&[79, 89, 99, 105], Some(70)), None);
        assert_eq!(certain(&[80, 89, 99, 105], Some(70)), Some(0));
        assert_eq!(certain(&[79, 90, 99, 105], Some(70)), Some(1));
    }

    #[test]
    fn the_beginning_of_the_exposure_is_certain() {
        assert_eq!(certain(&[91, 95, 101], None), Some(0));
    }

    #[test]
    fn what_cannot_reach_the_window_does_not_matter() {
        assert_eq!(certain(&[], Some(70)), Some(0));
        assert_eq!(certain(&[72, 75, 89], Some(70)), Some(3));
        // The next gap is within the window, and something before it is uncertain.
        assert_eq!(certain(&[75, 85, 95, 120], Some(70)), None);
        // Seen for certain, as all before ends before the window.
        assert_eq!(certain(&[75, 85, 101], Some(70)), Some(2));
    }
}
