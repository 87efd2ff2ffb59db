//! Testbench of the ripple hazard: what the METDC captures when the strobe meets the shift register's clock edge
//! (thesis 4.6, Fig. 56).
//!
//! ```text
//!   CLK     ▔▔╲▁▁▁▁▁▁▁▁▁▁▁▁▁╱▔▔▔▔▔▔▔▔▔        T/2 between the edges
//!   SHIFT   ══════════════════╳══════         clk-to-Q after the rise: every bit moves on by one stage
//!   STROBE  ▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁╱▔▔▔▔▔▔         a ripple after the fall
//!             384 MHz: before │ 438 MHz: after, everything one bin early │ between: each HIT sees old or new
//! ```
//!
//! Two macropixels share every pin: `mp_r0_c0` with the library's delays, in which all bits of SHIFT change in one
//! instant, and `mp_r0_c1` with mismatch, in which they don't. A laser cycle has one photon, so that a HIT register
//! without a 1 has lost it, and one with two has doubled it.
//!
//! The period at which the histogram moves is this netlist's own (twice strobe less clk-to-Q); it lies a little above
//! twice the ripple, since the strobe's multiplexer and buffer take more time than the shift register's flip-flop.

use std::path::Path;
use std::sync::Arc;

use crate::analysis::{MacropixelTiming, shortest_period};
use crate::chip::{
    CellLibrary, Exposure, Limits, Probe, Probes, SensorConfig, Silicon, array, probes,
};
use crate::engine::GateSimulation;
use crate::files::InputError;
use crate::kernel::{CheckReport, Policy, Recorder};
use crate::logic::Logic;
use crate::netlist::{CheckKind, Corner, Mismatch, NetId, Netlist, ScopeId, Timing, varied};
use crate::photon::SpadEvent;
use crate::report::Checks;
use crate::testbenches::Testbench;
use crate::testbenches::rig::{beside, record_exposure};
use crate::testbenches::text::{in_a_row, number_text};
use crate::units::{Frequency, Time};
use crate::waves::{Entry, Layout, SignalGroup};

/// Start value of both macropixels.
const START: u16 = 20;
/// CLK periods between two STOP edges.
const STOP_PERIODS: u32 = 32;
/// Mismatch of the second macropixel.
const MISMATCH: Mismatch = Mismatch {
    sigma: 0.05,
    seed: 1,
};

pub(super) const TESTBENCH: Testbench = Testbench {
    name: "tb_ripple_hazard",
    about: "The strobe meets the shift register's clock edge: photons lost, doubled, unknown, and moved by one bin",
    run,
    given: None,
};

fn run(waves: &Path, checks: &mut Checks) -> Result<(), InputError> {
    far_from_the_crossing(checks);
    crossing(checks);
    at_the_crossing(waves, checks)?;
    Ok(())
}

/// Two macropixels in a row.
fn config() -> SensorConfig {
    SensorConfig {
        rows: 1,
        cols: 2,
        ..SensorConfig::default()
    }
}

/// Photons of a bin, different from those of its neighbours.
fn photons(bin: usize) -> u16 {
    1 + (5 * bin as u16) % 7
}

/// The bin of every laser cycle's photon.
fn bins() -> Vec<usize> {
    let repeated = |bin| std::iter::repeat_n(bin, photons(bin) as usize);
    (0..config().bins).flat_map(repeated).collect()
}

/// What one macropixel made of it.
struct CapturedHits {
    /// Counts; none where a bit is unknown.
    counts: Vec<Option<u64>>,
    /// Laser cycles by how many HITs the photon left: none, one, two, and cycles with an unknown HIT.
    hits: [usize; 4],
}

/// Both macropixels, and what the timing checks say.
struct Outcome {
    pixels: Vec<CapturedHits>,
    /// Paths of the HIT flip-flops of both.
    hit_cells: [Vec<String>; 2],
    report: CheckReport,
}

