//! How delays vary: with process, supply voltage and temperature, and at random from cell to cell.
//!
//! Delay follows the alpha-power law (Sakurai and Newton, IEEE JSSC 25, 1990):
//!
//! ```text
//!   delay ∝ V / (μ(T) · (V − Vth(T))^α)      μ ∝ T^−1.5 (lattice scattering),   Vth falls linearly with T
//! ```
//!
//! α = 1.3 is Sakurai and Newton's figure for a short-channel transistor. The threshold (0.40 V at 50 °C), its
//! temperature coefficient (−0.8 mV/K) and the process spread (±30 mV of threshold, ±8 % of drive) are round
//! figures assumed for a 40 nm low-power process: no foundry's numbers are public. Every delay of the chip
//! scales by one factor, exactly 1 at 1.1 V, 50 °C, typical, where the library is characterised.
//!
//! A flip-flop's limits scale with its conditions as delays do; [`Mismatch`] leaves them alone.

use std::collections::BTreeSet;

use super::cell::CellKind;
use super::corner::Corner;
use super::flat::Netlist;
use super::id::CellId;
use super::library::Library;
use super::mismatch::Mismatch;
use super::timing::Timing;

/// Where the chip is operated, and what it is made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conditions {
    /// Silicon, at a voltage and temperature that are the same for all: faster by its transistors alone.
    pub process: Corner,
    /// Supply, V.
    pub voltage_v: f64,
    /// Junction temperature, °C.
    pub temperature_c: f64,
}

impl Default for Conditions {
    /// Where the library is characterised: typical, 1.1 V, 50 °C.
    fn default() -> Self {
        Conditions {
            process: Corner::Typ,
            voltage_v: 1.1,
            temperature_c: 50.0,
        }
    }
}

const ALPHA: f64 = 1.3;
const MOBILITY_EXPONENT: f64 = 1.5;
const THRESHOLD_V: f64 = 0.40;
const THRESHOLD_V_PER_K: f64 = -0.8e-3;
const ZERO_CELSIUS_K: f64 = 273.15;

impl Conditions {
    /// Factor on every delay of the typical library, or `None` outside what the model can say: below 0.2 V of
    /// overdrive, above 2 V, or not from −55 to 150 °C.
    pub fn delay_factor(&self) -> Option<f64> {
        let reference = Conditions::default().raw_delay()?;
        Some(self.raw_delay()? / reference)
    }

    /// Delay in arbitrary units.
    fn raw_delay(&self) -> Option<f64> {
        let in_range =
            (0.0..=2.0).contains(&self.voltage_v) && (-55.0..=150.0).contains(&self.temperature_c);
        let (shift_v, drive) = match self.process {
            // High threshold and weak drive; low threshold and strong drive.
            Corner::Slow => (0.03, 0.92),
            Corner::Typ => (0.0, 1.0),
            Corner::Fast => (-0.03, 1.08),
        };
        let reference_c = 50.0;
        let threshold =
            THRESHOLD_V + shift_v + THRESHOLD_V_PER_K * (self.temperature_c - reference_c);
        let overdrive = self.voltage_v - threshold;
        let mobility = libm::pow(
            (self.temperature_c + ZERO_CELSIUS_K) / (reference_c + ZERO_CELSIUS_K),
            -MOBILITY_EXPONENT,
        );
        (in_range && overdrive >= 0.2)
            .then(|| self.voltage_v / (drive * mobility * libm::pow(overdrive, ALPHA)))
    }
}

/// The limits of `library` times `factor`, as conditions scale them; delays are left alone.
pub fn derated_limits(library: &Library, factor: f64) -> Library {
    let mut derated = library.clone();
    for kind in CellKind::ALL {
        derated.set_checks(kind, library.checks(kind).scaled(factor));
    }
    derated
}

/// `nominal` with every delay and limit times `factor` and, if asked for, every cell's own mismatch on its delays; rounded to
/// whole femtoseconds.
pub fn varied(
    netlist: &Netlist,
    nominal: &Timing,
    factor: f64,
    mismatch: Option<Mismatch>,
) -> Timing {
    varied_as(netlist, nominal, factor, mismatch, |cell| {
        netlist.cell_path(cell)
    })
}

