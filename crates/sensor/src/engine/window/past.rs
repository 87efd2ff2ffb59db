//! Photons before those that were drawn first, slot by slot.
//!
//! ```text
//!     …   ?        ┊  drawn next    ┊   drawn from here        ┊ window     ┊
//!                  ┊  ╰ a slot of its cycle, and what echoes of any cycle have in that time
//! ```
//!
//! What a window's photons do depends on the SPADs' state before. Where that is not known, the slot before is drawn as
//! well, and so on, over cycles and groups, at the worst to the beginning of the exposure.
//!
//! A draw has the photons of a slot in all laser cycles of a group. They are kept by cycle, for the next window of the group
//! that asks for them.

use crate::photon::{CycleGroup, Draw, Photon, PhotonStream, PixelStream, Span};
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
        let slot_fs = self.stream.slots.start_fs(self.slot);
        (!self.is_everything()).then(|| start() + Time::from_fs(slot_fs))
    }

    /// Goes back to the slot before, if there is one, and appends those of its photons of one of the `parts` of the light that
    /// fall on SPADs of the set `spads`, in no particular order. Returns how many photons were drawn.
    pub(super) fn extend(
        &mut self,
        parts: &[PixelStream<'_>],
        part: usize,
        spads: u64,
        draws: &mut PastDraws,
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
            self.slot = self.stream.slots.count - 1;
        }
        let slot_fs = self.stream.slots.start_fs(self.slot);
        let end_fs = (end - start(self.cycle)).as_fs();
        let light = &parts[part];
        let before = draws.drawn;
        let mut push = |cycle: u32, (_, time_fs, spad): PastPhoton| {
            let time = start(cycle) + Time::from_fs(time_fs);
            if time >= Time::ZERO && spads >> spad & 1 != 0 {
                photons.push(Photon::new(time, spad, light.has_secondaries()));
            }
        };
        for photon in draws.photons(light, part, self.cycle, What::Slot(self.slot)) {
            push(self.cycle, photon);
        }
        for later in light.echoes_within(&(slot_fs..end_fs)) {
            if let Some(cycle) = self.cycle_after(later) {
                let moved_fs = (start(cycle) - start(self.cycle)).as_fs();
                let within_fs = slot_fs - moved_fs..end_fs - moved_fs;
                let echo = draws.photons(light, part, cycle, What::Echo);
                echo.filter(|(_, time_fs, _)| within_fs.contains(time_fs))
                    .for_each(|photon| push(cycle, photon));
            }
        }
        draws.drawn - before
    }

    /// The laser cycle that comes `later` cycles after this one, if the exposure has it.
    fn cycle_after(&self, later: i64) -> Option<u32> {
        let cycle = u32::try_from(i64::from(self.cycle) + later).ok()?;
        (cycle < self.stream.config().laser_cycles).then_some(cycle)
    }
}

/// Laser cycle in its group, time after the start of the cycle, fs, and SPAD.
type PastPhoton = (u32, i64, u8);

/// What was drawn of a macropixel's past.
#[derive(Debug, Default)]
pub(super) struct PastDraws {
    draw: Draw,
    kept: Vec<PastDraw>,
    /// Of `kept`, the first ones; the others have room for the next.
    in_use: usize,
    /// Photons.
    drawn: u64,
}

/// Photons of one part of the light in all laser cycles of a group.
#[derive(Debug)]
struct PastDraw {
    key: (usize, What, CycleGroup),
    /// By laser cycle.
    photons: Vec<PastPhoton>,
}

/// A part of every laser cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum What {
    /// Background photons of a slot.
    Slot(u32),
    /// Its own echo.
    Echo,
}

impl PastDraws {
    /// Forgets all, for another macropixel.
    pub(super) fn clear(&mut self) {
        self.in_use = 0;
        self.drawn = 0;
    }

    /// The photons of a laser cycle. `light` is part number `part` of the macropixel's.
    fn photons(
        &mut self,
        light: &PixelStream<'_>,
        part: usize,
        cycle: u32,
        what: What,
    ) -> impl Iterator<Item = PastPhoton> {
        let group = light.group_of(cycle);
        let key = (part, what, group);
        let known = self.kept[..self.in_use]
            .iter()
            .position(|draw| draw.key == key);
        let at = match known {
            Some(at) => at,
            None => self.draw(light, key),
        };
        let wanted = cycle - group.first_cycle();
        let photons = &self.kept[at].photons;
        let first = photons.partition_point(|&(cycle, ..)| cycle < wanted);
        let of_cycle = photons[first..].iter().copied();
        of_cycle.take_while(move |&(cycle, ..)| cycle == wanted)
    }

    /// Draws photons, and returns where they are kept.
    fn draw(&mut self, light: &PixelStream<'_>, key: (usize, What, CycleGroup)) -> usize {
        let (_, what, group) = key;
        let span = match what {
            What::Slot(slot) => Span {
                slots: slot..slot + 1,
                within_fs: 0..0,
            },
            What::Echo => Span {
                slots: 0..0,
                within_fs: light.echo_fs(),
            },
        };
        light.draw(group, &span, &mut self.draw);
        self.drawn += self.draw.len() as u64;
        // Windows do not come back to a group after the next one.
        let is_over = |draw: &PastDraw| {
            let old = draw.key.2;
            old.first_cycle().saturating_add(old.cycles()) < group.first_cycle()
        };
        let over = self.kept[..self.in_use].iter().position(is_over);
        let at = over.unwrap_or(self.in_use);
        if at == self.kept.len() {
            let photons = Vec::new();
            self.kept.push(PastDraw { key, photons });
        }
        self.in_use = self.in_use.max(at + 1);
        let kept = &mut self.kept[at];
        kept.key = key;
        kept.photons.clear();
        let photons = self.draw.photons(light, group.cycles());
        photons.for_each(|(place, time_fs)| {
            let (cycle, spad) = group.split(place);
            kept.photons.push((cycle, time_fs, spad));
        });
        kept.photons.sort_unstable_by_key(|&(cycle, ..)| cycle);
        at
    }
}
