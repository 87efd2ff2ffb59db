//! The P-counter without memory in a sensor: it must come round with STOP (thesis 4.4.3).

use crate::chip::{ChipTiming, Exposure, PCounter, Probe};
use crate::engine::GateSimulation;
use crate::kernel::Recorder;
use crate::report::Checks;
use crate::testbenches::text::in_a_row;
use crate::units::Time;

use super::comparison::sensor;

/// The P-counter without memory: STOP every 512 CLK periods, and eight too many.
pub(super) fn coming_round(checks: &mut Checks) {
    const CYCLES: u32 = 5;
    let config = sensor(PCounter::Memoryless);
    let round = u32::from(config.largest_start()) + 1;
    for (stop_periods, starts) in [(round, [5u16, 300]), (round + 8, [5, 300])] {
        let exposure = Exposure::new(&config, stop_periods, CYCLES);
        for start in starts {
            let mut gate =
                GateSimulation::new(&config, &exposure, (0, 0), (1, 1), &[start], &[&[]]);
            let probes = &gate.probes()[0];
            let net = probes.net(Probe::LocalStop);
            let count = probes.bus(Probe::CounterOut).to_vec();
            let mut recorder = Recorder::new(count.iter().copied().chain([net]));
            gate.run(&mut recorder);
            let origin = gate.schedule().origin;
            let rises = recorder
                .rising_edges(net)
                .into_iter()
                .filter(|&t| t > origin);
            let ripple = ChipTiming::new(&config).ripple();
            // CLK edge of its own laser cycle with which each came.
            let edge = |t: Time| {
                let edge = (0..)
                    .find(|&k| exposure.falling(k) + ripple >= t - origin)
                    .expect("endless");
                edge % i64::from(stop_periods)
            };
            let found: Vec<usize> = rises.map(|t| edge(t) as usize).collect();
            let falls =
                (usize::from(start)..(CYCLES * stop_periods) as usize).step_by(round as usize);
            let expected: Vec<usize> = falls.map(|fall| fall % stop_periods as usize).collect();
            let what = format!(
                "memoryless, STOP every {stop_periods}, start {start}: CLK fall of each LOCAL_STOP"
            );
            checks.equal(what, in_a_row(&expected), in_a_row(&found));
            if stop_periods == round {
                let last = recorder.number_at(&count, gate.schedule().end);
                let what = format!(
                    "memoryless, start {start}: count after the exposure, one step too many"
                );
                checks.equal(what, u64::from(start) - 1, last.unwrap_or(u64::MAX));
            }
        }
    }
}