/// The same where each cell is the one at this path: a netlist may stand for another that differs in names.
pub fn varied_as(
    netlist: &Netlist,
    nominal: &Timing,
    factor: f64,
    mismatch: Option<Mismatch>,
    path: impl Fn(CellId) -> String,
) -> Timing {
    let mut timing = nominal.clone();
    if factor == 1.0 && mismatch.is_none() {
        return timing;
    }
    let own_delays = netlist.own_delays().iter();
    let wires = own_delays.filter(|(_, delay)| !delay.mismatches);
    let wires: BTreeSet<CellId> = wires.map(|&(cell, _)| cell).collect();
    for (index, cell) in netlist.cells().iter().enumerate() {
        let id = CellId::new(index);
        let mismatch = mismatch.filter(|_| !wires.contains(&id));
        let own = mismatch.map_or(1.0, |m| m.factor(&path(id), cell.kind.transistors()));
        let scale = |fs: u32| (fs as f64 * factor * own).round() as u32;
        let mut delays = *nominal.cell_delays(id);
        for arc in delays.as_flattened_mut() {
            arc.rise_fs = scale(arc.rise_fs);
            arc.fall_fs = scale(arc.fall_fs);
        }
        timing.set(id, delays);
    }
    timing.scale_limits(factor);
    timing
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::netlist::ModuleBuilder;

    fn factor(process: Corner, voltage_v: f64, temperature_c: f64) -> f64 {
        let conditions = Conditions {
            process,
            voltage_v,
            temperature_c,
        };
        conditions.delay_factor().unwrap()
    }

    #[test]
    fn the_reference_is_exactly_one() {
        assert_eq!(Conditions::default().delay_factor(), Some(1.0));
    }

    /// Overdrive 0.7 V at the reference; 0.2 V less supply at 100 °C, with 40 mV less threshold, in fast silicon.
    #[test]
    fn a_factor_by_hand() {
        let threshold_v: f64 = 0.40 - 0.03 - 0.04;
        let mobility = ((100.0 + 273.15) / (50.0 + 273.15_f64)).powf(-1.5);
        let raw = 0.9 / (1.08 * mobility * (0.9 - threshold_v).powf(1.3));
        let reference = 1.1 / 0.7_f64.powf(1.3);
        let found = factor(Corner::Fast, 0.9, 100.0);
        assert!((found / (raw / reference) - 1.0).abs() < 1e-12, "{found}");
    }

    #[test]
    fn low_voltage_heat_and_slow_silicon_are_slow() {
        assert!(factor(Corner::Typ, 1.0, 50.0) > 1.0);
        assert!(factor(Corner::Typ, 1.1, 100.0) > 1.0);
        assert!(factor(Corner::Slow, 1.1, 50.0) > 1.0);
        assert!(factor(Corner::Fast, 1.1, 50.0) < 1.0);
        assert!(factor(Corner::Typ, 1.2, 0.0) < 1.0);
    }

    #[test]
    fn impossible_conditions_have_no_factor() {
        for (voltage_v, temperature_c) in [(0.4, 50.0), (3.0, 50.0), (1.1, 200.0), (f64::NAN, 50.0)]
        {
            let conditions = Conditions {
                voltage_v,
                temperature_c,
                ..Conditions::default()
            };
            assert_eq!(conditions.delay_factor(), None);
        }
    }

    #[test]
    fn limits_scale_with_delays() {
        let mut m = ModuleBuilder::new("m");
        let pins = CellKind::Dffr.inputs().iter().map(|pin| m.input(pin));
        let pins: Vec<_> = pins.collect();
        let q = m.output("Q");
        m.cell("flip_flop", CellKind::Dffr, &pins, &[Some(q), None]);
        let netlist = Netlist::elaborate(&m.finish().unwrap());
        let library = Library::generic_40nm();
        let timing = |library: &Library| Timing::nominal(&netlist, library, Corner::Typ);
        let (slow, derated) = (
            varied(&netlist, &timing(&library), 1.5, None),
            timing(&derated_limits(&library, 1.5)),
        );
        let limits = |timing: &Timing| *timing.limits(CellId::new(0), CellKind::Dffr);
        assert_eq!(limits(&slow), limits(&derated));
        assert_ne!(limits(&slow), limits(&timing(&library)));
    }

    #[test]
    fn mismatch_has_the_spread_of_its_area() {
        let mismatch = Mismatch {
            sigma: 0.08,
            seed: 3,
        };
        let draws: Vec<f64> = (0..20_000)
            .map(|cell| mismatch.factor(&format!("chip.cell_{cell}"), 8))
            .collect();
        let mean = draws.iter().sum::<f64>() / draws.len() as f64;
        let variance = draws.iter().map(|d| (d - mean) * (d - mean)).sum::<f64>();
        let sigma = (variance / draws.len() as f64).sqrt();
        assert!((mean - 1.0).abs() < 0.001, "{mean}");
        assert!((sigma - 0.04).abs() < 0.001, "{sigma}");
        assert_eq!(draws[7], mismatch.factor("chip.cell_7", 8));
    }
}
