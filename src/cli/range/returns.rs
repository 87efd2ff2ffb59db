//! Columns of tables of depths: numbers that may be missing, and the returns after the first.

use std::io::{self, Write};

use crate::system::RETURNS;

/// A number, or nothing.
pub(super) fn number_text(value: Option<f64>) -> String {
    value.map_or(String::new(), |value| format!("{value:.6}"))
}

/// Names of the columns of the returns after the first, whose photons are `photons`.
pub(super) fn write_further_head(out: &mut dyn Write, photons: &str) -> io::Result<()> {
    for n in 2..=RETURNS {
        write!(out, ",depth_{n}_m,bound_{n}_m,{photons}_{n}")?;
    }
    Ok(())
}

/// Depth (m), bound (m) and photons of the returns after the first, which `further` gives by their numbers from 1.
pub(super) fn write_further(
    out: &mut dyn Write,
    further: impl Fn(usize) -> Option<(f64, Option<f64>, f64)>,
) -> io::Result<()> {
    for n in 1..RETURNS {
        let further = further(n);
        write!(
            out,
            ",{},{},{}",
            number_text(further.map(|(depth_m, ..)| depth_m)),
            number_text(further.and_then(|(_, bound_m, _)| bound_m)),
            number_text(further.map(|(.., photons)| photons)),
        )?;
    }
    Ok(())
}
