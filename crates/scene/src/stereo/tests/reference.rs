//! A reference matcher, slow and in the order of the definition: whole volumes, one path after the other, whole
//! numbers without limits.

use super::settings::Matcher;
use super::winner::subpixel_offset;
use super::{DisparityMap, GreyImage};

fn census(image: &GreyImage, matcher: &Matcher, x: i64, y: i64) -> Vec<bool> {
    let grey = |x: i64, y: i64| {
        let x = x.clamp(0, image.width() as i64 - 1) as usize;
        image.row(y.clamp(0, image.height() as i64 - 1) as usize)[x]
    };
    let (cols, rows) = (
        matcher.census.cols as i64 / 2,
        matcher.census.rows as i64 / 2,
    );
    (-rows..=rows)
        .flat_map(|dy| (-cols..=cols).map(move |dx| (dx, dy)))
        .map(|(dx, dy)| grey(x + dx, y + dy) < grey(x, y))
        .collect()
}

/// What [`Matcher::match_pair`] must give, to the bit.
pub(super) fn match_pair(matcher: &Matcher, left: &GreyImage, right: &GreyImage) -> DisparityMap {
    let (width, height) = (left.width() as i64, left.height() as i64);
    let disparities = matcher.disparities as i64;
    let min = i64::from(matcher.min_disparity);
    let inside = |x: i64, y: i64| (0..width).contains(&x) && (0..height).contains(&y);
    let paired = |x: i64, d: i64| (0..disparities).contains(&d) && inside(x - min - d, 0);
    let index = |x: i64, y: i64| (y * width + x) as usize;
    let bits = |image| -> Vec<_> {
        (0..width * height)
            .map(|i| census(image, matcher, i % width, i / width))
            .collect()
    };
    let (left_bits, right_bits) = (bits(left), bits(right));
    let cost = |x: i64, y: i64, d: i64| {
        let (l, r) = (&left_bits[index(x, y)], &right_bits[index(x - min - d, y)]);
        l.iter().zip(r).filter(|(a, b)| a != b).count() as i64
    };

    let mut ways = vec![(1, 0), (-1, 0), (0, 1)];
    if matcher.paths.upward() {
        ways.push((0, -1));
    }
    if matcher.paths.diagonals() {
        ways.extend([(1, 1), (-1, 1)]);
        if matcher.paths.upward() {
            ways.extend([(1, -1), (-1, -1)]);
        }
    }
    assert_eq!(ways.len(), matcher.paths.number());
    let brightness = left.as_8_bit();
    let mut sums: Vec<Vec<Option<i64>>> =
        vec![vec![None; disparities as usize]; left.pixels().len()];
    for (dx, dy) in ways {
        let mut l: Vec<Vec<Option<i64>>> = vec![vec![]; left.pixels().len()];
        let xs: Vec<i64> = if dx < 0 {
            (0..width).rev().collect()
        } else {
            (0..width).collect()
        };
        let ys: Vec<i64> = if dy < 0 {
            (0..height).rev().collect()
        } else {
            (0..height).collect()
        };
        for &y in &ys {
            for &x in &xs {
                let before = if inside(x - dx, y - dy) {
                    l[index(x - dx, y - dy)].clone()
                } else {
                    vec![None; disparities as usize]
                };
                let step = if inside(x - dx, y - dy) {
                    brightness[index(x, y)].abs_diff(brightness[index(x - dx, y - dy)])
                } else {
                    0
                };
                let mut p2 = i64::from(matcher.p2);
                if matcher.p2_halved_by > 0 {
                    let halved_by = i64::from(matcher.p2_halved_by);
                    p2 = (p2 * halved_by / (halved_by + i64::from(step)))
                        .max(i64::from(matcher.p2_least));
                }
                let least = before.iter().flatten().min().copied();
                l[index(x, y)] = (0..disparities)
                    .map(|d| {
                        let cost_before =
                            |d: i64| before.get(usize::try_from(d).ok()?).copied().flatten();
                        let p1 = i64::from(matcher.p1);
                        let ways = [
                            cost_before(d),
                            cost_before(d - 1).map(|l| l + p1),
                            cost_before(d + 1).map(|l| l + p1),
                            least.map(|l| l + p2),
                        ];
                        // Nothing on a path is dearer than 255, which is also what is not there.
                        let on = ways.into_iter().flatten().min().unwrap_or(255).min(255);
                        paired(x, d).then(|| cost(x, y, d) + on - least.unwrap_or(255))
                    })
                    .collect();
            }
        }
        for (sums, l) in sums.iter_mut().zip(&l) {
            for (sum, l) in sums.iter_mut().zip(l) {
                *sum = l.map(|l| sum.unwrap_or(0) + l);
            }
        }
    }

    let mut px = vec![f32::NAN; left.pixels().len()];
    for y in 0..height {
        let sum = |x: i64, d: i64| {
            (inside(x, y) && (0..disparities).contains(&d))
                .then(|| sums[index(x, y)][d as usize])
                .flatten()
        };
        // Of equal sums the left image takes the least disparity and the right one the greatest.
        let best_left = |x: i64| {
            (0..disparities)
                .filter(|&d| sum(x, d).is_some())
                .min_by_key(|&d| sum(x, d))
        };
        let best_right = |xr: i64| {
            (0..disparities)
                .rev()
                .filter(|&d| sum(xr + min + d, d).is_some())
                .min_by_key(|&d| sum(xr + min + d, d))
        };
        for x in 0..width {
            let Some(best) = best_left(x) else { continue };
            let least = sum(x, best).unwrap();
            let rival = (0..disparities)
                .filter(|d| d.abs_diff(best) > 1)
                .filter_map(|d| sum(x, d))
                .min();
            if rival.is_some_and(|rival| {
                rival * 100 < least * (100 + i64::from(matcher.uniqueness_percent))
            }) {
                continue;
            }
            let back = best_right(x - min - best).unwrap();
            if matcher
                .left_right_px
                .is_some_and(|px| back.abs_diff(best) > u64::from(px))
            {
                continue;
            }
            let beyond = match (sum(x, best - 1), sum(x, best + 1)) {
                (Some(less), Some(more)) => subpixel_offset(less as u16, least as u16, more as u16),
                _ => 0.0,
            };
            px[index(x, y)] = (min + best) as f32 + beyond;
        }
    }
    if matcher.median {
        let found = px.clone();
        for (y, x) in (1..height - 1).flat_map(|y| (1..width - 1).map(move |x| (y, x))) {
            let mut nine: Vec<f32> = (-1..=1)
                .flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)))
                .map(|(dx, dy)| found[index(x + dx, y + dy)])
                .collect();
            if nine.iter().all(|d| !d.is_nan()) {
                nine.sort_by(f32::total_cmp);
                px[index(x, y)] = nine[4];
            }
        }
    }
    let mut seen = vec![false; px.len()];
    let found = px.clone();
    for start in 0..px.len() {
        let mut patch = vec![];
        let mut open = vec![start];
        while let Some(i) = open.pop() {
            if seen[i] || found[i].is_nan() {
                continue;
            }
            seen[i] = true;
            patch.push(i);
            let (x, y) = (i as i64 % width, i as i64 / width);
            for (x, y) in [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)] {
                if inside(x, y) && (found[i] - found[index(x, y)]).abs() <= matcher.speckle_step_px
                {
                    open.push(index(x, y));
                }
            }
        }
        if patch.len() < matcher.speckle_px {
            patch.iter().for_each(|&i| px[i] = f32::NAN);
        }
    }
    DisparityMap {
        width: width as usize,
        height: height as usize,
        px,
    }
}