impl Outcome {
    /// Setup and hold violations in the HIT flip-flops of one macropixel.
    fn violations(&self, pixel: usize) -> usize {
        let hits = &self.hit_cells[pixel];
        let of_hits = self
            .report
            .violations
            .iter()
            .filter(|v| hits.contains(&v.cell));
        of_hits.filter(|v| v.kind.concerns_data()).count()
    }
}

/// The library's delays, and in the second macropixel its mismatch.
fn delays(netlist: &Netlist) -> Timing {
    let nominal = Timing::nominal(netlist, CellLibrary::BUILT_IN.cells(), Corner::Typ);
    let mismatched = varied(netlist, &nominal, 1.0, Some(MISMATCH));
    let second = format!(".{}.", array::pixel_name(0, 1));
    let mut timing = nominal;
    for cell in netlist.cells_below(ScopeId::TOP) {
        if netlist.cell_path(cell).contains(&second) {
            timing.set(cell, *mismatched.cell_delays(cell));
        }
    }
    timing
}

/// Exposes both macropixels at this CLK period. `shown` has the path of a waveform, and for its view which HITs see SHIFT before it
/// changes.
fn expose(
    period: Time,
    policy: Policy,
    shown: Option<(&Path, &[bool])>,
) -> Result<Outcome, InputError> {
    let bins = bins();
    let exposure = Exposure {
        clock: Frequency::from_period(period).expect("a period of a few nanoseconds"),
        stop_phase: Time::ZERO,
        stop_periods: STOP_PERIODS,
        laser_cycles: bins.len() as u32,
    };
    let config = SensorConfig {
        clk_hz: exposure.clock.as_hz(),
        ..config()
    };
    // Half a period before the rising edge that takes it at a slow clock.
    let first = START as i64 - config.bins as i64;
    let photon = |(cycle, &bin): (usize, &usize)| {
        let edge = cycle as i64 * STOP_PERIODS as i64 + first + bin as i64;
        SpadEvent {
            time: exposure.rising(edge) - Time::from_fs(period.as_fs() / 2),
            spad: bin as u8,
        }
    };
    let pulses: Vec<SpadEvent> = bins.iter().enumerate().map(photon).collect();
    let lists = [&pulses[..], &pulses[..]];
    let gate = GateSimulation::new(&config, &exposure, (0, 0), (1, 2), &[START; 2], &lists);
    let timing = delays(gate.netlist());
    let mut gate = gate.with_timing(&timing);
    let netlist = Arc::clone(gate.netlist());
    let probes = gate.probes().to_vec();
    let watched = probes.iter().flat_map(|probes| {
        let counts = probes.bins().iter().flatten();
        probes.bus(Probe::Hit).iter().chain(counts).copied()
    });
    let mut recorder = Recorder::new(watched);
    let schedule = gate.schedule();
    let stop = |cycle: i64| schedule.origin + exposure.stop(cycle);
    let mut found = gate.timing_checks(policy);
    match shown {
        None => gate.run(&mut (&mut recorder, &mut found)),
        Some((waves, sees_old)) => {
            let view = view(&stop, period, sees_old);
            let mut observers = (&mut recorder, &mut found);
            record_exposure(&mut gate, waves, &view, &mut observers)?;
        }
    }
    let captured = |probes: &Probes| {
        let mut hits = [0; 4];
        for cycle in 0..bins.len() as i64 {
            // The register as it stands when the next laser cycle begins.
            let seen = probes
                .bus(Probe::Hit)
                .iter()
                .map(|&net| recorder.value_at(net, stop(cycle + 1)));
            let seen: Vec<Logic> = seen.collect();
            let ones = seen.iter().filter(|&&v| v == Logic::One).count();
            hits[if seen.contains(&Logic::X) {
                3
            } else {
                ones.min(2)
            }] += 1;
        }
        let number = |nets: &Vec<NetId>| recorder.number_at(nets, schedule.end);
        CapturedHits {
            counts: probes.bins().iter().map(number).collect(),
            hits,
        }
    };
    Ok(Outcome {
        pixels: probes.iter().map(captured).collect(),
        hit_cells: [0, 1].map(|pixel| {
            let cells = probes[pixel].hit_cells(&netlist).into_iter();
            cells.map(|cell| netlist.cell_path(cell)).collect()
        }),
        report: found.report(&netlist),
    })
}

