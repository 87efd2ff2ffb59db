//! From SPADs that fired to a bin that counts: TYPE and THRESHOLD, with crosstalk.
//!
//! ```text
//!   n SPADs of S fired by light      binomial(S, fired)        ┐
//!   k of them fired a neighbour      binomial(n, children)     ├─► bin counts if TYPE holds of n + k and THRESHOLD
//! ```
//!
//! Crosstalk follows 10 ps after its cause, so that both are in one bin but for 10 ps of its length.

use crate::chip::{EventType, MOST_SPADS};
use crate::numerics::Dual;

/// 1/n.
const INVERSE: [f64; MOST_SPADS + 1] = {
    let mut inverse = [0.0; MOST_SPADS + 1];
    let mut n = 1;
    while n <= MOST_SPADS {
        inverse[n] = 1.0 / n as f64;
        n += 1;
    }
    inverse
};

/// What the correlation block asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Counting {
    pub(super) event_type: EventType,
    pub(super) threshold: usize,
    pub(super) spads: usize,
}

impl Counting {
    /// Whether a bin in which `n` SPADs fired counts.
    #[inline]
    fn counts(&self, n: usize) -> bool {
        match self.event_type {
            EventType::Less => n < self.threshold,
            EventType::Equal => n == self.threshold,
            EventType::Greater => n > self.threshold,
        }
    }

    /// The chance that a bin counts in which each SPAD fires with chance `fired`, and where each that fired fires a neighbour with
    /// chance `children`.
    pub(super) fn chance<const K: usize>(&self, fired: Dual<K>, children: Dual<K>) -> Dual<K> {
        let clamped = fired.value.clamp(0.0, 1.0);
        let of_all = self.spads as f64;
        // A neighbour fires only where something has.
        let children_count = self.threshold > 0 && children.value > 0.0;
        if self.event_type == EventType::Greater && !children_count {
            return self.chance_of_more(fired);
        }
        // Of one SPAD fewer: what P(n) is made of, and its slope.
        let others = self.spads - 1;
        let mut silent = [1.0; MOST_SPADS];
        for n in 0..others {
            silent[n + 1] = silent[n] * (1.0 - clamped);
        }
        let (mut value, mut by_fired, mut by_children) = (0.0, 0.0, 0.0);
        let (mut fewer, mut ways) = (0.0, 1.0);
        for n in 0..=self.spads {
            let of_others = if n <= others {
                ways * silent[others - n]
            } else {
                0.0
            };
            let chance = of_others * (1.0 - clamped) + fewer * clamped;
            let (holds, slope) = self.conditional_chance(n, children.value);
            value += chance * holds;
            by_children += chance * slope;
            by_fired += of_all * (fewer - of_others) * holds;
            fewer = of_others;
            ways *= clamped * (others as f64 - n as f64) / (n + 1) as f64;
        }
        let children = children.chain(0.0, by_children);
        fired.chain(value, by_fired) + children
    }

    /// The chance that more SPADs than THRESHOLD fire, each with chance `fired`. SPADs have an order here: the sum is over the SPAD that is
    /// number THRESHOLD + 1 to fire.
    fn chance_of_more<const K: usize>(&self, fired: Dual<K>) -> Dual<K> {
        if self.threshold >= self.spads {
            return Dual::ZERO;
        }
        let chance = fired.value.clamp(0.0, 1.0);
        let silent = 1.0 - chance;
        if self.threshold == 0 {
            // 1 − qⁿ = (1 − q)(1 + q + … + qⁿ⁻¹), by doubling.
            let (mut sum, mut power, mut before) = (1.0, silent, 1.0);
            for bit in (0..self.spads.ilog2()).rev() {
                before *= power;
                sum *= 1.0 + power;
                power *= power;
                if self.spads >> bit & 1 == 1 {
                    before = power;
                    sum += power;
                    power *= silent;
                }
            }
            return fired.chain(chance * sum, self.spads as f64 * before);
        }
        let (mut sum, mut term, mut none) = (1.0, 1.0, 1.0);
        let mut ways = 1.0;
        let inverse = &INVERSE[..self.spads - self.threshold];
        for (others, inverse) in inverse.iter().enumerate().skip(1) {
            let growth = (self.threshold + others) as f64 * inverse;
            ways *= growth;
            term *= silent * growth;
            none *= silent;
            sum += term;
        }
        let before: f64 = (0..self.threshold).map(|_| chance).product();
        let slope = self.spads as f64 * ways * before * none;
        fired.chain(before * chance * sum, slope)
    }

