//! Random numbers that are a pure function of what they are for.
//!
//! Every draw comes from the counter-based generator Philox4x32-10 (Salmon et al., SC 2011). Its
//! 64-bit key holds the seed, its 128-bit counter says which number is wanted: a [`RandomPurpose`], an
//! index (a pixel), a sub-index (a laser cycle) and a block of four words within. Nothing depends
//! on threads or order, and all functions used here round alike on every platform.

use rand_philox::{Philox, splitmix64};

/// What a random number is used for; different purposes never share numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum RandomPurpose {
    /// Cycles, times and SPADs of background photons.
    Photons = 0,
    /// Disparity errors of the stereo camera.
    Stereo = 1,
    /// How many photons there are.
    PhotonCounts = 2,
    /// Cycles, times and SPADs of signal photons.
    Signal = 3,
    /// Afterpulses and crosstalk.
    Avalanches = 4,
    /// Splits of cohorts of laser cycles.
    Cohort = 5,
    /// Numbers of photons that trigger others.
    TriggeringCounts = 6,
    /// Cycles, times and SPADs of background photons that trigger others.
    TriggeringPhotons = 7,
    /// Cycles, times and SPADs of signal photons that trigger others.
    TriggeringSignal = 8,
    /// Gaps and SPADs of background photons of bright macropixels.
    BrightPhotons = 9,
    /// Times of signal photons of bright macropixels.
    BrightSignal = 10,
    /// Gaps and SPADs of those background photons that trigger others.
    BrightTriggeringPhotons = 11,
    /// Times of those signal photons that trigger others.
    BrightTriggeringSignal = 12,
    /// Which photons of a layer of light are kept.
    Thinning = 13,
    /// Phases and dithers of other lasers, and waits before our own laser's pulses.
    OtherLaser = 15,
    /// Energies of laser pulses.
    PulseEnergy = 14,
    /// Errors of guides other than the camera pair.
    Guide = 20,
    /// How SPADs of the array differ.
    SpadSpread = 21,
    /// Which points a study takes.
    Sweep = 22,
}

/// The stream of random words for (`seed`, `purpose`, `index`, `sub_index`).
///
/// It holds 2³² blocks of four words before it would run into the next `sub_index`.
#[inline]
pub fn random_stream(seed: u64, purpose: RandomPurpose, index: u32, sub_index: u32) -> Philox {
    let counter =
        u128::from(purpose as u32) << 96 | u128::from(index) << 64 | u128::from(sub_index) << 32;
    Philox::new(philox_key(seed), counter)
}

/// The key of the generator for a seed.
pub fn philox_key(seed: u64) -> [u32; 2] {
    let key = splitmix64(seed);
    [key as u32, (key >> 32) as u32]
}

/// The key of a layer of light: that of the seed for the first one, and others that no seed near it has.
pub(super) fn layer_key(key: [u32; 2], layer: u32) -> [u32; 2] {
    match layer {
        0 => key,
        _ => {
            let seed = u64::from(key[0]) | u64::from(key[1]) << 32;
            philox_key(seed.wrapping_add(u64::from(layer)))
        }
    }
}

/// One draw of the standard normal distribution (Box and Muller, the cosine half).
///
/// Two words make one draw; its magnitude stays below 6.8.
#[inline]
pub fn normal(random: &mut Philox) -> f64 {
    let radius = libm::sqrt(-2.0 * libm::log(unit(random)));
    radius * libm::cos(std::f64::consts::TAU * unit(random))
}

/// A number strictly between 0 and 1.
#[inline]
fn unit(random: &mut Philox) -> f64 {
    rand_philox::u32_to_unit_f64(random.next_u32())
}

/// Largest mean that one table covers; larger ones are split into equal parts.
const LARGEST_TABLE_MEAN: f64 = 64.0;

/// Most entries of a table: more than the largest mean has above 2⁻⁶⁴.
const LONGEST_TABLE: usize = 192;

/// 1/k.
const RECIPROCALS: [f64; LONGEST_TABLE + 1] = {
    let mut reciprocals = [0.0; LONGEST_TABLE + 1];
    let mut k = 1;
    while k <= LONGEST_TABLE {
        reciprocals[k] = 1.0 / k as f64;
        k += 1;
    }
    reciprocals
};

/// Top bits of a word that say where to begin.
const START_BITS: u32 = 6;

/// A Poisson distribution prepared for many draws by inversion.
///
/// The table holds P(N > k) for k = 0, 1, … as 64-bit fixed-point numbers. Complements, not the
/// cumulative distribution itself, so that small probabilities keep all their digits. A draw
/// counts how many entries exceed a random 64-bit word; an index on the word's top bits says
/// where to begin. A sum of Poisson variables is Poisson, which covers large means.
#[derive(Debug, Clone)]
pub struct Poisson {
    exceeds: Vec<u64>,
    start: [u8; 1 << START_BITS],
    parts: u32,
}

impl Poisson {
    /// A distribution of finite mean `mean` ≥ 0.
    pub fn new(mean: f64) -> Self {
        debug_assert!(mean.is_finite() && mean >= 0.0, "mean {mean}");
        let parts = (mean / LARGEST_TABLE_MEAN).ceil().max(1.0);
        let exceeds = exceedance_table(mean / parts);
        let mut start = [0; 1 << START_BITS];
        let mut above = exceeds.len();
        for (top, slot) in (0u64..).zip(&mut start) {
            let largest_word = (top + 1)
                .wrapping_shl(u64::BITS - START_BITS)
                .wrapping_sub(1);
            while above > 0 && exceeds[above - 1] <= largest_word {
                above -= 1;
            }
            *slot = above as u8;
        }
        Poisson {
            exceeds,
            start,
            parts: parts as u32,
        }
    }

