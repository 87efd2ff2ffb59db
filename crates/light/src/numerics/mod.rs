//! Numerical tools that no circuit needs but every formula does: quadrature, special functions, confidence intervals,
//! regression.

pub mod branchless;
mod dual;
pub mod intervals;
pub mod probit;
mod quadrature;
mod special;

pub use dual::Dual;
pub(crate) use quadrature::{gauss_legendre, integrate};
pub use special::{
    erfcx, ln_exprel_neg, ln_normal_below, ln_sum_exp, normal_above, normal_density,
    poisson_deviance, stirling_error, stirling_series,
};
