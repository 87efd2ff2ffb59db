//! Rows in their order: costs, paths, winners.
//!
//! Along a row, paths need that row alone; paths from above need the row before. So costs and paths along rows are computed for some
//! rows at once, on any thread, while paths from above go through the rows before them and winners are sought in those before these:
//!
//! ```text
//!  rows      0-3   4-7   8-11  12-15
//!  A costs, along rows        ███
//!  B from above         ███
//!  C winners      ███
//! ```
//!
//! Only these rows are ever in memory, unless there are paths from below. Then one sweep goes down and another up at the same time; each keeps
//! its sums as far as the middle, and from there on adds its own to what the other kept.
//!
//! What is computed is the same in any order, and so on any number of threads.

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use multiversion::multiversion;
use rayon::prelude::*;

use super::cost::Costs;
use super::disparity::DisparityMap;
use super::filter;
use super::image::GreyImage;
use super::settings::{Matcher, NO_PARTNER, Workspace, lanes};
use super::winner::Winners;

/// Rows at once: costs and sums of four rows of 741 pixels and 64 disparities take 0.6 MB of a second-level cache of 1 MB
/// (chosen by that).
const ROWS_AT_ONCE: usize = 4;

/// What does not change during a run.
struct Job<'a> {
    matcher: &'a Matcher,
    lanes: usize,
    width: usize,
    /// Brightness of the left image.
    brightness: Vec<u8>,
    p2_by_step: [u8; 256],
    costs: Costs,
}

/// Matches two images; settings have been checked.
pub(super) fn match_images(
    matcher: &Matcher,
    workspace: &mut Workspace,
    left: &GreyImage,
    right: &GreyImage,
) -> DisparityMap {
    let (width, height) = (left.width(), left.height());
    let lanes = lanes(matcher.disparities);
    let job = Job {
        matcher,
        lanes,
        width,
        brightness: left.as_8_bit(),
        p2_by_step: matcher.p2_by_step(),
        costs: Costs::new(matcher, left, right, lanes),
    };
    let mut px = vec![f32::NAN; width * height];
    let mut down = Sweep::new(&job);
    if matcher.paths.upward() {
        let mut up = Sweep::new(&job);
        let middle = height / 2;
        workspace.kept.resize(width * height * lanes, 0);
        let kept = &mut workspace.kept[..];
        let (kept_above, kept_below) = kept.split_at_mut(middle * width * lanes);
        let (px_above, px_below) = px.split_at_mut(middle * width);
        let (above, below): (Vec<_>, Vec<_>) =
            ((0..middle).rev().collect(), (middle..height).collect());
        rayon::join(
            || down.keep((0..middle).zip(kept_above.chunks_exact_mut(width * lanes))),
            || {
                let rows = kept_below.chunks_exact_mut(width * lanes);
                up.keep((middle..height).zip(rows).rev());
            },
        );
        rayon::join(
            || down.finish(&below, Some(kept_below), middle, px_below),
            || up.finish(&above, Some(kept_above), 0, px_above),
        );
    } else {
        let rows: Vec<usize> = (0..height).collect();
        down.finish(&rows, None, 0, &mut px);
    }
    if matcher.median {
        px = filter::median(width, &px);
    }
    filter::speckles(width, matcher.speckle_px, matcher.speckle_step_px, &mut px);
    DisparityMap { width, height, px }
}

/// Costs and sums of the rows that are at hand together.
struct Batch {
    rows: Vec<usize>,
    costs: Vec<u8>,
    sums: Vec<u16>,
}

impl Batch {
    fn new(job: &Job) -> Self {
        let length = ROWS_AT_ONCE * job.width * job.lanes;
        Batch {
            rows: Vec::with_capacity(ROWS_AT_ONCE),
            costs: vec![0; length],
            sums: vec![0; length],
        }
    }

    /// Each row with its costs and sums.
    fn each(&mut self, length: usize) -> impl Iterator<Item = (usize, &mut [u8], &mut [u16])> {
        let costs = self.costs.chunks_exact_mut(length);
        let sums = self.sums.chunks_exact_mut(length);
        (self.rows.iter().zip(costs).zip(sums)).map(|((&row, costs), sums)| (row, costs, sums))
    }
}