    /// The chance that a bin counts in which `n` SPADs fired by light, and its slope with `children`.
    #[inline]
    fn conditional_chance(&self, n: usize, children: f64) -> (f64, f64) {
        if children <= 0.0 || n == 0 {
            return (f64::from(u8::from(self.counts(n))), 0.0);
        }
        let avalanches = n as i32;
        let (mut holds, mut slope) = (0.0, 0.0);
        let mut ways = 1.0;
        for k in 0..=avalanches {
            if self.counts((n + k as usize).min(self.spads)) {
                let chance = ways * children.powi(k) * (1.0 - children).powi(avalanches - k);
                holds += chance;
                slope += chance
                    * (f64::from(k) / children - f64::from(avalanches - k) / (1.0 - children));
            }
            ways *= f64::from(avalanches - k) / f64::from(k + 1);
        }
        (holds, slope)
    }

    /// The chance of a SPAD to fire at which a bin counts with `chance`, without crosstalk; counts must rise with it.
    pub(super) fn fired_for(&self, chance: f64) -> f64 {
        let chance_of = |fired: f64| self.chance(Dual::<0>::constant(fired), Dual::ZERO).value;
        if (self.event_type, self.threshold) == (EventType::Greater, 0) {
            return -libm::expm1(libm::log1p(-chance.min(1.0 - 1e-12)) / self.spads as f64);
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if chance_of(middle) < chance {
                low = middle
            } else {
                high = middle
            }
        }
        0.5 * (low + high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The same, summed over every set of SPADs that may have fired, and over which of them had a child.
    fn by_enumeration(counting: &Counting, fired: f64, children: f64) -> f64 {
        let mut chance = 0.0;
        for set in 0u32..1 << counting.spads {
            let n = set.count_ones() as usize;
            for parents in 0u32..1 << n {
                let k = parents.count_ones() as usize;
                if counting.counts((n + k).min(counting.spads)) {
                    chance += fired.powi(n as i32)
                        * (1.0 - fired).powi((counting.spads - n) as i32)
                        * children.powi(k as i32)
                        * (1.0 - children).powi((n - k) as i32);
                }
            }
        }
        chance
    }

    proptest! {
        #[test]
        fn chances_are_those_of_every_case_summed(
            event_type in prop_oneof![Just(EventType::Less), Just(EventType::Equal), Just(EventType::Greater)],
            threshold in 0usize..6,
            fired in 0.001f64..0.999,
            children in prop_oneof![Just(0.0), 0.001f64..0.5],
        ) {
            let counting = Counting { event_type, threshold, spads: 5 };
            let closed_form = |fired, children| {
                counting.chance(Dual::<2>::parameter(fired, 0), Dual::parameter(children, 1))
            };
            let chance = closed_form(fired, children);
            let expected = by_enumeration(&counting, fired, children);
            prop_assert!((chance.value - expected).abs() < 1e-12, "{} {expected}", chance.value);
            let h = 1e-6;
            let by_fired = (closed_form(fired + h, children).value - closed_form(fired - h, children).value) / (2.0 * h);
            prop_assert!((chance.slope[0] - by_fired).abs() < 1e-6, "{:?} {by_fired}", chance.slope);
            if children > 0.0 {
                let by_children = (closed_form(fired, children + h).value - closed_form(fired, children - h).value) / (2.0 * h);
                prop_assert!((chance.slope[1] - by_children).abs() < 1e-6, "{:?} {by_children}", chance.slope);
            }
            // Nearer to 1 a chance no longer tells how likely one SPAD is.
            let tells = chance.value < 1.0 - 1e-12;
            if event_type == EventType::Greater && children == 0.0 && threshold < 5 && tells {
                prop_assert!((counting.fired_for(chance.value) - fired).abs() < 1e-6);
            }
        }
    }
}
