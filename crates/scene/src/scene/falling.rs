//! The light that falls on a macropixel, before its echoes are merged and before any of it crosses over to others.

use crate::photon::{Glint, PulseTrain};

/// The light of a macropixel before echoes are merged.
#[derive(Debug, Clone)]
pub(super) struct Falling {
    pub glints: Vec<Glint>,
    pub background_hz: f64,
    /// Of other lidars.
    pub trains: Vec<PulseTrain>,
}

impl Falling {
    /// The avalanches of its echoes, in order of time. A SPAD has one of what comes within a dead time at most, and is ready for the next
    /// echo however strong this one was.
    pub(super) fn avalanches(&self, spads: f64, dead_fs: f64) -> Vec<Glint> {
        let mut glints = self.glints.clone();
        glints.sort_by(|a, b| a.arrival_fs.total_cmp(&b.arrival_fs));
        let mut rest = &mut glints[..];
        while let [first, ..] = rest {
            let until_fs = first.arrival_fs + dead_fs;
            let together = rest.partition_point(|glint| glint.arrival_fs <= until_fs);
            let (blinding, later) = rest.split_at_mut(together);
            let photons: f64 = blinding.iter().map(|glint| glint.photons).sum();
            let fire = -spads * libm::expm1(-photons / spads) / photons.max(f64::MIN_POSITIVE);
            blinding.iter_mut().for_each(|glint| glint.photons *= fire);
            rest = later;
        }
        glints
    }
}