impl Job<'_> {
    fn brightness(&self, row: usize) -> &[u8] {
        &self.brightness[row * self.width..(row + 1) * self.width]
    }

    /// Stage A: costs, what was kept, and paths along the row.
    fn begin(&self, rows: &[usize], kept: Option<(&[u16], usize)>, batch: &mut Batch) {
        let length = self.width * self.lanes;
        batch.rows.clear();
        batch.rows.extend(rows);
        let parts: Vec<_> = batch.each(length).collect();
        parts.into_par_iter().for_each(|(row, costs, sums)| {
            self.costs.row(row, self.lanes, costs);
            match kept {
                Some((kept, first)) => {
                    sums.copy_from_slice(&kept[(row - first) * length..][..length])
                }
                None => sums.fill(0),
            }
            sum_along_row(self, self.brightness(row), costs, sums);
        });
    }

    /// Stage C: the disparities of a batch.
    fn end(&self, winners: &mut Winners, first: usize, batch: &mut Batch, px: &mut [f32]) {
        for (row, _, sums) in batch.each(self.width * self.lanes) {
            let out = &mut px[(row - first) * self.width..][..self.width];
            winners.of_row(self.matcher, &self.costs, sums, out);
        }
    }
}

/// Paths along a row, from its left and from its right end at the same time: neither waits for the other.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+avx512bitalg",
    "x86_64+avx2"
))]
fn sum_along_row(job: &Job, brightness: &[u8], costs: &[u8], sums: &mut [u16]) {
    match job.lanes {
        32 => along_of::<32>(job, brightness, costs, sums),
        64 => along_of::<64>(job, brightness, costs, sums),
        128 => along_of::<128>(job, brightness, costs, sums),
        _ => along_of::<256>(job, brightness, costs, sums),
    }
}

#[inline(always)]
fn along_of<const LANES: usize>(job: &Job, brightness: &[u8], costs: &[u8], sums: &mut [u16]) {
    let p1 = job.matcher.p1;
    let (costs, sums) = (
        costs.as_chunks::<LANES>().0,
        sums.as_chunks_mut::<LANES>().0,
    );
    let mut ways = [Along::new(), Along::new()];
    for i in 0..costs.len() {
        let mirrored = costs.len() - 1 - i;
        for (way, (x, before)) in ways
            .iter_mut()
            .zip([(i, i.wrapping_sub(1)), (mirrored, mirrored + 1)])
        {
            let bright_before = *brightness.get(before).unwrap_or(&brightness[x]);
            let p2 = job.p2_by_step[usize::from(brightness[x].abs_diff(bright_before))];
            way.step(&costs[x], (p1, p2), &mut sums[x]);
        }
    }
}

/// A path along a row: the slot of the pixel before.
struct Along {
    before: [u8; slot(256)],
    least: u8,
}

impl Along {
    fn new() -> Self {
        Along {
            before: [NO_PARTNER; slot(256)],
            least: NO_PARTNER,
        }
    }

    #[inline(always)]
    fn step<const LANES: usize>(
        &mut self,
        costs: &[u8; LANES],
        penalties: (u8, u8),
        sums: &mut [u16; LANES],
    ) {
        let (l, least) = step(costs, &self.before, self.least, penalties);
        self.least = least;
        self.before[1..LANES + 1].copy_from_slice(&l);
        add(&l, sums);
    }
}

/// Paths that go down or up the image.
struct Sweep<'a> {
    job: &'a Job<'a>,
    ways: Vec<PathCosts>,
    /// The row before.
    before: Option<usize>,
}

/// One direction: L of the row before and of this row, a slot for every column and one more at each end.
struct PathCosts {
    /// Columns from the pixel before to this one.
    aside: isize,
    before: Vec<u8>,
    out: Vec<u8>,
    least_before: Vec<u8>,
    least_out: Vec<u8>,
}

impl PathCosts {
    fn new(job: &Job, aside: isize) -> Self {
        let columns = job.width + 2;
        let slots = || vec![NO_PARTNER; columns * slot(job.lanes)];
        PathCosts {
            aside,
            before: slots(),
            out: slots(),
            least_before: vec![NO_PARTNER; columns],
            least_out: vec![NO_PARTNER; columns],
        }
    }

    fn next_row(&mut self) {
        std::mem::swap(&mut self.before, &mut self.out);
        std::mem::swap(&mut self.least_before, &mut self.least_out);
    }
}

impl<'a> Sweep<'a> {
    fn new(job: &'a Job<'a>) -> Self {
        let asides: &[isize] = if job.matcher.paths.diagonals() {
            &[0, 1, -1]
        } else {
            &[0]
        };
        Sweep {
            job,
            ways: asides
                .iter()
                .map(|&aside| PathCosts::new(job, aside))
                .collect(),
            before: None,
        }
    }

    /// Stage B: adds the paths' costs in row `row` to `sums`.
    fn advance(&mut self, row: usize, costs: &[u8], sums: &mut [u16]) {
        let before = self.before.replace(row).unwrap_or(row);
        self.ways.iter_mut().for_each(PathCosts::next_row);
        let bright = (self.job.brightness(row), self.job.brightness(before));
        sum_across_rows(self.job, &mut self.ways, bright, costs, sums);
    }

