//! Testbench of the time-to-digital converters of 2.4.3: clock counter, gated ring oscillator and delay line, their DNL and
//! INL by a code-density test, and what coupling does to rings that differ (thesis 2.4.3, Fig. 23).
//!
//! ```text
//!   START, STOP ─┬─► clock counter ─► code of 2.6 ns      intervals spread evenly, 64 conversions in the lanes of one
//!                ├─► ring of 25 ────► code of 1 ns        simulation; each code against the model, and how often each
//!                └─► 32 buffers ────► code of 46 ps       comes against the delays of its elements
//! ```
//!
//! Beside the waveform it leaves three charts with their numbers: DNL, INL, and the frequencies of a row of rings.

mod converter;
mod rings;
mod waveform;

use std::path::Path;

use self::converter::{BEGIN, BITS, CLEARED, CODES, SIGMA, STAGES, build};
use crate::analysis::Linearity;
use crate::chip::tdc::{Steps, clock_counter, delay_line, ring_oscillator};
use crate::files::InputError;
use crate::kernel::{LANES, LaneDrive, LaneKernel, Lanes};
use crate::logic::Logic;
use crate::netlist::{CellId, CellKind};
use crate::report::{Axis, Chart, Checks, Grid};
use crate::testbenches::Testbench;
use crate::testbenches::rig::Rig;
use crate::units::{Frequency, Time};
use rand_philox::{philox4x32_10, u32_to_unit_f64};

/// Batches of 64 conversions: 38 400, about 1200 a code.
const BATCHES: i64 = 600;
pub(super) const TESTBENCH: Testbench = Testbench {
    name: "tb_tdc",
    about: "Clock counter, gated ring oscillator and delay line: DNL and INL by code density; coupled rings",
    run,
    given: None,
};

fn run(waves: &Path, checks: &mut Checks) -> Result<(), InputError> {
    let converters = [clocked(), ring(), line()];
    let densities = converters.each_ref().map(|tdc| tdc.density(checks));
    checks.note(table(&converters, &densities));
    for (tdc, density) in converters.iter().zip(&densities) {
        compare(tdc, density, checks);
    }
    charts(waves, &converters, &densities)?;
    rings::run(waves, checks)?;
    waveform::run(waves, checks)
}

/// Which of START and STOP comes at one time in all lanes. A clock's edges are common, too.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Common {
    Start,
    Stop,
}

/// A converter on its own, and its model.
struct Tdc {
    name: &'static str,
    /// Of its intervals.
    seed: u32,
    rig: Rig,
    code: &'static str,
    common: Common,
    clock: Option<Frequency>,
    /// Where codes begin; those of the clock counter depend on START's phase, and only their widths are here.
    steps: Steps,
    /// Longest interval.
    range: Time,
}

fn clocked() -> Tdc {
    let rig = build(&clock_counter::circuit(BITS), SIGMA, 1);
    let clock = Frequency::from_hz_f64(384e6).expect("a frequency");
    Tdc {
        name: "clock counter",
        seed: 1,
        rig,
        code: "CODE",
        common: Common::Stop,
        clock: Some(clock),
        steps: Steps::new((0..CODES as i64).map(|k| clock.periods(k)).collect()),
        range: clock.periods(CODES as i64),
    }
}

fn ring() -> Tdc {
    let rig = build(&ring_oscillator::circuit(STAGES, BITS), SIGMA, 1);
    let model = ring_oscillator::RingOscillatorModel::from_netlist(&rig.netlist, &rig.timing, "");
    Tdc {
        name: "ring oscillator",
        seed: 2,
        code: "CODE",
        common: Common::Start,
        clock: None,
        steps: model.steps(CODES),
        range: model.period * CODES as i64,
        rig,
    }
}

fn line() -> Tdc {
    let rig = build(&delay_line::circuit(CODES), SIGMA, 1);
    let steps = delay_line::model(&rig.netlist, &rig.timing, "");
    Tdc {
        name: "delay line",
        seed: 3,
        code: "SEEN",
        common: Common::Start,
        clock: None,
        range: *steps.edges().last().expect("it has elements") + Time::from_ps(40),
        steps,
        rig,
    }
}

