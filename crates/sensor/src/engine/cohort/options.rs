//! What the cohort engine may leave out.

/// The engine's knobs: what may be left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CohortOptions {
    /// Largest error of a bin's mean, in standard deviations of its count over the exposure.
    pub error: f64,
    /// Largest correlation between two bins that may be neglected to save time; 0 never neglects any.
    pub neglect: f64,
    /// Largest probability, for a whole exposure of a macropixel, that laser cycles depend on each other.
    pub memory: f64,
}

impl Default for CohortOptions {
    fn default() -> Self {
        CohortOptions {
            error: 0.1,
            neglect: 1e-4,
            memory: 1e-6,
        }
    }
}
