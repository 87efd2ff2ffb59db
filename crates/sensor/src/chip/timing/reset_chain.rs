//! How long the delay chain of COUNTER_RESET must be for a library's cells.
//!
//! ```text
//!   STOP          ▁▁╱▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔
//!   COUNTER_RESET ▁▁▁╱▔▔▔▔▔▔▔▔▔▔▔▔▔╲▁▁▁▁▁▁   width: one delay of the chain
//!                     └─► stages, LOCAL_STOP fall ─► last edge at a stage's clock │
//!                     │◄──────────────── need, with removal time ─────────────►│
//! ```
//!
//! Edges that the reset itself sends into the clocks of the P-counter must meet a reset that still holds. Otherwise the counter counts
//! once more in every laser cycle but the first. How long they take depends on the cells, so the chain is sized for them: from the
//! built-in length on it grows until the pulse is a tenth longer than needed in every corner that has a file. The end of the same
//! chain makes the strobe of the conventional mode, which must come after HIT's reset.

use std::collections::HashMap;
use std::sync::{LazyLock, Mutex, PoisonError};

use super::measure::{Circuit, ResetPulse};
use super::silicon::Silicon;
use crate::chip::SensorConfig;
use crate::chip::p_counter_timing::SHORTEST_CHAIN;
use crate::netlist::Corner;
use crate::units::Time;

/// The least lead of the strobe that the window law takes: more than its rounding of 2 fs.
const ROUNDING: Time = Time::from_fs(3);

/// Longest chain that is tried: one that is too short still is reported as such.
const LONGEST_CHAIN: usize = 1000;

impl SensorConfig {
    /// Buffers of the delay chain that sets the width of COUNTER_RESET: `reset_stages`, or as many as the cells need. The
    /// configuration must have passed [`SensorConfig::check`], except that libraries may not have been read.
    pub fn reset_buffers(&self) -> usize {
        if self.reset_stages > 0 {
            return self.reset_stages;
        }
        static SIZED: LazyLock<Mutex<HashMap<[Option<Circuit>; 3], usize>>> =
            LazyLock::new(Mutex::default);
        let sized = || SIZED.lock().unwrap_or_else(PoisonError::into_inner);
        let corners = Corner::ALL.map(|corner| {
            let config = SensorConfig {
                corner,
                temperature_c: None,
                reset_stages: SHORTEST_CHAIN,
                ..self.clone()
            };
            Circuit::new(&config).map(|circuit| (circuit, config))
        });
        let key = corners
            .each_ref()
            .map(|corner| corner.as_ref().map(|(circuit, _)| *circuit));
        if let Some(&known) = sized().get(&key) {
            return known;
        }
        let corners = corners.iter().flatten();
        let needs = corners.map(|(_, config)| sufficient_chain(config));
        let stages = needs.max().unwrap_or(SHORTEST_CHAIN);
        sized().insert(key, stages);
        stages
    }
}

/// The shortest chain with which the pulse is long enough in this corner: in the cells of a library, a tenth longer than needed.
fn sufficient_chain(config: &SensorConfig) -> usize {
    let silicon = Silicon::new(config);
    let is_of_file = silicon.cell_library.from_file().is_some();
    let mut stages = SHORTEST_CHAIN;
    loop {
        let pulse = ResetPulse::measure(
            &SensorConfig {
                reset_stages: stages,
                ..config.clone()
            },
            &silicon,
        );
        // The built-in cells have the length that was chosen with them.
        let spare = if is_of_file {
            pulse.need.as_fs() / 10
        } else {
            0
        };
        let needed = pulse.need.as_fs() + spare;
        let missing = needed - pulse.width.as_fs();
        let missing = missing.max(ROUNDING.as_fs() - pulse.strobe_lead.as_fs());
        if missing <= 0 || stages >= LONGEST_CHAIN {
            return stages;
        }
        // A buffer's share of the pulse tells how many are missing; fewer are tried first, because loads differ.
        let share = pulse.width.as_fs().max(1) / stages as i64;
        let more = missing / share.max(1) / 2;
        stages = (stages + (more as usize).max(1)).min(LONGEST_CHAIN);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::PCounter;
    use crate::chip::timing::ChipTiming;

    #[test]
    fn built_in_cells_need_no_longer_chain() {
        for p_counter in PCounter::ALL {
            let config = p_counter.sensor();
            assert_eq!(config.reset_buffers(), SHORTEST_CHAIN, "{p_counter:?}");
        }
    }

    /// In cells whose removal time grows more than a buffer's delay.
    #[test]
    fn a_library_gets_the_chain_that_it_needs() {
        let text = include_str!("../../../../../vectors/liberty/example.lib");
        let slow = text.replace(
            "timing_type : removal_rising;\n      rise_constraint (scalar) { values (\"0.015\"); }",
            "timing_type : removal_rising;\n      rise_constraint (scalar) { values (\"0.315\"); }",
        );
        assert_ne!(slow, text);
        let folder = tempfile::tempdir().unwrap();
        let liberty = folder.path().join("slow.lib");
        std::fs::write(&liberty, slow).unwrap();
        for p_counter in PCounter::ALL {
            let config = SensorConfig {
                liberty: liberty.clone(),
                ..p_counter.sensor()
            };
            config.check().unwrap();
            let counter = |reset_stages| {
                ChipTiming::new(&SensorConfig {
                    reset_stages,
                    ..config.clone()
                })
                .counter
            };
            let stages = config.reset_buffers();
            let (sized, shorter) = (counter(0), counter(stages - 1));
            if p_counter.row().has_memory {
                assert!(stages > SHORTEST_CHAIN, "{p_counter:?}: {stages}");
                assert!(sized.reset_width >= sized.reset_need, "{p_counter:?}");
                let tenth = shorter.reset_need.as_fs() / 10;
                assert!(
                    shorter.reset_width.as_fs() < shorter.reset_need.as_fs() + tenth,
                    "{p_counter:?}"
                );
            }
        }
    }
}
