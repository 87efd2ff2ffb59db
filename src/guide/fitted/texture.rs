//! What texture is to the matcher, and what becomes of its disparities by it.
//!
//! Texture is the grain's standard deviation over that of the noise, both in one binned pixel. By that one number walls in the sun and at dusk, with much
//! grain and with little, binned and not, lie on the same curves (`vectors/stereo/errors.csv`):
//!
//! ```text
//!   σ² = σ₀² + σ_m²·u²/(1 + u²), u = σ₁/(σ_m·t)       none: s₀ + (1 − s₀)/(1 + (t/t½)ᵏ)       gross: s₀ + s_m/(1 + (t/t½)⁴)
//! ```
//!
//! What is not matched well is thrown out rather than told, so that gross answers stay rare down to where there are hardly any at all.

use statrs::distribution::{ContinuousCDF, Normal};

/// σ₁: what is added to an error's standard deviation at a texture of 1 were there no end to it, binned pixels.
const SIGMA_AT_1_PX: f64 = 1.3;
/// σ_m: beyond that, answers are thrown out.
const MOST_SIGMA_PX: f64 = 1.0;
/// k: exponents above and below the texture at which half of the pixels have no answer.
const INVALID_FALLS_WITH: [f64; 2] = [2.5, 5.0];
/// s_m: share of answers that are wrong by anything where there is next to no texture. As many are more than two pixels off by the others' σ.
const MOST_GROSS: f64 = 0.015;
const GROSS_FALLS_WITH: f64 = 4.0;

/// How answers depend on texture: `sigma_px` and shares where it is strong, and the texture at which half of all pixels have no answer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Law {
    pub(super) sigma_px: f64,
    pub(super) invalid: f64,
    pub(super) gross: f64,
    pub(super) limit: f64,
}

impl Law {
    /// Standard deviation of an error that is not gross, binned pixels.
    pub(super) fn sigma_px(&self, texture: f64) -> f64 {
        let u = SIGMA_AT_1_PX / (MOST_SIGMA_PX * texture.max(1e-3));
        self.sigma_px.hypot(MOST_SIGMA_PX * u / 1f64.hypot(u))
    }

    /// The standard normal number below which a pixel has no answer.
    pub(super) fn invalid_below(&self, texture: f64) -> f64 {
        let t = self.over_limit(texture);
        let exponent = INVALID_FALLS_WITH[usize::from(t < 1.0)];
        threshold(self.invalid + (1.0 - self.invalid) / (1.0 + t.powf(exponent)))
    }

    /// The standard normal number below which an answer is grossly wrong.
    pub(super) fn gross_below(&self, texture: f64) -> f64 {
        let t = self.over_limit(texture);
        let more = MOST_GROSS.min(1.0 - self.gross);
        threshold(self.gross + more / (1.0 + t.powf(GROSS_FALLS_WITH)))
    }

    fn over_limit(&self, texture: f64) -> f64 {
        match self.limit > 0.0 {
            true => texture.max(0.0) / self.limit,
            // No texture is too weak.
            false => f64::INFINITY,
        }
    }
}

fn threshold(share: f64) -> f64 {
    match share {
        s if s <= 0.0 => f64::NEG_INFINITY,
        s if s >= 1.0 => f64::INFINITY,
        s => Normal::standard().inverse_cdf(s),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn more_texture_is_never_worse(
            textures in (0.0f64..20.0, 0.0f64..20.0), sigma_px in 0.0f64..2.0, shares in (0.0f64..=1.0, 0.0f64..=1.0), limit in 0.0f64..5.0,
        ) {
            let law = Law { sigma_px, invalid: shares.0, gross: shares.1, limit };
            let (weak, strong) = (textures.0.min(textures.1), textures.0.max(textures.1));
            prop_assert!(law.sigma_px(strong) <= law.sigma_px(weak) + 1e-12);
            prop_assert!(law.invalid_below(strong) <= law.invalid_below(weak) + 1e-9);
            prop_assert!(law.gross_below(strong) <= law.gross_below(weak) + 1e-9);
        }
    }
}
