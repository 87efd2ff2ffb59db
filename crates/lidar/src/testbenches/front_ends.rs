//! Testbench of the front ends: counts out against light in, from 1 M to 1 G detectable photons a second on each of 16
//! SPADs, for all of Fig. 22 at gate level beside their closed forms (thesis 2.4.1).
//!
//! ```text
//!                ┌─► summation ─────► SPAD_TIMED<16>
//!   SPAD_RAW ────┼─► or_tree ─WIRE──► SPAD_TIMED      rises of WIRE:  counted without a clock, as the figure has it
//!   CLK          ├─► xor_tree ─WIRE─► SPAD_TIMED      edges of WIRE
//!                └─► coincidence ───► SPAD_TIMED      CLK periods in which SPAD_TIMED is high: what the METDC gets
//! ```
//!
//! SPADs have 5 ns of dead time here, so that each front end's fold, if it has one, lies within the sweep. Beside the
//! waveform it leaves two charts with their numbers, one of the wires and one of what CLK samples.

mod bench;
mod closed_forms;

use std::path::Path;

use self::bench::{BEGIN, Bench, RatePoint, STEPS, view};
use self::closed_forms::{Laws, charts, compare, folds, table};
use crate::engine::waveform::write_waves;
use crate::files::InputError;
use crate::report::Checks;
use crate::testbenches::Testbench;
use crate::units::Time;

/// Light of the waveform, photons/s a SPAD.
const SHOWN_HZ: f64 = 80e6;

pub(super) const TESTBENCH: Testbench = Testbench {
    name: "tb_front_ends",
    about: "Front ends of Fig. 22: counts out against light in, and where each folds over",
    run,
    given: None,
};

fn run(waves: &Path, checks: &mut Checks) -> Result<(), InputError> {
    let bench = Bench::new();
    let laws = Laws::new(&bench);
    // 1 M to 1 G.
    let rates =
        (6 * STEPS..=9 * STEPS).map(|step| libm::pow(10f64, f64::from(step) / f64::from(STEPS)));
    let points: Vec<RatePoint> = rates.map(|photons_hz| bench.count(photons_hz)).collect();
    checks.note(table(&points));
    compare(&points, &laws, checks);
    folds(&points, &laws, checks);
    charts(waves, &points, &laws)?;
    let end = BEGIN + Time::from_ns(150);
    write_waves(waves, &bench.rig.netlist, &view(), |waves| {
        bench.simulate(SHOWN_HZ, end, waves);
        end
    })
}
