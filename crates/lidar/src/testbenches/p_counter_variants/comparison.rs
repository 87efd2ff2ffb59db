//! Every variant of the P-counter in one table: transistors, delays, glitches and the shortest CLK period.

use crate::analysis::{MacropixelTiming, gate_works, ripple, shortest_period};
use crate::chip::{
    Limits, PCounter, Probe, Probes, SensorConfig, Silicon, macropixel, p_counter, p_counter_timing,
};
use crate::kernel::Recorder;
use crate::netlist::{CellKind, Corner, Edge, NetId, Netlist, StaticTiming};
use crate::report::{Checks, Grid};
use crate::testbenches::rig::Rig;
use crate::units::Time;

/// Longest CLK period that is tried.
const SLOW: Time = Time::from_ns(20);

/// A sensor of one macropixel with this P-counter.
pub(super) fn sensor(p_counter: PCounter) -> SensorConfig {
    SensorConfig {
        rows: 1,
        cols: 1,
        ..p_counter.sensor()
    }
}

/// Delays as the library has them.
const TYPICAL: Silicon = Silicon::nominal(Corner::Typ);

/// Compares the variants.
pub(super) fn compare(checks: &mut Checks) -> Grid {
    let mut grid = Grid::headed(
        "P-counter | T/stage | T, with timing | share | by area | LOCAL_STOP static | event \
        | settled static | event | changes/count | glitches/count | LOCAL_STOP's \
        | CLK period static | event",
    );
    let custom = CellKind::Dffr;
    checks.equal(
        "ripple: transistors a stage, 2 flip-flops + 4 (thesis 4.5)",
        u64::from(2 * custom.transistors() + 4),
        PCounter::Ripple.stage_transistors(),
    );
    checks.equal(
        "set_reset against ripple: a 6-transistor gate instead of 4 (4.4.4), and the larger flip-flop",
        u64::from(6 - 4 + CellKind::Dffsr.transistors() - custom.transistors()),
        PCounter::SetReset.stage_transistors() - PCounter::Ripple.stage_transistors(),
    );
    checks.equal(
        "set/reset flip-flop's layout over the custom one's (Fig. 52)",
        3,
        CellKind::Dffsr.area() / custom.area(),
    );
    let rows = PCounter::ALL.map(Row::measure);
    for (p_counter, row) in PCounter::ALL.into_iter().zip(&rows) {
        row.check(p_counter.name(), checks);
        grid.push(row.cells(p_counter.name()));
    }
    let variant_row = |p_counter: PCounter| &rows[p_counter as usize];
    let ripple = variant_row(PCounter::Ripple);
    let synchronous = variant_row(PCounter::Synchronous);
    let segmented = variant_row(PCounter::Segmented);
    checks.add_verdict(
        "a synchronous counter avoids the ripple's limit (4.6): shortest CLK period",
        format!("below {}, ripple's", period_text(ripple.period.0)),
        period_text(synchronous.period.0),
        synchronous.period.0 < ripple.period.0,
    );
    let nine_stages = ripple.local_stop.1 - synchronous.local_stop.1;
    checks.time(
        "segmented: LOCAL_STOP comes three stages after a synchronous counter's, ripple's nine",
        synchronous.local_stop.1 + Time::from_fs(nine_stages.as_fs() / 3),
        segmented.local_stop.1,
    );
    checks.add_verdict(
        "segmented: shortest CLK period",
        format!("below {}, ripple's", period_text(ripple.period.1)),
        period_text(segmented.period.1),
        segmented.period.1 < ripple.period.1,
    );
    checks.add_verdict(
        "segmented: transistors, with timing",
        format!("below {}, a synchronous counter's", synchronous.transistors),
        segmented.transistors,
        segmented.transistors < synchronous.transistors,
    );
    grid
}

/// One variant's figures; pairs are by static timing and as simulated.
struct Row {
    stage: u64,
    transistors: u64,
    share: f64,
    area_share: f64,
    local_stop: (Time, Time),
    settled: (Time, Time),
    activity: Activity,
    period: (Option<Time>, Option<Time>),
}

impl Row {
    fn measure(p_counter: PCounter) -> Self {
        let config = sensor(p_counter);
        let blocks = [
            p_counter::circuit(&config),
            p_counter_timing::circuit(config.after_borrow, config.reset_buffers()),
        ];
        let macropixel = macropixel::circuit(&config);
        let transistors: u64 = blocks.iter().map(|b| b.transistors()).sum();
        let area: u64 = blocks.iter().map(|b| b.area()).sum();
        let netlist = Netlist::elaborate(&blocks[0]);
        let timing = TYPICAL.timing(&netlist);
        let rig = Rig { netlist, timing };
        let clk = Probes::of_block(&rig.netlist).net(Probe::CounterClk);
        let paths = StaticTiming::new(&rig.netlist, &rig.timing);
        let arrivals = paths.arrivals(&[(clk, Edge::Rise)], &[]);
        let arrivals = arrivals.expect("a P-counter has no loop");
        let windows = rig.nets().filter_map(|net| arrivals.window(net));
        let settled = windows.map(|window| window.1);
        let activity = Activity::simulate(&config, &rig);
        let by_paths = MacropixelTiming::analyse(&config, &TYPICAL, Limits::Ignored, (0, 0));
        let ripple = ripple(&config, &TYPICAL);
        let by_gates = gate_works(&config, &TYPICAL, Limits::Ignored, 0);
        Row {
            stage: p_counter.stage_transistors(),
            transistors,
            share: transistors as f64 / macropixel.transistors() as f64,
            area_share: area as f64 / macropixel.area() as f64,
            local_stop: (ripple.longest_path, ripple.latest),
            settled: (settled.max().unwrap_or(Time::ZERO), activity.settled),
            activity,
            period: (
                shortest_period(SLOW, |p| by_paths.works(p, Time::ZERO)),
                shortest_period(SLOW, |p| by_gates((p, Time::ZERO))),
            ),
        }
    }

