//! Physical constants (SI 2019, exact by definition).

/// Speed of light in vacuum, m/s.
pub const SPEED_OF_LIGHT_M_PER_S: f64 = 299_792_458.0;

/// Planck's constant, J·s.
pub const PLANCK_J_S: f64 = 6.626_070_15e-34;
