//! Points, directions and rays in three dimensions: m (or without unit), x right, y down, z forward. In files
//! `[x, y, z]`.

use glam::DVec3;

/// `vector` turned about the y axis by the angle whose cosine and sine are given; a positive angle turns the forward
/// direction to the right.
pub fn turned(vector: DVec3, (cosine, sine): (f64, f64)) -> DVec3 {
    DVec3::new(
        cosine * vector.x + sine * vector.z,
        vector.y,
        cosine * vector.z - sine * vector.x,
    )
}

/// A half-line along which one looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Where it starts, m.
    pub origin: DVec3,
    /// Where it goes; length 1, so that its parameter is a distance in metres.
    pub direction: DVec3,
}

impl Ray {
    /// From `origin` along `direction`, which need not have length 1 but must not be zero.
    pub fn new(origin: DVec3, direction: DVec3) -> Self {
        debug_assert!(direction != DVec3::ZERO, "a direction has a length");
        Ray {
            origin,
            direction: direction.normalize(),
        }
    }

    /// The point `range_m` along the ray.
    pub(crate) fn point(&self, range_m: f64) -> DVec3 {
        self.origin + self.direction * range_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_right_turn_takes_forward_to_the_right() {
        assert_eq!(turned(DVec3::Z, (0.0, 1.0)), DVec3::X);
    }

    #[test]
    fn right_cross_down_is_forward() {
        assert_eq!(DVec3::X.cross(DVec3::Y), DVec3::Z);
    }
}
