//! Functions that others are made of: numerics, closed forms of the theory, and ranging.

use super::{Function, Measure, References, Value};

use guided_dtof::numerics::intervals::share;
use guided_dtof::numerics::{Dual, branchless, ln_normal_below, normal_above, stirling_error};
use guided_dtof::ranging::{ArrivalOptions, arrival};
use guided_dtof::theory::design::share_inside;
use guided_dtof::theory::front_ends::{any_periods_hz, odd_periods_hz};
use guided_dtof::theory::significance::Scan;

/// A function of real numbers whose error is `measure`d.
fn real(
    (name, range): (&'static str, &'static str),
    references: References,
    compute: fn(&[f64]) -> Value,
    (measure, promise): (Measure, f64),
) -> Function {
    Function {
        name,
        range,
        references,
        compute,
        measure,
        promise,
    }
}

/// The functions.
pub(super) fn functions() -> Vec<Function> {
    use Measure::{Absolute, Relative};
    vec![
        real(
            ("tail of the normal distribution", "z to 37, down to 1e-299"),
            references!("stability/normal_tails", 0 of 2),
            |a| Value::Real(normal_above(a[0])),
            (Relative, 1e-14),
        ),
        real(
            (
                "the same for arrays",
                "z to 37 in magnitude, the upper tail",
            ),
            references!("stability/normal_tails", 0 of 2),
            // It is made for the upper half.
            |a| {
                let above = branchless::normal_above(a[0].abs());
                Value::Real(if a[0] < 0.0 { 1.0 - above } else { above })
            },
            (Relative, 2e-13),
        ),
        real(
            ("logarithm of the normal distribution", "z from -1e5 to 37"),
            references!("stability/normal_tails", 1 of 2),
            |a| Value::Real(ln_normal_below(a[0])),
            (Relative, 1e-14),
        ),
        real(
            ("error of Stirling's formula", "n from 1 to 2^53"),
            references!("stability/stirling_errors"),
            |a| Value::Real(stirling_error(a[0] as u64)),
            (Absolute, 1e-14),
        ),
        real(
            (
                "share of targets inside a window",
                "sigma 1e-3 to 1e3, windows 0.01 to 100, steps from 0 to all of it",
            ),
            references!("stability/windows"),
            |a| Value::Real(share_inside(a[0], a[1], a[2])),
            (Relative, 1e-12),
        ),
        real(
            (
                "CLK periods in which any SPAD fires",
                "1 to 1000 SPADs, chances 1e-15 to 1",
            ),
            references!("stability/periods", 0 of 2),
            |a| Value::Real(any_periods_hz(a[0] as u32, a[1], a[2])),
            (Relative, 1e-13),
        ),
        real(
            ("CLK periods in which an odd number fires", "the same"),
            references!("stability/periods", 1 of 2),
            |a| Value::Real(odd_periods_hz(a[0] as u32, a[1], a[2])),
            (Relative, 1e-13),
        ),
        real(
            ("(1 - exp(-x))/x in fits", "x from 1e-15 to 700"),
            references!("stability/hits", 0 of 3),
            |a| Value::Real(Dual::<1>::parameter(a[0], 0).exprel_neg().value),
            (Relative, 1e-12),
        ),
        real(
            ("its slope", "the same"),
            references!("stability/hits", 1 of 3),
            |a| Value::Real(Dual::<1>::parameter(a[0], 0).exprel_neg().slope[0]),
            (Relative, 1e-9),
        ),
        real(
            ("1 less it", "the same"),
            references!("stability/hits", 2 of 3),
            |a| Value::Real(Dual::<1>::parameter(a[0], 0).hits().1.value),
            (Absolute, 1e-12),
        ),
        real(
            (
                "ln of a peak's false alarms",
                "0 to 900 counts a bin, 1 to 60 more in one, 100 to 1e6 laser cycles",
            ),
            references!("stability/false_alarms"),
            |a| {
                let mut counts = [a[0] as u32; 16];
                counts[5] += a[1] as u32;
                let scan = Scan {
                    width: 1,
                    laser_cycles: a[2] as u32,
                };
                Value::Real(scan.fullest(&counts).ln_false_alarm)
            },
            (Absolute, 1e-10),
        ),
        real(
            (
                "lower end of a share's interval",
                "1 to 1e9 trials, shares 0, 1e-9 to 1",
            ),
            references!("stability/shares", 0 of 2),
            |a| Value::Real(share(a[0], a[1]).low),
            (Absolute, 1e-15),
        ),
        real(
            ("upper end of a share's interval", "the same"),
            references!("stability/shares", 1 of 2),
            |a| Value::Real(share(a[0], a[1]).high),
            (Relative, 1e-14),
        ),
        real(
            (
                "arrival of a pulse, bins",
                "no counts, even counts, one count, counts to 2^32 - 1",
            ),
            references!("stability/arrivals"),
            |a| {
                let counts: Vec<u32> = a.iter().map(|&count| count as u32).collect();
                let found = arrival(&counts, &ArrivalOptions::default());
                Value::Real(found.map_or(f64::NAN, |found| found.position_bins))
            },
            (Absolute, 1e-14),
        ),
    ]
}
