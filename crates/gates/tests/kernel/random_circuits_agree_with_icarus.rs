//! Every value change of every net, at the same femtosecond and to the same value, in our kernel
//! and in Icarus Verilog. Skipped, loudly, where Icarus is absent.
//!
//! ```text
//!   random circuit, delays, drives ─┬─► Kernel ─► VcdWriter ──────► wellen ─┐
//!                                   └─► write_cells, write_modules,         ├─► the same?
//!                                       testbench ─► Icarus ─► wellen ──────┘
//! ```
//!
//! What is compared is the value that a net has at the end of each instant: what happens within
//! one takes no time, and no waveform viewer shows it. The last instant is left out, because
//! `$finish` may come before its changes.
//!
//! Ties are not avoided. Two cases in five live on a coarse grid of times, on which inputs and
//! outputs of a cell change together, pulses are exactly as wide as the delay they meet, and data
//! change with the clock. IEEE 1364 leaves the order of such events to the simulator, but the
//! exported cells wait with `#0` until all of them have happened, which it does define; so no case
//! is discarded. What remains outside are delays of zero: the library has none, and none are drawn.
//!
//! `GDTOF_CASES=10000 cargo test -p femtogate --test kernel icarus -- --nocapture` runs more
//! random circuits than the usual 500 and shows how much was compared.

use std::cell::Cell;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::io::Cursor;
use std::time::Instant;

use femtogate::kernel::{Drive, Kernel, Stimulus};
use femtogate::netlist::{Corner, Netlist, Timing};
use femtogate::sdf::{Sdf, SdfOptions, annotate, write_sdf};
use femtogate::units::Time;
use femtogate::verilog::{write_cells, write_delays, write_modules, write_parametric_cells};
use femtogate::waves::{VcdWriter, WaveSelection};
use proptest::prelude::*;
use proptest::test_runner::{Config, FileFailurePersistence, TestCaseError, TestError, TestRunner};
use rand::{SeedableRng, rngs::StdRng, seq::SliceRandom};

use crate::every_edge::circuit::{self, Case};
use crate::every_edge::waves::{Figures, Waves};
use crate::{cases, icarus, testbench::testbench};

/// Whose waves are compared.
pub const NAMES: [&str; 2] = ["the kernel", "Icarus"];
/// Circuits in one run of Icarus, on average, where there are more than in a usual test.
const BATCH: u32 = 50;
/// Random circuits in a usual test.
const USUAL: u32 = 500;
/// How long the circuits go on after the last drive.
const SETTLING: Time = Time::from_ns(2);

/// What our kernel makes of `drives`, in the selected signals.
fn simulate(
    timing: &Timing,
    netlist: &Netlist,
    drives: Vec<Drive>,
    end: Time,
    selection: &WaveSelection,
) -> Waves {
    let mut writer = VcdWriter::new(Vec::new(), netlist, selection).unwrap();
    let mut kernel = Kernel::new(netlist, timing);
    let mut stimulus = Stimulus::new(drives);
    kernel.run(&mut stimulus, end, &mut writer).unwrap();
    let top = &netlist.scopes()[0].name;
    Waves::read(Cursor::new(writer.finish(end).unwrap()), top)
}

/// `timing` with the delays of an SDF file, in all corners, which holds those of `drawn`.
fn through_sdf(drawn: &Timing, timing: &Timing, netlist: &Netlist, corner: Corner) -> Timing {
    let mut text = Vec::new();
    write_sdf(&mut text, netlist, [drawn; 3], SdfOptions::default()).unwrap();
    let text = String::from_utf8(text).unwrap();
    let sdf = Sdf::parse("case.sdf", &text).unwrap();
    let mut annotated = timing.clone();
    annotate(&mut annotated, netlist, &sdf, corner).unwrap();
    annotated
}

/// One of the cases that Icarus simulates at once: its Verilog, whose modules end in `_{index}`, and our waves until `end`.
struct IcarusCase {
    verilog: String,
    ours: Waves,
    end: Time,
}

