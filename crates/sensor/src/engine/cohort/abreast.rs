//! Binomial numbers for many bins at once.
//!
//! What a draw does first, and nearly always last, is done for all bins abreast, in plain arrays that the compiler
//! makes vectors of: the first proposal of a rejection and its closer look, the whole of an inversion. Functions here
//! are part of their caller, which says for which vectors it is compiled.

use super::draw::{INVERSION_LIMIT, INVERSION_MEAN, MOST_FACTORS, RECIPROCALS, none_of};
use super::rejection::Rejection;
use super::words::RandomWords;
use crate::numerics::branchless::{VECTOR, count, floor, real};

/// Bins that go abreast.
pub(super) const LANES: usize = 16;

/// A number for each bin.
pub(super) type Lanes = [f64; LANES];

/// How many of `n` trials, below 2⁵², succeed in each lane, as [`super::draw::binomial`] would draw it.
#[inline(always)]
pub(super) fn binomials(
    n: &[u64; LANES],
    p: &Lanes,
    q: &Lanes,
    random: &mut RandomWords,
) -> [u64; LANES] {
    // Counted are the rarer ones of successes and failures.
    let (mut trials, mut rarer, mut other) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    let (mut few, mut many) = (0, 0u64);
    for lane in 0..LANES {
        trials[lane] = real(n[lane]);
        rarer[lane] = p[lane].min(q[lane]);
        other[lane] = p[lane].max(q[lane]);
        let mean = trials[lane] * rarer[lane];
        few |= u64::from((mean > 0.0) & (mean < INVERSION_MEAN));
        many += u64::from(mean >= INVERSION_MEAN);
    }
    let mut drawn = [0.0; LANES];
    if many > MOST_DRAWN_SINGLY {
        reject(&trials, &rarer, &other, &mut drawn, random);
    } else if many > 0 {
        for lane in 0..LANES {
            if trials[lane] * rarer[lane] >= INVERSION_MEAN {
                let rejection = Rejection::new(trials[lane], rarer[lane], other[lane]);
                drawn[lane] = real(rejection.draw(random));
            }
        }
    }
    if few != 0 {
        invert(n, &trials, &rarer, &other, &mut drawn, random);
    }
    let mut successes = [0; LANES];
    for lane in 0..LANES {
        let rest = trials[lane] - drawn[lane];
        successes[lane] = count(if p[lane] > q[lane] { rest } else { drawn[lane] });
    }
    successes
}

/// Up to this many lanes with many successes are drawn one by one, more of them together. Measured, 16 000 trials,
/// AVX-512: one by one is quicker up to 7 lanes at a mean of 30 and up to 10 at a mean of 400, so that together costs
/// 6 lanes 12 % and 43 % more (414 ns against 368 ns, 344 ns against 241 ns) and saves 16 of them 44 % and 34 %. It
/// stays at 5 because it decides which random words a lane gets: another number would give other histograms for the
/// same seed.
const MOST_DRAWN_SINGLY: u64 = 5;

/// Lanes of many successes, by rejection.
#[inline(always)]
fn reject(trials: &Lanes, p: &Lanes, q: &Lanes, drawn: &mut Lanes, random: &mut RandomWords) {
    let (u, v) = (random.uniforms(), random.coarses());
    let mut looks = [0; LANES];
    for lane in 0..LANES {
        let rejection = Rejection::new(trials[lane], p[lane], q[lane]);
        let proposal = rejection.propose(u[lane], v[lane]);
        let is_many = trials[lane] * p[lane] >= INVERSION_MEAN;
        drawn[lane] = if is_many { floor(proposal.place) } else { 0.0 };
        looks[lane] = u64::from(is_many & !rejection.takes(&proposal));
    }
    // Proposals that are looked at closely stand close together, the rest filled up.
    let (mut close, mut number) = ([0; LANES], 0);
    for (lane, look) in looks.into_iter().enumerate() {
        close[number % LANES] = lane;
        number += look as usize;
    }
    let mut given = [[0.0; LANES]; 5];
    for (at, &lane) in close[..number].iter().enumerate() {
        for (given, from) in given.iter_mut().zip([trials, p, q, &u, &v]) {
            given[at] = from[lane];
        }
    }
    let mut passes = [0; LANES];
    let filled_up = number.next_multiple_of(VECTOR).min(LANES);
    let [trials, p, q, u, v] = given.each_ref().map(|given| &given[..filled_up]);
    let proposals = trials.iter().zip(p).zip(q).zip(u).zip(v);
    for (passes, ((((&trials, &p), &q), &u), &v)) in passes.iter_mut().zip(proposals) {
        let rejection = Rejection::new(trials, p, q);
        let proposal = rejection.propose(u, v);
        let unless = u64::from(rejection.is_at_an_end(&proposal)) * AT_AN_END;
        *passes = u64::from(rejection.passes(&proposal)) | unless;
    }
    for at in 0..number {
        let rejection = Rejection::new(trials[at], p[at], q[at]);
        let passes = match passes[at] {
            AT_AN_END.. => rejection.passes_anywhere(&rejection.propose(u[at], v[at])),
            passes => passes != 0,
        };
        if !passes {
            drawn[close[at]] = real(rejection.draw(random));
        }
    }
}