/// How often each code came.
struct Density {
    counts: Vec<f64>,
    /// Conversions that lasted from the first code's begin to the last one's end.
    linearity: Linearity,
}

impl Tdc {
    /// The clock, or one to reckon with, and its periods from one batch of conversions to the next: START's samplers and the
    /// counter's ripple have settled by then.
    fn slots(&self) -> (Frequency, i64) {
        let least = BEGIN + self.range + Time::from_ns(16);
        let clock = self
            .clock
            .unwrap_or(Frequency::from_hz_f64(1e9).expect("a frequency"));
        (clock, (least.as_s() * clock.as_hz()).ceil() as i64)
    }

    /// When NOT CLK rises in a stretch of time.
    fn samples(&self, from: Time, to: Time) -> impl Iterator<Item = Time> {
        let clock = self.clock.expect("it has a clock");
        let cells = self.rig.netlist.cells().iter();
        let mut inverters = cells
            .enumerate()
            .filter(|(_, cell)| cell.kind == CellKind::Inv);
        let (inverter, _) = inverters.next().expect("it inverts CLK");
        let late = self.rig.timing.cell_delays(CellId::new(inverter))[0][0].rise();
        let first = (from.as_s() * clock.as_hz()) as i64 - 2;
        let falls = (first..).map(move |k| clock.half_periods(2 * k + 1) + late);
        falls.take_while(move |&fall| fall < to)
    }

    /// The code test, and each code against the model.
    fn density(&self, checks: &mut Checks) -> Density {
        let [start, stop, clear] = ["START", "STOP", "TDC_RESET"].map(|pin| self.rig.net(pin));
        let code = self.rig.bus(self.code);
        let (clock, periods) = self.slots();
        let mut kernel = LaneKernel::new(&self.rig.netlist, &self.rig.timing);
        let all = |time, net, level: bool| LaneDrive {
            time,
            net,
            mask: u64::MAX,
            values: Lanes::all(Logic::from(level)),
        };
        let mut counts = vec![0.0; CODES + 1];
        let mut others = 0;
        for batch in 0..BATCHES {
            let (first, last) = (periods * batch, periods * (batch + 1));
            let [at, next] = [first, last].map(|period| clock.periods(period));
            // START and STOP of each lane.
            let draw = |lane: usize| {
                let word = philox4x32_10([batch as u32, lane as u32, 0, 0], [23, self.seed])[0];
                let interval = Time::from_s(self.range.as_s() * u32_to_unit_f64(word));
                let (begin, end) = (at + BEGIN, at + BEGIN + self.range);
                match self.common {
                    Common::Start => (begin, begin + interval),
                    Common::Stop => (end - interval, end),
                }
            };
            let conversions: Vec<(Time, Time)> = (0..LANES).map(draw).collect();
            let read = next - Time::from_ns(3);
            let mut drives = vec![
                all(at, clear, true),
                all(at, start, false),
                all(at, stop, false),
                all(at + CLEARED, clear, false),
                all(read + Time::from_ns(1), start, false),
                all(read + Time::from_ns(2), stop, false),
            ];
            for (lane, &(started, stopped)) in conversions.iter().enumerate() {
                let rises = [(started, start), (stopped, stop)];
                drives.extend(rises.map(|(time, net)| LaneDrive {
                    mask: 1 << lane,
                    ..all(time, net, true)
                }));
            }
            if self.clock.is_some() {
                let clk = self.rig.net("CLK");
                let edges = 2 * first..2 * last;
                drives.extend(edges.map(|k| all(clock.half_periods(k), clk, k % 2 == 0)));
            }
            drives.sort_by_key(|drive| drive.time);
            let (before, after): (Vec<_>, Vec<_>) =
                drives.into_iter().partition(|drive| drive.time <= read);
            kernel
                .run(&mut before.into_iter().peekable(), read, &mut ())
                .expect("no loop of cells without delay");
            for (lane, &(started, stopped)) in conversions.iter().enumerate() {
                let word = kernel.number(&code, lane);
                let found = match self.code {
                    "SEEN" => word.map(|seen| seen.count_ones() as usize),
                    _ => word.map(|code| code as usize),
                };
                let expected = match self.clock {
                    None => self.steps.code(stopped - started),
                    Some(_) => clock_counter::model(self.samples(at, next), started, stopped),
                };
                others += usize::from(found != Some(expected));
                if let Some(count) = found.and_then(|code| counts.get_mut(code)) {
                    *count += 1.0;
                }
            }
            let end = next - Time::from_fs(1);
            kernel
                .run(&mut after.into_iter().peekable(), end, &mut ())
                .expect("no loop of cells without delay");
        }
        let conversions = BATCHES as usize * LANES;
        checks.equal(
            format!(
                "{}: conversions of {conversions} with another code than the model's",
                self.name
            ),
            0,
            others,
        );
        // Codes between the first and the last have both edges within the range.
        let inner = &counts[1..CODES];
        Density {
            linearity: Linearity::from_widths(inner),
            counts,
        }
    }