fn prepared(case: &Case, index: usize) -> IcarusCase {
    let top = case.circuit();
    let netlist = Netlist::elaborate(&top);
    let drives = case.drives(&netlist);
    let end = drives.last().map_or(Time::ZERO, |d| d.time) + SETTLING;

    let mut verilog = Vec::new();
    let mut parameters = Vec::new();
    let (library, corner) = (case.cell_library(), case.corner());
    // Icarus is given the delays themselves, our kernel those of an SDF file, in some cases.
    let mut timing = case.timing(&netlist);
    let mut ours = timing.clone();
    if let Some(seed) = case.sdf_seed() {
        let random = &mut StdRng::seed_from_u64(seed);
        timing = icarus::random_delays(&netlist, &timing, random);
        ours = through_sdf(&timing, &ours, &netlist, corner);
    }
    if case.has_transport() || case.sdf_seed().is_some() {
        let nominal = Timing::nominal(&netlist, &library, corner);
        write_parametric_cells(&mut verilog, &library, &BTreeSet::new(), corner).unwrap();
        write_delays(&mut parameters, "dut", &netlist, &timing, &nominal).unwrap();
    } else {
        write_cells(&mut verilog, &library, corner).unwrap();
    }
    write_modules(&mut verilog, &top).unwrap();
    let parameters = String::from_utf8(parameters).unwrap();
    let bench = testbench(&top, &netlist, &drives, &parameters);
    let verilog = String::from_utf8(verilog).unwrap() + &bench;
    let selection = WaveSelection::all().with_anonymous();
    IcarusCase {
        verilog: with_modules_numbered(&verilog, index),
        ours: simulate(&ours, &netlist, drives, end, &selection),
        end,
    }
}

/// `verilog` with `_{index}` after the name of every module.
fn with_modules_numbered(verilog: &str, index: usize) -> String {
    let is_other = |c: char| !c.is_ascii_alphanumeric() && c != '_';
    let words = |text: &str| text.split(is_other).map(str::to_owned).collect::<Vec<_>>();
    let modules: BTreeSet<String> = verilog
        .lines()
        .filter_map(|line| words(line.strip_prefix("module ")?).into_iter().next())
        .collect();
    let mut numbered = String::new();
    for piece in verilog.split_inclusive(is_other) {
        let word = piece.trim_end_matches(is_other);
        numbered += word;
        if modules.contains(word) {
            write!(numbered, "_{index}").unwrap();
        }
        numbered += &piece[word.len()..];
    }
    numbered
}

/// Runs some cases in both simulators, in one run of Icarus.
fn compare(cases: &[Case]) -> Result<Figures, TestCaseError> {
    let cases = cases.iter().enumerate();
    let cases: Vec<_> = cases.map(|(index, case)| prepared(case, index)).collect();
    let mut all: String = cases.iter().map(|case| case.verilog.as_str()).collect();
    let duts: Vec<_> = (0..cases.len()).map(|i| format!("tb_{i}.dut")).collect();
    let last = cases
        .iter()
        .map(|case| case.end)
        .max()
        .unwrap_or(Time::ZERO);
    let (scopes, fs) = (duts.join(", "), last.as_fs());
    let dump = format!("$dumpfile(\"icarus.vcd\"); $dumpvars(0, {scopes}); #{fs} $finish;");
    writeln!(all, "module run; initial begin {dump} end endmodule").unwrap();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("cases.v"), all).unwrap();
    icarus::simulate(folder.path(), &["cases.v"], &[]);
    let dump = std::fs::read(folder.path().join("icarus.vcd")).unwrap();
    let mut figures = Figures::default();
    for (case, theirs) in cases.iter().zip(Waves::read_each(Cursor::new(dump), &duts)) {
        figures = figures
            + case
                .ours
                .compare(&theirs, NAMES, case.end.as_fs() as u64)
                .map_err(|why| TestCaseError::fail(format!("{why}\n{}", case.verilog)))?;
    }
    Ok(figures)
}

