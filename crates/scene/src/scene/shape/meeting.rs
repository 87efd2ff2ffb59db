//! Where rays meet shapes, as all kinds of them say it.

/// Hits nearer than this are the surface on which a ray starts, m.
pub(super) const NEAREST_M: f64 = 1e-6;

/// Where a ray meets a shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::scene) struct Meeting {
    pub(in crate::scene) range_m: f64,
    /// Which of the shape's surfaces: the axis of a box's face, an end of a cylinder, a limb.
    pub(in crate::scene) part: u32,
}

/// A ray parameter, if it is a point one can see. Parallel rays give infinity or NaN.
pub(super) fn in_front(range_m: f64) -> Option<f64> {
    (range_m.is_finite() && range_m > NEAREST_M).then_some(range_m)
}
