//! Numerical tools that no circuit needs but every formula does: quadrature, special functions, confidence intervals,
//! regression.

pub mod branchless;
mod dual;
pub mod intervals;
pub mod probit;
mod quadrature;
mod special;

pub use dual::Dual;
pub(crate) use quadrature::gauss_legendre;
pub use quadrature::integrate;
pub(crate) use special::erfcx;
pub(crate) use special::ln_exprel_neg;
pub(crate) use special::ln_sum_exp;
pub(crate) use special::poisson_deviance;
pub use special::{ln_normal_below, normal_above, normal_density, stirling_error, stirling_series};