/// A mark on proposals that are not weighed in a row.
const AT_AN_END: u64 = 2;

/// Lanes of few successes: how many of the probabilities of 0, 1, 2, … a uniform number exceeds the sum of.
#[inline(always)]
fn invert(
    n: &[u64; LANES],
    trials: &Lanes,
    p: &Lanes,
    q: &Lanes,
    drawn: &mut Lanes,
    random: &mut RandomWords,
) {
    let mut left: Lanes = random.uniforms();
    let mut any = 0;
    for lane in 0..LANES {
        let mean = trials[lane] * p[lane];
        // qⁿ is no less than 1 − np: none succeeds.
        let some = (mean < INVERSION_MEAN) & (left[lane] > 1.0 - mean);
        left[lane] = if some { left[lane] } else { 0.0 };
        any |= u64::from(some);
    }
    if any == 0 {
        return;
    }
    let mut probability = powers(q, n);
    let mut odds = [0.0; LANES];
    for lane in 0..LANES {
        odds[lane] = p[lane] / q[lane];
        if n[lane] > MOST_FACTORS && left[lane] > 0.0 {
            probability[lane] = none_of(n[lane], p[lane], q[lane]);
        }
    }
    for k in 1..=INVERSION_LIMIT {
        let before = real(k - 1);
        let mut any = 0;
        for lane in 0..LANES {
            left[lane] = (left[lane] - probability[lane]).max(0.0);
            drawn[lane] += if left[lane] > 0.0 { 1.0 } else { 0.0 };
            any |= left[lane].to_bits();
            probability[lane] *= (trials[lane] - before) * odds[lane] * RECIPROCALS[k as usize];
        }
        if any == 0 {
            break;
        }
    }
    // What rounding has left over is nobody's.
    for lane in 0..LANES {
        drawn[lane] = drawn[lane].min(trials[lane]);
    }
}

/// `bases` to the `exponents`, of which only the bits up to those of [`MOST_FACTORS`] are looked at.
#[inline(always)]
fn powers(bases: &Lanes, exponents: &[u64; LANES]) -> Lanes {
    let (mut powers, mut bases, mut exponents) = ([1.0; LANES], *bases, *exponents);
    let largest = exponents.iter().fold(0, |or, exponent| or | exponent);
    let bits = (u64::BITS - largest.leading_zeros()).min(MOST_FACTORS.ilog2() + 1);
    for _ in 0..bits {
        for lane in 0..LANES {
            powers[lane] *= if exponents[lane] & 1 == 1 {
                bases[lane]
            } else {
                1.0
            };
            bases[lane] *= bases[lane];
            exponents[lane] >>= 1;
        }
    }
    powers
}

#[cfg(test)]
mod tests {
    use super::super::draw::tests::assert_moments;
    use super::*;
    use statrs::distribution::{Binomial, Discrete};

    /// Number by number where numbers are few, by mean and variance everywhere.
    #[test]
    fn every_lane_follows_its_own_law() {
        const LAWS: [(u64, f64); LANES] = [
            (0, 0.3),
            (50, 0.0),
            (50, 1.0),
            (30, 0.4),
            (24, 0.5),
            (25, 0.6),
            (30, 0.97),
            (1, 0.2),
            (7, 0.9999),
            (5000, 0.0019),
            (5000, 0.05),
            (16_000, 0.02),
            (16_000, 1e-7),
            (1_000_000_000, 3e-9),
            (1_000_000_000, 0.4),
            (300, 0.005),
        ];
        const TRIALS: u32 = 200_000;
        let mut random = RandomWords::new(15, 0);
        let (n, p) = (LAWS.map(|(n, _)| n), LAWS.map(|(_, p)| p));
        let q = p.map(|p| 1.0 - p);
        let mut seen = [[0u32; 64]; LANES];
        let mut moments = [[0.0; 2]; LANES];
        for _ in 0..TRIALS {
            for (lane, drawn) in binomials(&n, &p, &q, &mut random).into_iter().enumerate() {
                assert!(drawn <= n[lane]);
                if let Some(seen) = seen[lane].get_mut(drawn as usize) {
                    *seen += 1;
                }
                let from_mean = drawn as f64 - n[lane] as f64 * p[lane];
                moments[lane][0] += from_mean;
                moments[lane][1] += from_mean * from_mean;
            }
        }
        let trials = f64::from(TRIALS);
        for (lane, &(n, p)) in LAWS.iter().enumerate() {
            let [from_mean, square] = moments[lane].map(|sum| sum / trials);
            assert_moments(n, p, TRIALS, from_mean, square);
            if n < 64 {
                let law = Binomial::new(p, n).unwrap();
                for (k, &count) in (0..).zip(&seen[lane]) {
                    let expected = law.pmf(k) * trials;
                    let off = (f64::from(count) - expected).abs();
                    assert!(
                        off < 5.0 * (expected + 1.0).sqrt(),
                        "{n}, {p}, {k}: {count} {expected}"
                    );
                }
            }
        }
    }
}
