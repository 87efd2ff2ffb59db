//! One step of a path (Hirschmüller's Eq. 13), for all disparities of a pixel at once:
//!
//! ```text
//!  L(x, d) = C(x, d) + min( L(x', d),  L(x', d ± 1) + P1,  min L(x') + P2 ) − min L(x')
//! ```
//!
//! All of it in bytes that saturate. The last term keeps L below C + P2, which settings hold below 255; 255 is left for lanes without partner, and for
//! what comes before a path's first pixel, where L is C.

#![allow(
    clippy::needless_range_loop,
    reason = "several arrays by one number, which the compiler makes vectors of"
)]

use super::settings::NO_PARTNER;

/// Lanes of one pixel with one more on either side, which stays [`NO_PARTNER`].
pub(super) const fn slot(lanes: usize) -> usize {
    lanes + 2
}

/// L of one pixel, and its least, from the slot of the pixel before it.
///
/// By value, so that it is still in registers when it is added up: half a vector read where a whole one has just been written waits for the write
/// to end, which took as long as all the rest.
#[inline(always)]
pub(super) fn step<const LANES: usize>(
    costs: &[u8; LANES],
    before: &[u8],
    least_before: u8,
    (p1, p2): (u8, u8),
) -> ([u8; LANES], u8) {
    let lanes_at = |from: usize| -> &[u8; LANES] {
        (before[from..from + LANES])
            .try_into()
            .expect("a slot has two lanes more")
    };
    let (less, same, more) = (lanes_at(0), lanes_at(1), lanes_at(2));
    let jump = least_before.saturating_add(p2);
    let mut l = [0; LANES];
    let mut least = NO_PARTNER;
    for d in 0..LANES {
        let beside = less[d].min(more[d]).saturating_add(p1);
        let on = same[d].min(beside).min(jump) - least_before;
        l[d] = costs[d].saturating_add(on);
        least = least.min(l[d]);
    }
    (l, least)
}

/// Adds a pixel's L to sums over paths.
#[inline(always)]
pub(super) fn add<const LANES: usize>(l: &[u8; LANES], sums: &mut [u16; LANES]) {
    for d in 0..LANES {
        sums[d] += u16::from(l[d]);
    }
}
