//! All avalanches of a macropixel in an exposure, in their order: the whole stream and what its SPADs make of it.

use std::ops::ControlFlow;

use super::light::PixelLight;
use super::spad::{Photon, SpadEvent, sort_photons};
use super::spad_rows::SpadRows;
use super::stream::{ByCycle, Draw, ListedEchoes, PhotonStream, PixelStream, SPAD_SHIFT};
use crate::units::Time;

/// The avalanches of one macropixel in one exposure.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct PixelPhotons {
    /// Rising edges of the SPAD wires, sorted by (time, SPAD).
    pub events: Vec<SpadEvent>,
    /// Photons and dark counts that fell into the exposure, seen or not.
    pub drawn: u64,
    /// Avalanches, afterpulses and crosstalk among them, that met a blind SPAD.
    pub lost_to_dead_time: u64,
}

impl PhotonStream {
    /// All avalanches of macropixel number `pixel` under `light` in the exposure.
    pub fn pixel_events(&self, pixel: u32, light: &PixelLight) -> PixelPhotons {
        let expected = self.config().most_edges(light);
        // Five standard deviations of room; the cap keeps a huge request from failing up front.
        let room = (expected + 5.0 * expected.sqrt() + 16.0).min(1e7);
        let mut events = Vec::with_capacity(room as usize);
        let photons = self.pixel_pulses(pixel, light, |pulses| events.extend_from_slice(pulses));
        PixelPhotons { events, ..photons }
    }

    /// As [`PhotonStream::pixel_events`], but hands the avalanches over part by part, in their order, so that they need not
    /// be kept; what it returns has no events.
    pub fn pixel_pulses(
        &self,
        pixel: u32,
        light: &PixelLight,
        mut pulses: impl FnMut(&[SpadEvent]),
    ) -> PixelPhotons {
        self.pixel_pulses_while(pixel, light, |some| {
            pulses(some);
            ControlFlow::Continue(())
        })
    }

    /// As [`PhotonStream::pixel_pulses`], until `pulses` breaks: what comes after that is not drawn.
    pub fn pixel_pulses_while(
        &self,
        pixel: u32,
        light: &PixelLight,
        pulses: impl FnMut(&[SpadEvent]) -> ControlFlow<()>,
    ) -> PixelPhotons {
        let parts = self.parts(pixel, light);
        if parts[0].is_bright {
            self.bright_pulses(&parts, pulses)
        } else {
            self.dim_pulses(&parts, pulses)
        }
    }

