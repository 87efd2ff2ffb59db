//! Count rates of the front ends: what dead time, overlapping pulses and sampling leave of the avalanches (thesis 2.4.1,
//! Fig. 22).
//!
//! Photons of rate φ find a SPAD with dead time D, which is not prolonged: avalanches come at the rate m below. In a
//! stretch no longer than D a SPAD fires once or not at all, and once with probability m × its length. So the rates below
//! are exact for n SPADs that fire independently, as long as pulses and CLK periods are shorter than D.

/// Avalanches of a SPAD, 1/s, in light of `photons_hz` that it would detect: φ / (1 + φ D), the non-paralysable law.
pub fn non_paralysable_hz(photons_hz: f64, dead_time_s: f64) -> f64 {
    photons_hz / (1.0 + photons_hz * dead_time_s)
}

/// Edges of a wire that is prolonged by every pulse, 1/s: Λ exp(−Λ τ), the paralysable law, to which an OR tree of many
/// SPADs comes.
pub fn paralysable_hz(pulses_hz: f64, width_s: f64) -> f64 {
    pulses_hz * libm::exp(-pulses_hz * width_s)
}

/// How far two shaped pulses may be apart and meet, s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Meeting {
    /// The later one begins within this time of the earlier one's begin, and both are high long enough together.
    pub together_s: f64,
    /// The later one begins within this time, and no gap is seen between them.
    pub joined_s: f64,
}

/// Rises, 1/s, of a wire that is high where `together` of `spads` pulses are: n m C(n−1, k−1) (m τ)ᵏ⁻¹ (1 − m τ)ⁿ⁻ᵏ, with the
/// τ of each factor. For one SPAD, `together` = 1, it is an OR tree's wire.
pub fn coincidences_hz(spads: u32, together: u32, avalanches_hz: f64, meeting: Meeting) -> f64 {
    if together == 0 || together > spads {
        return 0.0;
    }
    let others = spads - 1;
    let ways = (1..together).fold(1.0, |ways, k| {
        ways * f64::from(others + 1 - k) / f64::from(k)
    });
    let high = (avalanches_hz * meeting.together_s).powi(together as i32 - 1);
    let low = (1.0 - avalanches_hz * meeting.joined_s).max(0.0);
    f64::from(spads) * avalanches_hz * ways * high * low.powi((spads - together) as i32)
}

/// Avalanches of each SPAD, 1/s, at which such a wire has most rises: k / (n τ), for both τ alike.
pub fn fold_hz(spads: u32, together: u32, width_s: f64) -> f64 {
    f64::from(together) / (f64::from(spads) * width_s)
}

/// Edges of an XOR tree, 1/s, into which toggles come at random with `toggles_hz`: Λ / (2 exp(Λ δ) − 1). A toggle that is
/// followed by another within a gate's delay δ takes that with it, and neither is seen.
pub fn xor_edges_hz(toggles_hz: f64, gate_delay_s: f64) -> f64 {
    toggles_hz / (2.0 * libm::exp(toggles_hz * gate_delay_s) - 1.0)
}

/// CLK periods, 1/s, in which an odd number of `spads` SPADs fire, which is what a sampled XOR tree tells:
/// (1 − (1 − 2 m T)ⁿ) / 2 of all, half of them at most where many fire.
pub fn odd_periods_hz(spads: u32, avalanches_hz: f64, clk_hz: f64) -> f64 {
    0.5 * clk_hz * any_of(spads, 2.0 * avalanches_hz / clk_hz)
}

/// CLK periods, 1/s, in which any SPAD fires: what synchronous summation with THRESHOLD 0 counts, 1 − (1 − m T)ⁿ of all.
pub fn any_periods_hz(spads: u32, avalanches_hz: f64, clk_hz: f64) -> f64 {
    clk_hz * any_of(spads, avalanches_hz / clk_hz)
}

/// 1 − (1 − x)ⁿ, with its digits where x is small.
fn any_of(n: u32, x: f64) -> f64 {
    if x < 0.5 {
        -libm::expm1(f64::from(n) * libm::log1p(-x))
    } else {
        1.0 - (1.0 - x).powi(n as i32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_philox::{philox4x32_10, u32_to_unit_f64};

    const WIDTH_S: f64 = 1e-9;
    const EXACT: Meeting = Meeting {
        together_s: WIDTH_S,
        joined_s: WIDTH_S,
    };

    #[test]
    fn an_or_tree_of_many_spads_is_paralysable_and_folds_over_at_its_width() {
        for pulses_hz in [1e6, 1e8, 1e9, 5e9] {
            let many = coincidences_hz(100_000, 1, pulses_hz / 1e5, EXACT);
            let law = paralysable_hz(pulses_hz, WIDTH_S);
            assert!((many / law - 1.0).abs() < 1e-3, "{many} {law}");
        }
        for together in 1..5 {
            let rate = |avalanches_hz| coincidences_hz(16, together, avalanches_hz, EXACT);
            let fold = fold_hz(16, together, WIDTH_S);
            assert!(rate(fold) > rate(0.99 * fold) && rate(fold) > rate(1.01 * fold));
        }
        assert_eq!(coincidences_hz(4, 5, 1e6, EXACT), 0.0);
    }

    #[test]
    fn a_dead_time_leaves_a_limit_and_sampling_half_of_the_periods() {
        assert!((non_paralysable_hz(1e15, 8e-9) * 8e-9 - 1.0).abs() < 1e-6);
        assert_eq!(odd_periods_hz(16, 1e8, 2e8), 1e8);
        assert!((odd_periods_hz(16, 1e3, 2e8) / 16e3 - 1.0).abs() < 1e-3);
        assert!((any_periods_hz(16, 1e3, 2e8) / 16e3 - 1.0).abs() < 1e-3);
    }

    /// SPADs drawn one by one, pulses laid side by side, against the formulas: 4 standard errors of 40 000 rises.
    #[test]
    fn pulses_drawn_at_random_meet_as_often_as_computed() {
        let (spads, photons_hz, dead_s) = (16u32, 60e6, 5e-9);
        let end_s = 200e-6;
        let mut ends: Vec<(f64, i32)> = Vec::new();
        for spad in 0..spads {
            let mut time = 0.0;
            for number in 0.. {
                let word = philox4x32_10([number, spad, 0, 0], [7, 0])[0];
                time +=
                    -u32_to_unit_f64(word).ln() / photons_hz + f64::from(number.min(1)) * dead_s;
                if time > end_s {
                    break;
                }
                ends.extend([(time, 1), (time + WIDTH_S, -1)]);
            }
        }
        ends.sort_by(|a, b| a.0.total_cmp(&b.0));
        let avalanches = non_paralysable_hz(photons_hz, dead_s);
        for together in 1..4 {
            let (mut high, mut rises) = (0, 0);
            for &(_, change) in &ends {
                high += change;
                rises += i32::from(change > 0 && high == together);
            }
            let expected = end_s * coincidences_hz(spads, together as u32, avalanches, EXACT);
            let off = (f64::from(rises) - expected).abs();
            assert!(
                off < 4.0 * expected.sqrt(),
                "{together}: {rises} {expected}"
            );
        }
    }
}
