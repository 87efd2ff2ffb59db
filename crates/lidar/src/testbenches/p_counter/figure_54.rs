//! The sequence of Fig. 54: two laser cycles, one in which the counter is disabled and loaded again, two more, and then none.

use std::path::Path;

use super::{BEFORE, Bench, HOLD_PERIODS, TO_LOAD};
use crate::chip::{AfterBorrow, CellLibrary, Exposure, Probe, p_counter};
use crate::engine::waveform::write_waves;
use crate::files::InputError;
use crate::kernel::{Observer, Recorder};
use crate::logic::Logic;
use crate::netlist::{CellKind, NetId, Netlist};
use crate::report::Checks;
use crate::testbenches::rig;
use crate::testbenches::text::{in_a_row, number_text};
use crate::units::Time;
use crate::waves::{Entry, Layout, SignalGroup};

/// Counts changes to X.
#[derive(Default)]
struct Unknowns(usize);

impl Observer for Unknowns {
    fn change(&mut self, _: Time, _: NetId, value: Logic) {
        self.0 += (value == Logic::X) as usize;
    }
}

/// Cycles 0 and 1 count from the first start value, cycle 2 is disabled and loads the second, cycles 3 and 4 count from it, and then
/// STOP stays away.
pub(super) fn run_sequence(
    bench: &Bench,
    waves: &Path,
    checks: &mut Checks,
) -> Result<(), InputError> {
    let &Bench {
        ref timing,
        origin,
        stop_periods,
        starts: [first_start, second_start],
        ..
    } = bench;
    let exposure = Exposure::new(&bench.config, stop_periods as u32, 5);
    let stop = |cycle: i64| origin + exposure.stop(cycle);
    let falling = |cycle: i64, k: i64| origin + exposure.falling(cycle * stop_periods + k);
    let round = (bench.config.step_periods as i64) << (bench.config.counter_bits + 1);
    let hold_periods = round + HOLD_PERIODS;
    let end = stop(4) + exposure.clock.periods(stop_periods + hold_periods);
    let waits = bench.config.after_borrow == AfterBorrow::Hold;

    let mut drives = bench.power_up();
    let loads = [
        (
            first_start,
            bench.load(&mut drives, bench.reset_end + TO_LOAD, first_start),
        ),
        (
            second_start,
            bench.load(&mut drives, stop(2) + Time::from_ns(8), second_start),
        ),
    ];
    for cycle in 0..5 {
        drives.pulse(bench.stop, stop(cycle), origin + exposure.stop_fall(cycle));
    }
    for (cycle, enabled) in [(0, true), (2, false), (3, true)] {
        drives.set(stop(cycle), bench.enable, enabled);
    }
    // CLK runs from the release of the reset on.
    let half_periods = 2 * (5 * stop_periods + hold_periods);
    bench.drive_clk(&mut drives, &exposure, (-BEFORE, half_periods));

    let rig = &bench.rig;
    let (mut kernel, mut stimulus) = (rig.kernel(), drives.sorted());
    let mut recorder = Recorder::new(rig.nets());
    let mut unknowns = Unknowns::default();
    let mut unknown_at_release = 0;
    let view = view(&rig.netlist, stop(0), stop(5));
    write_waves(waves, &rig.netlist, &view, |waves| {
        let mut observers = (&mut recorder, &mut *waves);
        rig::run(&mut kernel, &mut stimulus, bench.reset_end, &mut observers);
        let is_unknown = |&net: &NetId| kernel.value(net) == Logic::X;
        unknown_at_release = rig.nets().filter(is_unknown).count();
        let mut observers = ((&mut recorder, &mut unknowns), waves);
        rig::run(&mut kernel, &mut stimulus, end, &mut observers);
        end
    })?;

    checks.equal(
        "unknown nets when RESETB is released",
        0,
        unknown_at_release,
    );
    checks.equal("changes to X after that", 0, unknowns.0);
    let corner = bench.config.corner;
    let flop = |pin, to| {
        let cells = CellLibrary::BUILT_IN.cells();
        let delay = cells.delay(CellKind::Dffr, pin, to, corner);
        Time::from_fs((delay.as_fs() as f64 * bench.factor).round() as i64)
    };
    let clk_to_q = flop(1, Logic::One);
    for (value, rise) in loads {
        let Some([memory, counter_out]) = &bench.inner else {
            continue;
        };
        let after = rise + clk_to_q;
        let found = (
            recorder.number_at(memory, after - Time::from_fs(1)),
            recorder.number_at(memory, after),
        );
        let is_new = found.0 != found.1 && found.1 == Some(value);
        let what = format!("MEMORY, clk-to-Q after MEMORY_LOAD rises with {value}");
        checks.add_verdict(what, value, number_text(found.1), is_new);
        let what = format!("COUNTER_OUT follows it to {value} without COUNTER_CLK");
        let found = recorder.number_at(counter_out, after + timing.stop_to_reset);
        checks.equal(what, number_text(Some(value)), number_text(found));
    }
    let local_stops = recorder.rising_edges(bench.local_stop);
    let falls = recorder.falling_edges(bench.local_stop);
    let disabled = |t: &&Time| (stop(2)..stop(3)).contains(*t) || **t < stop(0);
    let while_disabled = local_stops.iter().filter(disabled).count();
    checks.equal("LOCAL_STOP rises while disabled", 0, while_disabled);
    let clocked = recorder.rising_edges(bench.counter_clk);
    let found = clocked.iter().filter(disabled).count();
    checks.equal("COUNTER_CLK rises while disabled", 0, found);

    let reset_to_q = flop(2, Logic::Zero);
    let rises = recorder.rising_edges(bench.counter_reset);
    let releases = recorder.falling_edges(bench.counter_reset);
    for (cycle, start) in [
        (0, first_start),
        (1, first_start),
        (3, second_start),
        (4, second_start),
    ] {
        let next = if cycle == 4 { end } else { stop(cycle + 1) };
        let within = |t: &&Time| (stop(cycle)..next).contains(*t);
        let relative = |t: &Time| *t - stop(cycle);
        let in_reset = stop(cycle) + timing.stop_to_reset_release - Time::from_fs(1);
        if let Some([_, counter_out]) = &bench.inner {
            let found = recorder.number_at(counter_out, in_reset);
            let what = format!("cycle {cycle}: COUNTER_OUT when COUNTER_RESET falls");
            checks.equal(what, number_text(Some(start)), number_text(found));

            // Every count is read when its ripple is over: before the next edge, the last one after the longest ripple. Where that is longer
            // than a CLK period, the roll-over is not over when one more edge comes.
            let mut model = p_counter::PCounterModel::new(&bench.config, start as u16);
            let counts = std::iter::from_fn(|| {
                (!model.local_stop()).then(|| {
                    model.clock();
                    model.counter_out()
                })
            });
            let mut expected: Vec<_> = counts.collect();
            if timing.ripple() > exposure.clock.period() {
                expected.pop();
            }
            let edges = clocked.iter().filter(within).filter(|t| **t > in_reset);
            let edges: Vec<Time> = edges.copied().collect();
            let settled = edges.iter().skip(1).map(|next| *next - Time::from_fs(1));
            let settled = settled.chain(edges.last().map(|last| *last + timing.ripple()));
            let settled = settled.take(expected.len());
            let found = settled.map(|time| recorder.number_at(counter_out, time));
            checks.equal(
                format!("cycle {cycle}: COUNTER_OUT after each rise of COUNTER_CLK"),
                in_a_row(expected),
                in_a_row(found.map(number_text)),
            );
        }
        let mut found: Vec<Time> = local_stops.iter().filter(within).map(relative).collect();
        let first = bench.first_edge(start);
        let once = usize::from(first.is_some());
        if !waits {
            found.truncate(once);
        }
        checks.equal(
            format!("cycle {cycle}: LOCAL_STOP rises"),
            once,
            found.len(),
        );
        let Some(first) = first else { continue };
        let fall = bench.first_fall + first;
        let edge = falling(cycle, fall);
        let expected = edge + timing.ripple() - stop(cycle);
        let what = format!("cycle {cycle}: LOCAL_STOP rises after STOP, by CLK fall {fall}");
        bench.takes(what, checks, edge - stop(cycle), expected, &found);
        if cycle != 4 && waits {
            let expected = next + timing.stop_to_reset + reset_to_q;
            let after_rise = |t: &&Time| **t > edge;
            let found = falls.iter().find(after_rise).copied().unwrap_or(Time::ZERO);
            let what = format!("cycle {cycle}: LOCAL_STOP falls after the next STOP");
            match bench.inner {
                Some(_) => checks.time(what, expected - next, found - next),
                None => bench.takes(
                    what,
                    checks,
                    Time::ZERO,
                    timing.stop_to_reset_release,
                    &[found - next],
                ),
            }
        }
        let found: Vec<Time> = releases
            .iter()
            .filter(within)
            .take(1)
            .map(relative)
            .collect();
        let what = format!("cycle {cycle}: COUNTER_RESET falls after STOP");
        checks.times(what, timing.stop_to_reset_release, &found);
        // Before cycles 0 and 3 the reset is held from the disabled time on.
        if cycle == 1 || cycle == 4 {
            let found: Vec<Time> = rises.iter().filter(within).map(relative).collect();
            let what = format!("cycle {cycle}: COUNTER_RESET rises after STOP");
            checks.times(what, timing.stop_to_reset, &found);
        }
    }
    if !waits {
        return Ok(());
    }
    let last_rise = local_stops.last().copied().unwrap_or(end);
    let held = recorder.value_at(bench.local_stop, end) == Logic::One;
    let clocked_since = clocked.iter().filter(|&&t| t > last_rise).count();
    let fallen_since = falls.iter().filter(|&&t| t > last_rise).count();
    let quiet = recorder.falling_edges(bench.clk);
    let quiet = quiet.iter().filter(|&&t| t > last_rise).count();
    checks.add_verdict(
        "CLK periods without STOP for which LOCAL_STOP stays high",
        format!("at least {hold_periods}"),
        quiet,
        held && fallen_since == 0 && quiet as i64 >= hold_periods,
    );
    checks.equal("COUNTER_CLK rises in that time", 0, clocked_since);
    Ok(())
}

fn view(netlist: &Netlist, first_stop: Time, last: Time) -> Layout {
    let binary = |probe: Probe| Entry::binary(probe.path(""));
    let decimal = |probe: Probe| Entry::decimal(probe.path(""));
    let inputs = [
        Entry::binary("RESETB"),
        binary(Probe::Enable),
        binary(Probe::Clk),
        binary(Probe::Stop),
        decimal(Probe::CounterInit),
        binary(Probe::MemoryLoad),
    ];
    let counter = [
        decimal(Probe::Memory),
        binary(Probe::CounterReset),
        binary(Probe::CounterClk),
        decimal(Probe::CounterOut),
        binary(Probe::LocalStop),
    ];
    let is_there = |entry: &Entry| netlist.signal(&entry.path).is_some();
    let groups = vec![
        SignalGroup::new("Global signals", inputs),
        SignalGroup::new("P-counter (Fig. 54)", counter.into_iter().filter(is_there)),
    ];
    Layout::new(groups, (Time::ZERO, last), first_stop)
}
