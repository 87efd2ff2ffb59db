//! Points, directions and rays in three dimensions.

use std::ops::{Add, Mul, Sub};

/// A point or direction, m (or without unit): x right, y down, z forward. In files `[x, y, z]`.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(from = "[f64; 3]", into = "[f64; 3]")]
pub struct Vec3 {
    /// To the right.
    pub x: f64,
    /// Down.
    pub y: f64,
    /// Forward.
    pub z: f64,
}

impl Vec3 {
    /// From its three components.
    pub const fn new(x: f64, y: f64, z: f64) -> Self {
        Vec3 { x, y, z }
    }

    /// Scalar product.
    pub fn dot(self, other: Vec3) -> f64 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Vector product `self × other`.
    pub fn cross(self, other: Vec3) -> Vec3 {
        Vec3::new(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )
    }

    /// Length.
    pub fn norm(self) -> f64 {
        self.dot(self).sqrt()
    }

    /// The same direction with length 1; the vector must not be zero.
    pub fn unit(self) -> Vec3 {
        debug_assert!(self.norm() > 0.0, "zero vector has no direction");
        self * (1.0 / self.norm())
    }

    /// Turned about the y axis by the angle whose cosine and sine are given; a positive angle
    /// turns the forward direction to the right.
    pub fn turned(self, (cosine, sine): (f64, f64)) -> Vec3 {
        Vec3::new(
            cosine * self.x + sine * self.z,
            self.y,
            cosine * self.z - sine * self.x,
        )
    }

    /// x, y, z.
    pub fn components(self) -> [f64; 3] {
        [self.x, self.y, self.z]
    }
}

impl From<[f64; 3]> for Vec3 {
    fn from([x, y, z]: [f64; 3]) -> Self {
        Vec3 { x, y, z }
    }
}

impl From<Vec3> for [f64; 3] {
    fn from(vector: Vec3) -> Self {
        vector.components()
    }
}

impl Add for Vec3 {
    type Output = Vec3;
    fn add(self, rhs: Vec3) -> Vec3 {
        Vec3::new(self.x + rhs.x, self.y + rhs.y, self.z + rhs.z)
    }
}

impl Sub for Vec3 {
    type Output = Vec3;
    fn sub(self, rhs: Vec3) -> Vec3 {
        Vec3::new(self.x - rhs.x, self.y - rhs.y, self.z - rhs.z)
    }
}

impl Mul<f64> for Vec3 {
    type Output = Vec3;
    fn mul(self, rhs: f64) -> Vec3 {
        Vec3::new(self.x * rhs, self.y * rhs, self.z * rhs)
    }
}

/// A half-line along which one looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Where it starts, m.
    pub origin: Vec3,
    /// Where it goes; length 1, so that its parameter is a distance in metres.
    pub direction: Vec3,
}

impl Ray {
    /// From `origin` along `direction`, which need not have length 1 but must not be zero.
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Ray {
            origin,
            direction: direction.unit(),
        }
    }

    /// The point `range_m` along the ray.
    pub fn at(&self, range_m: f64) -> Vec3 {
        self.origin + self.direction * range_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_right_turn_takes_forward_to_the_right() {
        let forward = Vec3::new(0.0, 0.0, 1.0);
        let turned = forward.turned((0.0, 1.0));
        assert_eq!(turned, Vec3::new(1.0, 0.0, 0.0));
    }

    #[test]
    fn right_cross_down_is_forward() {
        let right = Vec3::new(1.0, 0.0, 0.0);
        let down = Vec3::new(0.0, 1.0, 0.0);
        assert_eq!(right.cross(down), Vec3::new(0.0, 0.0, 1.0));
    }
}
