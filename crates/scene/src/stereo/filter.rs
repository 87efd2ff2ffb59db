//! Filters that disparities pass once they are found.

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]
#![allow(
    clippy::needless_range_loop,
    reason = "several arrays by one number, which the compiler makes vectors of"
)]

use multiversion::multiversion;

/// The middle of each three by three disparities where all nine are known; others stay.
pub(super) fn median(width: usize, px: &[f32]) -> Vec<f32> {
    let mut out = px.to_vec();
    let rows: Vec<&[f32]> = px.chunks_exact(width).collect();
    for (three, out) in rows.windows(3).zip(out[width..].chunks_exact_mut(width)) {
        if width >= 3 {
            median_of_row([three[0], three[1], three[2]], &mut out[1..width - 1]);
        }
    }
    out
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn median_of_row(rows: [&[f32]; 3], out: &mut [f32]) {
    let n = out.len();
    let [a, b, c] = rows.map(|row| (&row[..n], &row[1..n + 1], &row[2..n + 2]));
    for i in 0..n {
        let nine = [
            a.0[i], a.1[i], a.2[i], b.0[i], b.1[i], b.2[i], c.0[i], c.1[i], c.2[i],
        ];
        // NaN in any of them makes the sum NaN.
        let known =
            !(a.0[i] + a.1[i] + a.2[i] + b.0[i] + b.1[i] + b.2[i] + c.0[i] + c.1[i] + c.2[i])
                .is_nan();
        let middle = middle_of_nine(nine);
        out[i] = if known { middle } else { b.1[i] };
    }
}

/// The fifth of nine numbers, by 19 exchanges (J. L. Smith, "Implementing median filters in XC4000E FPGAs", 1996).
#[inline(always)]
fn middle_of_nine(mut v: [f32; 9]) -> f32 {
    let mut order = |i: usize, j: usize| {
        let swap = v[j] < v[i];
        (v[i], v[j]) = if swap { (v[j], v[i]) } else { (v[i], v[j]) };
    };
    // Written out: a loop over pairs of numbers keeps the compiler from doing many medians at once.
    order(1, 2);
    order(4, 5);
    order(7, 8);
    order(0, 1);
    order(3, 4);
    order(6, 7);
    order(1, 2);
    order(4, 5);
    order(7, 8);
    order(0, 3);
    order(5, 8);
    order(4, 7);
    order(3, 6);
    order(1, 4);
    order(2, 5);
    order(4, 7);
    order(4, 2);
    order(6, 4);
    order(4, 2);
    v[4]
}

/// Takes out patches of fewer than `least` pixels; a patch's pixels differ by no more than `step_px` from a neighbour above, below or beside.
pub(super) fn speckles(width: usize, least: usize, step_px: f32, px: &mut [f32]) {
    if least <= 1 {
        return;
    }
    // Pixels of a patch point to others further up or left of it, up to its first one.
    let mut towards: Vec<u32> = Vec::with_capacity(px.len());
    for i in 0..px.len() {
        let near = |other: usize| (px[i] - px[other]).abs() <= step_px;
        let left = (i % width != 0 && near(i - 1)).then(|| first_of(&mut towards, i - 1));
        let above = (i >= width && near(i - width)).then(|| first_of(&mut towards, i - width));
        let own = i as u32;
        let first = match (left, above) {
            (None, None) => own,
            (Some(a), None) | (None, Some(a)) => a,
            (Some(a), Some(b)) => {
                towards[a.max(b) as usize] = a.min(b);
                a.min(b)
            }
        };
        towards.push(first);
    }
    let mut sizes = vec![0u32; px.len()];
    for i in 0..px.len() {
        let first = towards[towards[i] as usize];
        towards[i] = first;
        sizes[first as usize] += 1;
    }
    for (px, first) in px.iter_mut().zip(towards) {
        if (sizes[first as usize] as usize) < least {
            *px = f32::NAN;
        }
    }
}

/// The first pixel of the patch of pixel `i`; the way there becomes shorter.
fn first_of(towards: &mut [u32], i: usize) -> u32 {
    let mut at = i;
    while towards[at] as usize != at {
        let next = towards[at] as usize;
        towards[at] = towards[next];
        at = next;
    }
    at as u32
}