/// Without a waveform.
fn outcome(period: Time, policy: Policy) -> Outcome {
    expose(period, policy, None).expect("no file is written")
}

/// What the right capture counts, and what one that is a period late does.
fn expected(is_late: bool) -> Vec<Option<u64>> {
    let bins = config().bins;
    let bin_photons = |bin: usize| if bin < bins { photons(bin) as u64 } else { 0 };
    (0..bins)
        .map(|bin| Some(bin_photons(bin + is_late as usize)))
        .collect()
}

fn counts_text(counts: &[Option<u64>]) -> String {
    in_a_row(counts.iter().copied().map(number_text))
}

/// Right at 384 MHz, and moved by exactly one bin at 438 MHz: no check is broken in either.
fn far_from_the_crossing(checks: &mut Checks) {
    for (mhz, is_late) in [(384.0, false), (438.0, true)] {
        let period = Time::from_s(1e-6 / mhz);
        let found = outcome(period, Policy::XOnViolation);
        for (pixel, captured) in found.pixels.iter().enumerate() {
            checks.equal(
                format!("{mhz} MHz, {}: counts", array::pixel_name(0, pixel)),
                counts_text(&expected(is_late)),
                counts_text(&captured.counts),
            );
        }
        checks.equal(format!("{mhz} MHz: violations"), 0, found.report.violated());
    }
}

/// The shortest period with the right histogram, by simulation, against static timing.
fn crossing(checks: &mut Checks) {
    let silicon = Silicon::nominal(Corner::Typ);
    let paths = MacropixelTiming::analyse(&config(), &silicon, Limits::Ignored, (0, 0));
    let counts = |period| {
        outcome(period, Policy::ReportOnly)
            .pixels
            .swap_remove(0)
            .counts
    };
    let slow = Time::from_ps(2_604);
    let found = shortest_period(slow, |period| counts(period) == expected(false));
    let found = found.unwrap_or(slow);
    let whole = Time::from_ps(paths.strobe_period().as_fs() / 1_000 + 1);
    checks.time(
        "shortest period with the right histogram, to 1 ps",
        whole,
        found,
    );
    checks.equal(
        "1 ps below it: counts, all moved by one bin",
        counts_text(&expected(true)),
        counts_text(&counts(found - Time::from_ps(1))),
    );
    let in_band = outcome(found + Time::from_ps(1), Policy::ReportOnly);
    checks.add_verdict(
        "1 ps above it: hold violations that an ideal flip-flop hides",
        "some",
        in_band.violations(0),
        in_band.violations(0) > 0,
    );
}

/// Which HITs of the second macropixel see SHIFT before it changes, at a period between them.
fn hits_between() -> (Time, Vec<bool>) {
    let silicon = Silicon {
        mismatch: Some(MISMATCH),
        ..Silicon::nominal(Corner::Typ)
    };
    let paths = MacropixelTiming::analyse(&config(), &silicon, Limits::Ignored, (0, 1));
    let hit_cells = paths.probes.hit_cells(&paths.netlist);
    let strobe_after_shift = |bin: usize| {
        let of_hit = paths.hits.iter().filter(|r| r.kind == CheckKind::Hold);
        let mut of_hit = of_hit.filter(|r| r.cell == hit_cells[bin]);
        of_hit.next().expect("every bin has its HIT").need
    };
    let needs: Vec<Time> = (0..config().bins).map(strobe_after_shift).collect();
    let mut sorted = needs.clone();
    sorted.sort_unstable();
    let half = sorted[sorted.len() / 2] + Time::from_fs(1);
    (half * 2, needs.iter().map(|&need| need < half).collect())
}