    fn dim_pulses(
        &self,
        parts: &[PixelStream<'_>],
        mut pulses: impl FnMut(&[SpadEvent]) -> ControlFlow<()>,
    ) -> PixelPhotons {
        let mut draw = Draw::default();
        let mut by_cycle = ByCycle::default();
        let all = self.span(0..self.slots.count);
        let end = self.cycle_start(self.config().laser_cycles);
        let mut photons: Vec<Photon> = Vec::new();
        let mut edges = Vec::new();
        let mut avalanches = parts[0].avalanches(None, std::iter::empty());
        let are_sorted = parts.len() == 1 && parts[0].stays_in_its_cycle();
        let earliest = parts.iter().map(PixelStream::earliest).min();
        let earliest = earliest.unwrap_or(Time::ZERO);
        let mut drawn = 0;
        for group in self.groups() {
            let carried = photons.len();
            for light in parts {
                let group_of_light = light.group_of(group.first_cycle());
                if group_of_light.first_cycle() != group.first_cycle() {
                    // It came with one of the groups before.
                    continue;
                }
                let cycles = group_of_light.cycles_in(self.config().laser_cycles);
                light.draw(group_of_light, &all, &mut draw);
                by_cycle.sort(&draw, light);
                for cycle in 0..cycles {
                    let start = self.cycle_start(group.first_cycle() + cycle);
                    photons.extend(by_cycle.cycle_photons(cycle).iter().map(|&photon| {
                        Photon::new(
                            start + Time::from_fs(photon >> SPAD_SHIFT),
                            (photon & ((1 << SPAD_SHIFT) - 1)) as u8,
                            light.has_secondaries(),
                        )
                    }));
                }
            }
            if carried > 0 || !are_sorted {
                photons.retain(|photon| (Time::ZERO..end).contains(&photon.time));
                photons.sort_unstable();
            }
            // Photons of the next groups come from then on.
            let next = group.first_cycle().saturating_add(group.cycles());
            let until = if next < self.config().laser_cycles {
                self.cycle_start(next) + earliest
            } else {
                end
            };
            let now = photons.partition_point(|photon| photon.time < until);
            edges.clear();
            let known = avalanches.append_edges(&photons[..now], None, until, until, &mut edges);
            debug_assert!(known.is_ok(), "nothing is unknown from the beginning on");
            photons.drain(..now);
            drawn += now as u64;
            if pulses(&edges).is_break() {
                break;
            }
        }
        PixelPhotons {
            events: Vec::new(),
            drawn,
            lost_to_dead_time: avalanches.lost,
        }
    }

    fn bright_pulses(
        &self,
        parts: &[PixelStream<'_>],
        mut pulses: impl FnMut(&[SpadEvent]) -> ControlFlow<()>,
    ) -> PixelPhotons {
        let config = self.config();
        let longest_dead_time = config.spads.longest_dead_time();
        let end = self.cycle_start(config.laser_cycles);
        let mut photons: Vec<Photon> = Vec::new();
        let mut edges = Vec::new();
        let mut avalanches = parts[0].avalanches(None, std::iter::empty());
        // Light with an ordered echo has no other layer.
        let mut echoes = parts[0].ordered_echoes();
        let mut listed: Vec<ListedEchoes> = Vec::new();
        listed.resize_with(parts.len(), ListedEchoes::default);
        let earliest_fs = parts.iter().map(|part| part.echo_fs.0).min();
        let earliest = Time::from_fs(earliest_fs.unwrap_or(0));
        let (mut drawn, mut next_echo) = (0, 0);
        let are_apart = !config.spads.has_secondaries() && !parts[0].has_ordered_echo();
        let mut rows = SpadRows::default();
        let mut later: Vec<Photon> = Vec::new();
        let mut keys = Vec::new();
        let mut from = Time::ZERO;
        for cycle in 0..config.laser_cycles {
            let until = if cycle + 1 < config.laser_cycles {
                self.cycle_start(cycle + 1) - Time::from_fs(self.slots.lead_fs)
            } else {
                end
            };
            // Whatever may blind a SPAD for an echo must find it.
            let may_begin =
                |echo: u32| self.cycle_start(echo) + earliest <= until + longest_dead_time;
            while next_echo < config.laser_cycles && may_begin(next_echo) {
                echoes.add(next_echo);
                for (light, listed) in parts.iter().zip(&mut listed) {
                    photons.extend_from_slice(listed.photons(light, next_echo));
                }
                next_echo += 1;
            }
            for light in parts {
                for block in 0..light.blocks() {
                    light.push_block(cycle, block, i64::MAX, &mut photons);
                }
            }
            later.extend(photons.iter().filter(|photon| photon.time >= until));
            photons.retain(|photon| photon.time < until);
            later.retain(|photon| photon.time < end);
            drawn += photons.len() as u64;
            edges.clear();
            if are_apart && rows.sort_in(&parts[0], &photons, from, until) {
                avalanches.run_rows(&rows, &parts[0], from, &mut edges);
            } else {
                sort_photons(&mut photons, from, &mut keys);
                let echoes = (!echoes.is_empty()).then_some(&mut echoes);
                let known = avalanches.append_edges(&photons, echoes, until, until, &mut edges);
                debug_assert!(known.is_ok(), "nothing is unknown from the beginning on");
            }
            photons.clear();
            std::mem::swap(&mut photons, &mut later);
            from = until;
            echoes.forget_before(until);
            if pulses(&edges).is_break() {
                break;
            }
        }
        PixelPhotons {
            events: Vec::new(),
            drawn: drawn + echoes.drawn,
            lost_to_dead_time: avalanches.lost,
        }
    }
}

#[cfg(test)]
mod tests;