    /// Goes through rows and leaves its sums in `kept`.
    fn keep<'k>(&mut self, rows: impl Iterator<Item = (usize, &'k mut [u16])>) {
        let mut costs = vec![0; self.job.width * self.job.lanes];
        for (row, kept) in rows {
            self.job.costs.row(row, self.job.lanes, &mut costs);
            kept.fill(0);
            self.advance(row, &costs, kept);
        }
    }

    /// Goes through `rows` and finds their disparities; `kept` and `px` begin with row `first`.
    fn finish(&mut self, rows: &[usize], kept: Option<&[u16]>, first: usize, px: &mut [f32]) {
        let job = self.job;
        let kept = kept.map(|kept| (kept, first));
        let mut winners = Winners::new(&job.costs, job.lanes, job.width);
        let batches: Vec<&[usize]> = rows.chunks(ROWS_AT_ONCE).collect();
        if rayon::current_num_threads() == 1 {
            let mut batch = Batch::new(job);
            for rows in batches {
                job.begin(rows, kept, &mut batch);
                self.go_through(&mut batch);
                job.end(&mut winners, first, &mut batch, px);
            }
            return;
        }
        let [mut next, mut now, mut done] = std::array::from_fn(|_| Batch::new(job));
        for i in 0..batches.len() + 2 {
            rayon::join(
                || self.go_through(&mut now),
                || {
                    rayon::join(
                        || job.begin(batches.get(i).unwrap_or(&&[][..]), kept, &mut next),
                        || job.end(&mut winners, first, &mut done, px),
                    )
                },
            );
            (done, now, next) = (now, next, done);
        }
    }

    fn go_through(&mut self, batch: &mut Batch) {
        let length = self.job.width * self.job.lanes;
        for (row, costs, sums) in batch.each(length) {
            self.advance(row, costs, sums);
        }
    }
}

/// One row of all ways.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+avx512bitalg",
    "x86_64+avx2"
))]
fn sum_across_rows(
    job: &Job,
    ways: &mut [PathCosts],
    bright: (&[u8], &[u8]),
    costs: &[u8],
    sums: &mut [u16],
) {
    match job.lanes {
        32 => across_of::<32>(job, ways, bright, costs, sums),
        64 => across_of::<64>(job, ways, bright, costs, sums),
        128 => across_of::<128>(job, ways, bright, costs, sums),
        _ => across_of::<256>(job, ways, bright, costs, sums),
    }
}

#[inline(always)]
fn across_of<const LANES: usize>(
    job: &Job,
    ways: &mut [PathCosts],
    bright: (&[u8], &[u8]),
    costs: &[u8],
    sums: &mut [u16],
) {
    let costs = costs.as_chunks::<LANES>().0;
    let sums = sums.as_chunks_mut::<LANES>().0;
    for way in ways {
        across_one(
            job,
            way.aside,
            bright,
            costs,
            (&way.before, &way.least_before),
            &mut way.out,
            &mut way.least_out,
            sums,
        );
    }
}

/// One row of one way. Slices are arguments, because those are known not to overlap.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "see above")]
fn across_one<const LANES: usize>(
    job: &Job,
    aside: isize,
    (bright, bright_before): (&[u8], &[u8]),
    costs: &[[u8; LANES]],
    (before, least_before): (&[u8], &[u8]),
    out: &mut [u8],
    least_out: &mut [u8],
    sums: &mut [[u16; LANES]],
) {
    for (x, (costs, sums)) in costs.iter().zip(sums).enumerate() {
        let column_before = (x as isize + 1 - aside) as usize;
        // Beyond the image's sides a path begins, whatever the penalty.
        let bright_before = *bright_before
            .get(column_before.wrapping_sub(1))
            .unwrap_or(&0);
        let p2 = job.p2_by_step[usize::from(bright[x].abs_diff(bright_before))];
        let before = &before[column_before * slot(LANES)..][..slot(LANES)];
        let (l, least) = step(
            costs,
            before,
            least_before[column_before],
            (job.matcher.p1, p2),
        );
        out[(x + 1) * slot(LANES) + 1..][..LANES].copy_from_slice(&l);
        least_out[x + 1] = least;
        add(&l, sums);
    }
}

// One step of a path (Hirschmüller's Eq. 13), for all disparities of a pixel at once:
//
// ```text
//  L(x, d) = C(x, d) + min( L(x', d),  L(x', d ± 1) + P1,  min L(x') + P2 ) − min L(x')
// ```
//
// All of it in bytes that saturate. The last term keeps L below C + P2, which settings hold below 255; 255 is left for lanes without partner, and for
// what comes before a path's first pixel, where L is C.

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