    /// Probability of more than `count`, for a mean of up to 64 that fits one table. Absolute error below 10⁻¹⁵.
    pub fn exceedance(&self, count: usize) -> f64 {
        debug_assert_eq!(self.parts, 1, "one table");
        let entry = self.exceeds.get(count).copied().unwrap_or(0);
        entry as f64 * 0.5f64.powi(64)
    }

    /// Whether every draw is zero.
    pub(crate) fn is_zero(&self) -> bool {
        self.exceeds.is_empty()
    }

    /// How many random words make one draw: one for every part of 64 of the mean.
    #[inline]
    pub(crate) fn words(&self) -> u32 {
        self.parts
    }

    /// What one random word adds to a draw.
    #[inline]
    pub(crate) fn part(&self, word: u64) -> u32 {
        let mut count = usize::from(self.start[(word >> (u64::BITS - START_BITS)) as usize]);
        let exceeds = |count| self.exceeds.get(count).copied().unwrap_or(0) > word;
        // Most often it is over within two entries, which no branch could foretell.
        count += usize::from(exceeds(count));
        count += usize::from(exceeds(count));
        while exceeds(count) {
            count += 1;
        }
        count as u32
    }

    /// One draw.
    #[inline]
    pub fn draw(&self, random: &mut Philox) -> u32 {
        (0..self.parts).map(|_| self.part(random.next_u64())).sum()
    }
}

/// P(N > k)·2⁶⁴ for k = 0, 1, … until it falls below one unit, for a mean of up to [`LARGEST_TABLE_MEAN`].
fn exceedance_table(mean: f64) -> Vec<u64> {
    let mut terms = [0.0; LONGEST_TABLE];
    let mut term = libm::exp(-mean);
    let mut used = 0;
    for (slot, reciprocal) in terms.iter_mut().zip(&RECIPROCALS[1..]) {
        term *= mean * reciprocal;
        *slot = term;
        used += 1;
        if term <= 1e-22 && used as f64 > mean {
            break;
        }
    }
    // Summed from the far end, so that small terms add up before they meet large ones.
    let mut table = vec![0; used];
    let mut tail = 0.0;
    for (entry, term) in table.iter_mut().zip(&terms).rev() {
        tail += term;
        *entry = (tail * 2f64.powi(64)) as u64;
    }
    let zeros = table.iter().rev().take_while(|&&entry| entry == 0).count();
    table.truncate(used - zeros);
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moments(draws: impl Iterator<Item = f64>) -> (f64, f64) {
        let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for x in draws {
            n += 1.0;
            sum += x;
            squares += x * x;
        }
        let mean = sum / n;
        (mean, squares / n - mean * mean)
    }

    #[test]
    fn poisson_mean_and_variance_agree_for_small_and_large_means() {
        for mean in [1e-3, 0.3, 11.0, 63.9, 64.1, 900.0] {
            let distribution = Poisson::new(mean);
            let mut random = random_stream(1, RandomPurpose::Photons, 0, 0);
            let n = 100_000;
            let (m, v) = moments((0..n).map(|_| f64::from(distribution.draw(&mut random))));
            let error = (mean / f64::from(n)).sqrt();
            assert!((m - mean).abs() < 5.0 * error, "mean {mean}: {m}");
            let spread = 5.0 * mean * (2.0 / f64::from(n)).sqrt() + 5.0 * error;
            assert!((v - mean).abs() < spread, "variance {mean}: {v}");
        }
    }

    #[test]
    fn poisson_probabilities_are_those_of_the_formula() {
        let table = exceedance_table(2.5);
        let mut probability = libm::exp(-2.5);
        let mut exceeds = 1.0 - probability;
        for (k, &entry) in table.iter().enumerate().take(10) {
            let got = entry as f64 / 2f64.powi(64);
            assert!((got - exceeds).abs() < 1e-15, "{k}: {got} {exceeds}");
            probability *= 2.5 / (k as f64 + 1.0);
            exceeds -= probability;
        }
    }

    #[test]
    fn nothing_comes_of_mean_zero_and_tiny_means_are_kept() {
        let mut random = random_stream(7, RandomPurpose::Photons, 0, 0);
        let zero = Poisson::new(0.0);
        assert!((0..1000).all(|_| zero.draw(&mut random) == 0));
        let tiny = exceedance_table(1e-12);
        let relative = tiny[0] as f64 / (1e-12 * 2f64.powi(64));
        assert!((relative - 1.0).abs() < 1e-6, "{relative}");
    }

    #[test]
    fn normal_draws_have_mean_zero_and_variance_one() {
        let mut random = random_stream(3, RandomPurpose::Stereo, 5, 0);
        let (m, v) = moments((0..200_000).map(|_| normal(&mut random)));
        assert!(m.abs() < 0.01 && (v - 1.0).abs() < 0.02, "{m} {v}");
    }

    #[test]
    fn purposes_indices_and_seeds_do_not_share_words() {
        let first = |seed, purpose, i, s| random_stream(seed, purpose, i, s).next_u64();
        let words = [
            first(0, RandomPurpose::Photons, 0, 0),
            first(0, RandomPurpose::Photons, 0, 1),
            first(0, RandomPurpose::Photons, 1, 0),
            first(0, RandomPurpose::Stereo, 0, 0),
            first(1, RandomPurpose::Photons, 0, 0),
        ];
        for (i, a) in words.iter().enumerate() {
            assert!(words[i + 1..].iter().all(|b| a != b));
        }
    }
}