/// At the crossing itself: with ideal flip-flops, and with flip-flops that go unknown.
fn at_the_crossing(waves: &Path, checks: &mut Checks) -> Result<(), InputError> {
    let (period, sees_old) = hits_between();
    let bins = bins();
    let found = expose(period, Policy::ReportOnly, Some((waves, &sees_old)))?;
    let predicted: Vec<Option<u64>> = expected(false)
        .iter()
        .zip(expected(true))
        .zip(&sees_old)
        .map(|((&old, new), &is_old)| if is_old { old } else { new })
        .collect();
    checks.equal(
        format!("{period}, mp_r0_c1: counts, by which HIT sees the old SHIFT"),
        counts_text(&predicted),
        counts_text(&found.pixels[1].counts),
    );
    // A photon of bin b is in HIT b before the change and in HIT b − 1 after it.
    let left = |&bin: &usize| sees_old[bin] as usize + (bin > 0 && !sees_old[bin - 1]) as usize;
    let with = |hits: usize| bins.iter().filter(|bin| left(bin) == hits).count();
    for (hits, what) in [(0, "lost"), (2, "doubled")] {
        let (expected, found) = (with(hits), found.pixels[1].hits[hits]);
        let what = format!("{period}, mp_r0_c1: photons {what}, of {}", bins.len());
        checks.add_verdict(what, expected, found, expected == found && found > 0);
    }
    let violated = found.violations(1);
    checks.add_verdict(
        format!("{period}, mp_r0_c1: HIT flip-flops that broke setup or hold"),
        "one or two a photon",
        violated,
        (bins.len()..=2 * bins.len()).contains(&violated),
    );

    let with_x = beside(waves, "tb_ripple_hazard_x");
    let found = expose(period, Policy::XOnViolation, Some((&with_x, &sees_old)))?;
    let captured = &found.pixels[1];
    checks.equal(
        format!("{period}, mp_r0_c1, checks x: laser cycles with an unknown HIT"),
        bins.len(),
        captured.hits[3],
    );
    checks.equal(
        format!("{period}, mp_r0_c1, checks x: counts"),
        counts_text(&vec![None; config().bins]),
        counts_text(&captured.counts),
    );
    Ok(())
}

/// The strobe of the first doubled photon, the marker on it, with the first lost one's bins beside it.
fn view(stop: &dyn Fn(i64) -> Time, period: Time, sees_old: &[bool]) -> Layout {
    let doubled = (1..sees_old.len()).find(|&bin| sees_old[bin] && !sees_old[bin - 1]);
    let lost = (1..sees_old.len()).find(|&bin| !sees_old[bin] && sees_old[bin - 1]);
    let (doubled, lost) = (doubled.unwrap_or(1), lost.unwrap_or(1));
    let cycle = bins().iter().position(|&bin| bin == doubled).unwrap_or(0) as i64;
    // The falling edge that is counted last, and the half period that the strobe takes.
    let strobe = stop(cycle) + period * (START as i64 + 1) + Time::from_fs(period.as_fs() / 2);
    let mut groups = vec![SignalGroup::new(
        "Global signals",
        ["CLK", "STOP"].map(Entry::binary),
    )];
    for (pixel, title) in ["library's delays", "mismatch"].into_iter().enumerate() {
        let pixel = array::pixel_name(0, pixel);
        let signals = [
            Entry::decimal(Probe::CounterOut.path(&pixel)),
            Entry::binary(Probe::LocalStop.path(&pixel)),
            Entry::binary(Probe::Strobe.path(&pixel)),
            Entry::binary(Probe::Shift.path(&pixel)),
            Entry::binary(Probe::Hit.path(&pixel)),
        ];
        let bins = [doubled, doubled - 1, lost, lost - 1];
        let mut bins = bins.to_vec();
        bins.sort_unstable();
        bins.dedup();
        let bins = bins
            .iter()
            .map(|&bin| Entry::decimal(probes::bin_path(&pixel, bin)));
        let title = format!("{pixel}: {title} (Fig. 56)");
        groups.push(SignalGroup::new(title, signals.into_iter().chain(bins)));
    }
    Layout::new(groups, (strobe - period, strobe + period), strobe)
}
