//! The best disparity of a pixel, and whether to believe it.
//!
//! A disparity is kept when no other but its neighbours is nearly as good, and when the pixel that it leads to in the right image has the same best
//! disparity by the same sums. Between disparities, sums on either side of the best one say where the least would lie.

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]
#![allow(
    clippy::needless_range_loop,
    reason = "several arrays by one number, which the compiler makes vectors of"
)]

use multiversion::multiversion;

use super::cost::Costs;
use super::settings::{Matcher, NO_PARTNER};

/// Seeks rows' disparities; keeps its memory from row to row.
pub(super) struct Winners {
    lanes: usize,
    /// By the right image's pixels, in the order of [`Costs::partner`]: the least sum so far, and the lane it was in.
    right_least: Vec<u16>,
    right_lane: Vec<u8>,
    /// By the left image's pixels.
    lane: Vec<u8>,
}

impl Winners {
    pub(super) fn new(costs: &Costs, lanes: usize, width: usize) -> Self {
        Winners {
            lanes,
            right_least: vec![0; costs.partners(lanes)],
            right_lane: vec![0; costs.partners(lanes)],
            lane: vec![0; width],
        }
    }

    /// Disparities of a row from its sums, px; NaN where there is none.
    pub(super) fn of_row(
        &mut self,
        matcher: &Matcher,
        costs: &Costs,
        sums: &[u16],
        out: &mut [f32],
    ) {
        self.right_least.fill(u16::MAX);
        of_row(self, matcher, costs, sums, out);
        let Some(tolerance) = matcher.left_right_px else {
            return;
        };
        for (x, out) in out.iter_mut().enumerate() {
            let lane = self.lane[x];
            let back = self.right_lane[costs.partner(x) + usize::from(lane)];
            if u32::from(lane.abs_diff(back)) > tolerance {
                *out = f32::NAN;
            }
        }
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+avx512bitalg",
    "x86_64+avx2"
))]
fn of_row(winners: &mut Winners, matcher: &Matcher, costs: &Costs, sums: &[u16], out: &mut [f32]) {
    match winners.lanes {
        32 => of_row_of::<32>(winners, matcher, costs, sums, out),
        64 => of_row_of::<64>(winners, matcher, costs, sums, out),
        128 => of_row_of::<128>(winners, matcher, costs, sums, out),
        _ => of_row_of::<256>(winners, matcher, costs, sums, out),
    }
}

#[inline(always)]
fn of_row_of<const LANES: usize>(
    winners: &mut Winners,
    matcher: &Matcher,
    costs: &Costs,
    sums: &[u16],
    out: &mut [f32],
) {
    /// Lanes' numbers; more than a byte's where a lane is none.
    const NONE: u16 = u16::MAX;
    let Winners {
        right_least,
        right_lane,
        lane: left_lane,
        ..
    } = winners;
    let no_partner = matcher.paths.number() as u16 * u16::from(NO_PARTNER);
    let enough_percent = 100 + u64::from(matcher.uniqueness_percent);
    let sums = sums.as_chunks::<LANES>().0;
    for (x, (sums, out)) in sums.iter().zip(out).enumerate() {
        let partner = costs.partner(x);
        let ends = partner..partner + LANES;
        let right_least: &mut [u16; LANES] = (&mut right_least[ends.clone()])
            .try_into()
            .expect("as long as asked");
        let right_lane: &mut [u8; LANES] = (&mut right_lane[ends])
            .try_into()
            .expect("as long as asked");
        let mut least = u16::MAX;
        for d in 0..LANES {
            least = least.min(sums[d]);
        }
        let mut best = NONE;
        for d in 0..LANES {
            best = best.min(if sums[d] == least { d as u16 } else { NONE });
        }
        let mut second = u16::MAX;
        for d in 0..LANES {
            let apart = (d as u16).wrapping_sub(best).wrapping_add(1) > 2;
            second = second.min(if apart { sums[d] } else { u16::MAX });
        }
        seen_from_right(sums, right_least, right_lane);
        left_lane[x] = best as u8;
        let best = usize::from(best);
        let alone = second >= no_partner;
        let believed = alone || u64::from(second) * 100 >= u64::from(least) * enough_percent;
        *out = if least < no_partner && believed {
            let beside = (sums.get(best.wrapping_sub(1)), sums.get(best + 1));
            let beyond = match beside {
                (Some(&less), Some(&more)) if less.max(more) < no_partner => {
                    subpixel_offset(less, least, more)
                }
                _ => 0.0,
            };
            (matcher.min_disparity + best as i32) as f32 + beyond
        } else {
            f32::NAN
        };
    }
}

/// Takes the sums of one pixel's lanes into what pixels of the right image have found so far.
///
/// A function of its own, because arguments are known not to overlap, and with masks instead of a choice: the compiler makes branches of
/// that, and it takes five times as long as all else here.
#[inline(always)]
fn seen_from_right<const LANES: usize>(
    sums: &[u16; LANES],
    least: &mut [u16; LANES],
    lane: &mut [u8; LANES],
) {
    for d in 0..LANES {
        let better = 0u8.wrapping_sub(u8::from(sums[d] <= least[d]));
        lane[d] = (lane[d] & !better) | (d as u8 & better);
    }
    for d in 0..LANES {
        least[d] = least[d].min(sums[d]);
    }
}

/// Where between −½ and ½ the least would lie of three sums at −1, 0 and 1, of which none is below the second.
///
/// Two lines of equal slope through them (q alone instead of (q + q²)/2) leave 0.14 px of a plane's quarter pixel, because a census changes less
/// the nearer it is to the right place; a parabola leaves 0.19 px and also has a greater median error on a real pair, 0.165 px against 0.150.
#[inline(always)]
pub(super) fn subpixel_offset(less: u16, least: u16, more: u16) -> f32 {
    let (falls, rises) = (f32::from(less - least), f32::from(more - least));
    if falls.max(rises) == 0.0 {
        return 0.0;
    }
    let evenness = falls.min(rises) / falls.max(rises);
    let beyond = 0.5 - 0.25 * (evenness + evenness * evenness);
    if falls < rises { -beyond } else { beyond }
}