    fn cells(&self, name: &str) -> Vec<String> {
        let percent = |share: f64| format!("{:.1} %", share * 100.0);
        let ps = |time: Time| format!("{:.0} ps", time.as_fs() as f64 * 1e-3);
        let per_count = |n: usize| format!("{:.2}", n as f64 / self.activity.counts as f64);
        vec![
            name.to_owned(),
            self.stage.to_string(),
            self.transistors.to_string(),
            percent(self.share),
            percent(self.area_share),
            ps(self.local_stop.0),
            ps(self.local_stop.1),
            ps(self.settled.0),
            ps(self.settled.1),
            per_count(self.activity.changes),
            per_count(self.activity.glitches),
            self.activity.on_local_stop.to_string(),
            period_text(self.period.0),
            period_text(self.period.1),
        ]
    }

    fn check(&self, name: &str, checks: &mut Checks) {
        let (by_paths, simulated) = self.local_stop;
        checks.time(
            format!("{name}: COUNTER_CLK to LOCAL_STOP"),
            by_paths,
            simulated,
        );
        let (by_paths, simulated) = self.settled;
        checks.add_verdict(
            format!("{name}: everything settled after a count, all counts"),
            format!("at most {by_paths}, the longest path"),
            simulated,
            simulated <= by_paths && simulated > Time::ZERO,
        );
        let what = format!(
            "{name}: glitches on LOCAL_STOP in {} counts",
            self.activity.counts
        );
        checks.equal(what, 0, self.activity.on_local_stop);
        if let Some(on_equal) = self.activity.on_equal {
            checks.add_verdict(
                format!(
                    "{name}: changes of EQUAL that are no match, which its flip-flop must keep out"
                ),
                "some",
                on_equal,
                on_equal > 0,
            );
        }
        let (by_paths, simulated) = self.period;
        checks.add_verdict(
            format!("{name}: shortest CLK period of the gates"),
            format!("at most {}, by static timing", period_text(by_paths)),
            period_text(simulated),
            by_paths.is_some() && simulated.is_some() && simulated <= by_paths,
        );
    }
}

fn period_text(period: Option<Time>) -> String {
    period.map_or("-".to_owned(), |p| p.to_string())
}

/// What the nets inside a P-counter do while it counts through its whole range.
struct Activity {
    counts: usize,
    /// Changes of all nets but the pins.
    changes: usize,
    /// Changes beyond the one that a net which ends elsewhere needs.
    glitches: usize,
    on_local_stop: usize,
    /// On the comparator's output, where there is one.
    on_equal: Option<usize>,
    /// Latest change after its COUNTER_CLK edge.
    settled: Time,
}

impl Activity {
    /// Counts slowly from start value 0, which a rippling up counter passes through at every power of two, until the
    /// count has come round.
    fn simulate(config: &SensorConfig, rig: &Rig) -> Self {
        const GAP: Time = Time::from_ns(10);
        let counts = usize::from(config.largest_start()) + 3;
        let inputs = rig.netlist.inputs();
        let mut drives = rig.power_up();
        for (name, rise, fall) in [
            ("MEMORY_RESET", 0, 1),
            ("COUNTER_RESET", 0, 5),
            ("MEMORY_LOAD", 3, 4),
        ] {
            drives.pulse(rig.net(name), GAP * rise, GAP * fall);
        }
        let clk = rig.net("COUNTER_CLK");
        let edge = |count: usize| GAP * (count as i64 + 10);
        for count in 0..counts {
            drives.pulse(clk, edge(count), edge(count) + Time::from_ns(5));
        }
        let mut recorder = Recorder::new(rig.nets());
        rig.run(drives, edge(counts), &mut recorder);

        let probes = Probes::of_block(&rig.netlist);
        let local_stop = probes.net(Probe::LocalStop);
        let compares = config.p_counter == PCounter::Comparator;
        let equal = compares.then(|| rig.net(config.p_counter.row().nets[0]));
        let mut activity = Activity {
            counts,
            changes: 0,
            glitches: 0,
            on_local_stop: 0,
            on_equal: equal.map(|_| 0),
            settled: Time::ZERO,
        };
        for count in 0..counts {
            let within = edge(count)..edge(count + 1);
            let all = recorder.changes();
            let from = all.partition_point(|c| c.0 < within.start);
            let until = all.partition_point(|c| c.0 < within.end);
            let mut changes = vec![0usize; rig.netlist.net_count()];
            for &(time, net, _) in all[from..until].iter().filter(|c| !inputs.contains(&c.1)) {
                changes[net.index()] += 1;
                activity.settled = activity.settled.max(time - within.start);
            }
            let extra = |net: NetId| changes[net.index()] / 2 * 2;
            activity.changes += changes.iter().sum::<usize>();
            activity.glitches += (0..changes.len())
                .map(|net| extra(NetId::new(net)))
                .sum::<usize>();
            activity.on_local_stop += extra(local_stop);
            if let (Some(on_equal), Some(equal)) = (&mut activity.on_equal, equal) {
                *on_equal += extra(equal);
            }
        }
        activity
    }
}
