//! How cells that should be equal differ at random.
//!
//! Mismatch is Gaussian, with a standard deviation that falls with the square root of a cell's area (Pelgrom
//! et al., IEEE JSSC 24, 1989), its transistor count standing for the area. A cell's draw depends on nothing
//! but the seed and the cell's path, so that a block is the same alone and within an array. Wires do not differ.

use rand_philox::{Philox, splitmix64, u32_to_unit_f64};

/// Random differences between cells that should be equal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mismatch {
    /// Standard deviation of an inverter's delay, relative to its mean.
    pub sigma: f64,
    /// Which chip.
    pub seed: u64,
}

impl Mismatch {
    /// Factor on the delays of the cell at this dotted path with this many transistors; never below 0.1, so that
    /// causes stay before their effects.
    pub(crate) fn factor(&self, path: &str, transistors: u32) -> f64 {
        const INVERTER: f64 = 2.0;
        let key = splitmix64(self.seed);
        let block = (hash(path) as u128) << 64;
        let mut random = Philox::new([key as u32, (key >> 32) as u32], block);
        // Box and Muller.
        let radius = libm::sqrt(-2.0 * libm::log(u32_to_unit_f64(random.next_u32())));
        let angle = std::f64::consts::TAU * u32_to_unit_f64(random.next_u32());
        let sigma = self.sigma * libm::sqrt(INVERTER / transistors as f64);
        (1.0 + sigma * radius * libm::cos(angle)).max(0.1)
    }
}

/// FNV-1a (Fowler, Noll and Vo), 64 bits: the same on every machine and in every version.
fn hash(path: &str) -> u64 {
    path.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ byte as u64).wrapping_mul(0x0000_0100_0000_01b3)
    })
}
