//! Which photons of a draw a window needs.

use super::codes::SPAD_BITS;

/// Which photons of a draw are wanted, and what for.
#[derive(Debug, Clone, Copy)]
pub(super) struct PhotonSelection {
    /// Those of cycles before this one of the group.
    pub cycles: u32,
    /// By how many cycles their windows come after them.
    pub later: u32,
    /// When bin 0 begins, counted from the start of their own cycle, fs.
    pub origin_fs: i64,
    /// The slot that begins with bin 0. It need not exist.
    pub origin_slot: i32,
}

impl PhotonSelection {
    /// The place of a photon's window.
    #[inline(always)]
    pub(super) fn place(&self, place: u32) -> u32 {
        place + (self.later << SPAD_BITS)
    }
}