    /// What the elements' delays say.
    fn expected(&self) -> Linearity {
        Linearity::from_widths(&self.steps.widths_s())
    }
}

fn table(converters: &[Tdc], densities: &[Density]) -> String {
    let mut grid = Grid::headed(
        "converter | transistors | step (ps) | DNL expected | DNL measured | INL expected \
        | INL measured | noise of DNL",
    );
    for (tdc, density) in converters.iter().zip(densities) {
        let (expected, found) = (tdc.expected(), &density.linearity);
        let transistors = tdc
            .rig
            .netlist
            .cells()
            .iter()
            .map(|cell| cell.kind.transistors());
        let signed = |value: f64| format!("{value:+.3}");
        grid.push([
            tdc.name.to_owned(),
            transistors.sum::<u32>().to_string(),
            format!("{:.1}", expected.step * 1e12),
            signed(expected.worst_dnl()),
            signed(found.worst_dnl()),
            signed(expected.worst_inl()),
            signed(found.worst_inl()),
            format!("{:.3}", 1.0 / found.step.sqrt()),
        ]);
    }
    format!(
        "Code density, {} conversions each; DNL and INL in steps, at their worst\n{grid}",
        BATCHES as usize * LANES
    )
}

/// Counts scatter by their square root: DNL against the elements' delays within five standard errors.
fn compare(tdc: &Tdc, density: &Density, checks: &mut Checks) {
    let (expected, found) = (tdc.expected(), &density.linearity);
    let codes = expected.dnl.iter().zip(&found.dnl).enumerate();
    let sigmas = codes.map(|(code, (expected, found))| {
        let noise = ((1.0 + expected) / density.linearity.step).sqrt();
        ((found - expected).abs() / noise, code + 1)
    });
    let (worst, code) = sigmas
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .expect("there are codes");
    checks.add_verdict(
        format!("{}: DNL of every code against its delays", tdc.name),
        "within 5 standard errors",
        format!("{worst:.1} at code {code}"),
        worst < 5.0,
    );
    let total: f64 = density.counts.iter().sum();
    let share = density.linearity.step / total * tdc.range.as_s();
    let off = share / expected.step - 1.0;
    checks.add_verdict(
        format!("{}: mean step", tdc.name),
        format!("{:.2} ps", expected.step * 1e12),
        format!("{:.2} ps", share * 1e12),
        off.abs() < 0.01,
    );
}

fn charts(waves: &Path, converters: &[Tdc], densities: &[Density]) -> Result<(), InputError> {
    let chart = |what: &str, steps: fn(&Linearity) -> &[f64]| {
        let x = Axis::linear("code");
        let mut chart = Chart::new(
            format!(
                "{what} of {} conversions, against the elements' delays",
                BATCHES as usize * LANES
            ),
            x,
            Axis::linear(format!("{what} (steps)")),
        );
        for (tdc, density) in converters.iter().zip(densities) {
            let points = |linearity: &Linearity| -> Vec<(f64, f64)> {
                let codes = steps(linearity).iter().enumerate();
                codes
                    .map(|(code, &value)| (code as f64 + 1.0, value))
                    .collect()
            };
            chart = chart
                .points(format!("{}, gates", tdc.name), points(&density.linearity))
                .line(format!("{}, delays", tdc.name), points(&tdc.expected()));
        }
        chart
    };
    chart("DNL", |linearity| &linearity.dnl).write(&waves.with_extension("svg"))?;
    chart("INL", |linearity| &linearity.inl).write(&waves.with_file_name("tb_tdc_inl.svg"))
}
