//! Photons of one part of the light, kept by the laser cycle of their window: those that breed, which are few and drawn for
//! many laser cycles at once, and all of light with several layers.
//!
//! ```text
//!   groups of other photons    ├──┼──┼─────┼───────────┼─── … ──┤
//!   groups of these            ├───────────────────────── … ──┤     (longer where they are rare)
//! ```

use crate::engine::window::sight::Spans;
use crate::photon::{Draw, Group, Photon, PhotonStream, PixelStream};
use crate::units::Time;

/// Photons of one part of a macropixel's light.
#[derive(Debug, Default)]
pub(super) struct ByWindow {
    own: Draw,
    previous: Draw,
    /// Laser cycle of the window that a photon is drawn for, and the photon; by laser cycle.
    photons: Vec<(u32, Photon)>,
    /// Laser cycles drawn so far.
    until: u32,
}

impl ByWindow {
    /// Forgets all photons.
    pub(super) fn clear(&mut self) {
        self.photons.clear();
        self.until = 0;
    }

    /// Draws what the windows from laser cycle `first` on see, if that has not been done. Returns how many photons were
    /// drawn.
    pub(super) fn draw(
        &mut self,
        light: &PixelStream<'_>,
        stream: &PhotonStream,
        first: u32,
        spans: &Spans,
    ) -> u64 {
        if first < self.until {
            return 0;
        }
        let group = light.group_of(first);
        light.draw(group, &spans.own, &mut self.own);
        light.draw(group, &spans.previous, &mut self.previous);
        self.until = group.first_cycle().saturating_add(group.cycles());
        // Only what the windows of the group before left for this one.
        self.photons.retain(|&(window, _)| window >= first);
        for (draw, later) in [(&self.own, 0), (&self.previous, 1)] {
            let cycles = group.cycles_in(stream.config().laser_cycles.saturating_sub(later));
            for (place, time_fs) in draw.photons(light, cycles) {
                let (cycle, spad) = group.split(place);
                let cycle = group.first_cycle() + cycle;
                let photon = Photon {
                    time: stream.cycle_start(cycle) + Time::from_fs(time_fs),
                    spad,
                    breeds: light.breeds(),
                };
                self.photons.push((cycle + later, photon));
            }
        }
        self.photons.sort_unstable_by_key(|&(window, _)| window);
        (self.own.len() + self.previous.len()) as u64
    }

    /// Photons for the windows of these laser cycles.
    pub(super) fn of(&self, windows: std::ops::Range<u32>) -> &[(u32, Photon)] {
        let before = |cycle| self.photons.partition_point(|&(window, _)| window < cycle);
        &self.photons[before(windows.start)..before(windows.end)]
    }

    /// Photons for the windows of a group.
    pub(super) fn of_group(&self, group: Group) -> &[(u32, Photon)] {
        self.of(group.first_cycle()..group.first_cycle().saturating_add(group.cycles()))
    }
}
