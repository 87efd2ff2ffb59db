//! What makes light impossible.

/// Whether this may be a mean number or a rate.
pub(super) const fn is_amount(number: f64) -> bool {
    number.is_finite() && number >= 0.0
}

/// Why light cannot be as described.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LightError {
    /// No segment.
    #[error("a timeline needs at least one segment of light")]
    NoSegment,
    /// The first segment begins later than the exposure.
    #[error("the first segment of a timeline begins with laser cycle 0, not {0}")]
    LateStart(u32),
    /// A segment does not begin after the one before.
    #[error(
        "segments of a timeline begin one after the other, but one of laser cycle {next} follows one of laser cycle {before}"
    )]
    Order {
        /// First laser cycle of the segment before.
        before: u32,
        /// First laser cycle of the segment.
        next: u32,
    },
    /// A segment is a timeline itself, or has SPADs of its own.
    #[error(
        "a segment of a timeline is light without segments and without SPADs of its own; give the spread of SPADs to the whole timeline"
    )]
    Nested,
    /// A profile without a rate, or with another number of edges than one more.
    #[error(
        "a profile of {rates} rates needs {rates} + 1 edges and at least one rate, not {edges} edges"
    )]
    Pieces {
        /// Rates given.
        rates: usize,
        /// Edges given.
        edges: usize,
    },
    /// Edges of a profile that do not rise, or begin before the laser cycle.
    #[error("edges of a profile rise, from 0 or later on")]
    Edges,
    /// A rate of a profile is negative, infinite or NaN.
    #[error("a rate of light is finite and at least 0, not {0}")]
    Rate(f64),
    /// Detection efficiencies or dark counts of another number of SPADs than the other.
    #[error(
        "{factors} factors of SPADs and {dark} dark count rates; give one of each for every SPAD"
    )]
    Spads {
        /// Factors given.
        factors: usize,
        /// Dark count rates given.
        dark: usize,
    },
    /// A factor or a dark count rate of a SPAD is negative, infinite or NaN.
    #[error("factors and dark count rates of SPADs are finite and at least 0, not {0}")]
    Spad(f64),
}
