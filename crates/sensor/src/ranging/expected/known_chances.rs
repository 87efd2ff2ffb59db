//! Mean histograms that were found a moment ago.
//!
//! ```text
//!   fit of a narrow echo ─► its light ─┬─► fit with a width of its own: begins with this light's mean histogram and slopes
//!                                      └─► further echoes: what is there beyond this light's mean histogram
//! ```
//!
//! A mean histogram is a function of response, light and steps alone, so each thread keeps those of its last lights.

use std::cell::RefCell;

use super::{EchoLight, Response};
use crate::numerics::Dual;
use crate::ranging::plain::OfBins;

/// Lights that a thread keeps: as many as the two fits with a width look at before the light is asked for that they began with.
const MOST_KEPT: usize = 16;

/// Histograms of more bins are not kept.
const MOST_BINS: usize = 16;

/// The mean histogram of a light.
struct MeanHistogram {
    response: Response,
    light: EchoLight,
    steps: usize,
    chances: [Dual<4>; MOST_BINS],
}

/// In a ring, whose oldest is the next to be overwritten.
#[derive(Default)]
struct Ring {
    known: Vec<MeanHistogram>,
    oldest: usize,
}

thread_local! {
    static RING: RefCell<Ring> = RefCell::default();
}

/// The chances of every bin with their slopes with the first K parameters, if they were found with as many steps to a bin.
pub(super) fn find<const K: usize>(
    response: &Response,
    light: &EchoLight,
    steps: usize,
) -> Option<OfBins<K>> {
    RING.with_borrow(|ring| {
        let is_same = |known: &&MeanHistogram| {
            known.light == *light && known.steps == steps && known.response == *response
        };
        let known = ring.known.iter().find(is_same)?;
        Some(first_slopes(&known.chances[..response.bins]))
    })
}

/// Keeps them with all slopes.
pub(super) fn keep(response: &Response, light: &EchoLight, steps: usize, chances: &[Dual<4>]) {
    if chances.len() > MOST_BINS {
        return;
    }
    RING.with_borrow_mut(|ring| {
        if ring.known.len() < MOST_KEPT {
            ring.known.push(MeanHistogram {
                response: response.clone(),
                light: *light,
                steps,
                chances: [Dual::ZERO; MOST_BINS],
            });
            ring.oldest = ring.known.len() - 1;
        }
        let known = &mut ring.known[ring.oldest];
        (known.response, known.light, known.steps) = (response.clone(), *light, steps);
        known.chances[..chances.len()].copy_from_slice(chances);
        ring.oldest = (ring.oldest + 1) % MOST_KEPT;
    });
}

/// The same with the slopes with the first K parameters alone.
pub(super) fn first_slopes<const K: usize>(chances: &[Dual<4>]) -> OfBins<K> {
    let of_bin = |chance: &Dual<4>| Dual {
        value: chance.value,
        slope: std::array::from_fn(|parameter| chance.slope[parameter]),
    };
    chances.iter().map(of_bin).collect()
}