/// Cases to run in each of the two tests with random netlists.
fn cases() -> u32 {
    cases::cases(USUAL).div_ceil(2)
}

/// How proptest goes about it. Shrinking is cut short: every step runs Icarus.
fn config(cases: u32) -> Config {
    let beside_this_file = FileFailurePersistence::WithSource("proptest-regressions");
    Config {
        cases,
        source_file: Some(file!()),
        failure_persistence: Some(Box::new(beside_this_file)),
        max_shrink_iters: 2_000,
        ..Config::default()
    }
}

/// Compares random cases until one differs, and then prints the smallest like it, as Verilog.
fn compare_all(what: &str, strategy: impl Strategy<Value = Case> + 'static) {
    if !icarus::is_here() {
        return;
    }
    let start = Instant::now();
    let all = Cell::new((0, Figures::default()));
    // Starting Icarus takes longer than simulating one. Seeds that are kept are those of single cases.
    let (runs, strategy, persistence) = if cases() > USUAL / 2 {
        let batches = prop::collection::vec(strategy, 1..=BATCH as usize * 2 - 1);
        (cases().div_ceil(BATCH), batches.boxed(), None)
    } else {
        let single = strategy.prop_map(|case| vec![case]);
        (cases(), single.boxed(), config(0).failure_persistence)
    };
    let config = Config {
        failure_persistence: persistence,
        ..config(runs)
    };
    let result = TestRunner::new(config).run(&strategy, |cases| {
        let (number, figures) = all.get();
        all.set((number + cases.len() as u64, figures + compare(&cases)?));
        Ok(())
    });
    match result {
        Ok(()) => {}
        Err(TestError::Fail(reason, cases)) => panic!("{reason}\n{cases:#?}"),
        Err(TestError::Abort(reason)) => panic!("{reason}"),
    }
    let (number, figures) = all.get();
    figures.print(what, number, start);
}

#[test]
fn random_flat_circuits() {
    compare_all("flat circuits", circuit::flat());
}

#[test]
fn random_hierarchies() {
    compare_all("hierarchies", circuit::hierarchical());
}

/// Runs one case as it is, and with nets, cells and the drives of each instant in another order.
fn compare_shuffled(case: &Case, seed: u64) -> Result<Figures, TestCaseError> {
    let random = &mut StdRng::seed_from_u64(seed);
    let netlists = [case.circuit(), case.shuffled_circuit(random)].map(|m| Netlist::elaborate(&m));
    let drives = case.drives(&netlists[0]);
    let end = drives.last().map_or(Time::ZERO, |d| d.time) + SETTLING;
    let inputs = netlists.each_ref().map(Netlist::inputs);
    let mut shuffled: Vec<Drive> = drives
        .iter()
        .map(|drive| {
            let pin = inputs[0].iter().position(|&net| net == drive.net).unwrap();
            Drive::new(drive.time, inputs[1][pin], drive.value)
        })
        .collect();
    shuffled.shuffle(random);
    shuffled.sort_by_key(|drive| drive.time);
    // Numbers of unnamed nets depend on the order, too.
    let named = WaveSelection::all();
    let timing = netlists.each_ref().map(|netlist| case.timing(netlist));
    let waves = simulate(&timing[0], &netlists[0], drives, end, &named);
    let shuffled = simulate(&timing[1], &netlists[1], shuffled, end, &named);
    waves
        .compare(&shuffled, ["the circuit", "its shuffle"], u64::MAX)
        .map_err(TestCaseError::fail)
}

proptest! {
    #![proptest_config(config(1_000))]

    #[test]
    fn no_result_depends_on_the_order_within_an_instant(
        case in prop_oneof![circuit::flat(), circuit::hierarchical()],
        seed in any::<u64>(),
    ) {
        compare_shuffled(&case, seed)?;
    }
}
