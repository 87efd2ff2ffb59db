//! Many laser cycles of a P-counter with one start value: LOCAL_STOP rises at the same time in all of them.
//!
//! A netlist of one's own could count laser cycles, or look at COUNTER_INIT after the load. The contract of the block refuses both
//! (`chip/own_block`); here such a counter would be seen at work.

use super::{BEFORE, Bench, TO_LOAD};
use crate::chip::Exposure;
use crate::kernel::Recorder;
use crate::report::Checks;

/// Laser cycles.
const CYCLES: i64 = 200;

/// Counts from one start value in [`CYCLES`] laser cycles, while COUNTER_INIT shows another code in each: LOCAL_STOP rises at the
/// same time after STOP in all of them.
pub(super) fn count_alike(bench: &Bench, checks: &mut Checks) {
    let &Bench {
        origin,
        stop_periods,
        starts: [_, start],
        ..
    } = bench;
    let Some(first) = bench.first_edge(start) else {
        return;
    };
    let exposure = Exposure::new(&bench.config, stop_periods as u32, CYCLES as u32);
    let fall = bench.first_fall + first;
    let mut drives = bench.power_up();
    bench.load(&mut drives, bench.reset_end + TO_LOAD, start);
    drives.set(origin, bench.enable, true);
    for cycle in 0..CYCLES {
        let stop = origin + exposure.stop(cycle);
        drives.pulse(bench.stop, stop, origin + exposure.stop_fall(cycle));
        // In the middle of a CLK period, every bit now and then.
        let code = (cycle as u16).wrapping_mul(0x9e37) >> 3;
        let time = stop + exposure.clock.half_periods(3);
        drives.number(time, &bench.init, u64::from(code));
    }
    let end = origin + exposure.stop(CYCLES);
    let half_periods = 2 * CYCLES * stop_periods;
    bench.drive_clk(&mut drives, &exposure, (-BEFORE, half_periods));
    let mut recorder = Recorder::new([bench.local_stop]);
    bench.rig.run(drives, end, &mut recorder);

    let rises = recorder.rising_edges(bench.local_stop);
    let mut after = Vec::new();
    for cycle in 0..CYCLES {
        let [from, until] = [cycle, cycle + 1].map(|cycle| origin + exposure.stop(cycle));
        let edge = origin + exposure.falling(cycle * stop_periods + fall);
        let rise = rises.iter().find(|&&rise| (from..until).contains(&rise));
        after.extend(rise.map(|&rise| rise - edge));
    }
    let what = format!("{CYCLES} laser cycles, COUNTER_INIT moving: LOCAL_STOPs");
    checks.equal(what, CYCLES as usize, after.len());
    let same = after.windows(2).all(|pair| pair[0] == pair[1]);
    let found = after.iter().min().zip(after.iter().max());
    let found = found.map_or("none".to_owned(), |(min, max)| format!("{min} to {max}"));
    let what = "LOCAL_STOP after its CLK fall, in all of them";
    checks.add_verdict(what, "one time", found, same && !after.is_empty());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::{OwnBlock, SensorConfig};
    use crate::netlist::CellKind::{And2, Dffr, Inv, Xnor2, Xor2};
    use crate::netlist::ModuleBuilder;

    /// An up counter of four bits with a comparator: its memory may be missing, and LOCAL_STOP may stay away once a ripple counter of
    /// `late` bits has counted it.
    fn sensor(has_memory: bool, late: usize) -> SensorConfig {
        let bits = 4;
        let mut m = ModuleBuilder::new("mine");
        let init = m.input_bus("COUNTER_INIT", bits);
        let [load, memory_reset, clk, reset] = [
            "MEMORY_LOAD",
            "MEMORY_RESET",
            "COUNTER_CLK",
            "COUNTER_RESET",
        ]
        .map(|pin| m.input(pin));
        let local_stop = m.output("LOCAL_STOP");
        let (q, qn) = (m.wire_bus("Q", bits), m.wire_bus("QN", bits));
        let memory = m.wire_bus("MEMORY", bits);
        let mut carry = None;
        let mut same = Vec::new();
        for bit in 0..bits {
            let name = |what: &str| format!("{what}_{bit}");
            let inputs = [init[bit], load, memory_reset];
            let outputs = [Some(memory[bit]), None];
            m.cell(&name("memory"), Dffr, &inputs, &outputs);
            let next = carry.map_or(qn[bit], |carry| m.gate(Xor2, &[q[bit], carry]));
            carry = Some(carry.map_or(q[bit], |carry| m.gate(And2, &[q[bit], carry])));
            m.cell(
                &name("count"),
                Dffr,
                &[next, clk, reset],
                &[q[bit], qn[bit]],
            );
            let start = if has_memory { memory[bit] } else { init[bit] };
            same.push(m.gate(Xnor2, &[q[bit], start]));
        }
        let mut hit = m.tree(And2, &same);
        if late > 0 {
            let (low, high) = (m.wire_bus("LATE_N", late), m.wire_bus("LATE", late));
            let mut clock = local_stop;
            for bit in 0..late {
                let inputs = [low[bit], clock, memory_reset];
                m.cell(
                    &format!("late_{bit}"),
                    Dffr,
                    &inputs,
                    &[high[bit], low[bit]],
                );
                clock = low[bit];
            }
            let all = m.tree(And2, &high);
            let not = m.gate(Inv, &[all]);
            hit = m.gate(And2, &[hit, not]);
        }
        let outputs = [Some(local_stop), None];
        m.cell("stop", Dffr, &[hit, clk, reset], &outputs);
        let text = format!("{has_memory} {late}");
        SensorConfig {
            counter_bits: bits,
            p_counter_block: Some(OwnBlock::from_module(
                "mine.json",
                m.finish().unwrap(),
                &text,
            )),
            ..SensorConfig::default()
        }
    }

    #[test]
    fn hidden_state_shows_within_the_laser_cycles() {
        for (has_memory, late, passes) in [
            (true, 0, true),
            (false, 0, false),
            (true, 1, false),
            (true, 3, false),
            (true, 7, false),
        ] {
            let sensor = sensor(has_memory, late);
            assert_eq!(sensor.check().is_ok(), passes, "the contract");
            let mut checks = Checks::new();
            count_alike(&Bench::new(&sensor), &mut checks);
            assert_eq!(checks.passed(), passes, "{has_memory} {late}: {checks}");
        }
    }
}
