//! Numerical tools that no circuit needs but every formula does: quadrature and special functions.

mod quadrature;
mod special;

pub use quadrature::{gauss_legendre, integrate};
pub use special::{
    erfcx, ln_exprel_neg, ln_normal_below, ln_sum_exp, normal_above, normal_density,
    poisson_deviance, stirling_error,
};
