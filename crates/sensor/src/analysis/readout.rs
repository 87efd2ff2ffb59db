//! How fast histograms can be read: READ_CLK against the scanner, the columns and the serialisers.
//!
//! All is clocked by READ_CLK's rise, so everything has a period, but for the words: they have a word's time, from the edge
//! that moves the tokens to the one that takes what they select. DATA_OUT is sampled with the fall and has half a period.

use super::gates;
use crate::chip::readout::{ReadoutOrder, with_counts};
use crate::chip::{Limits, ReadPins, ReadProbe, SensorConfig, Silicon};
use crate::engine::readout::{PinSampler, READ_ENABLED, power_up};
use crate::kernel::{Kernel, Stimulus, TimingChecks};
use crate::logic::Logic;
use crate::netlist::{CheckKind, Edge, NetId, Netlist, Requirement, Requirements, StaticTiming};
use crate::stimulus::read_stimulus;
use crate::units::{Frequency, Time};

/// Static timing of one serialiser, its columns and the scanner.
#[derive(Debug, Clone)]
pub struct ReadTiming {
    /// The netlist that is analysed, which names the flip-flops.
    pub netlist: Netlist,
    /// What the flip-flops behind READ_CLK ask of its period.
    pub read_clk: Vec<Requirement>,
    /// READ_CLK rises → the word that its tokens select has been set up at the serialiser, latest.
    pub word: Time,
    /// READ_CLK periods that it has.
    pub word_periods: usize,
    /// READ_CLK rises → DATA_OUT, latest: before READ_CLK falls.
    pub data_out: Time,
}

/// One pin's share of the columns.
fn one_pin(config: &SensorConfig, rows: usize) -> SensorConfig {
    SensorConfig {
        rows,
        cols: ReadoutOrder::new(config).cols_per_pin,
        readout_pins: 1,
        ..config.clone()
    }
}

impl ReadTiming {
    /// Analyses the readout of this sensor. One pin stands for all: their shares of the columns are alike.
    pub fn analyse(config: &SensorConfig, silicon: &Silicon, limits: Limits) -> Self {
        let order = ReadoutOrder::new(&one_pin(config, config.rows));
        let netlist = Netlist::elaborate(&with_counts(order));
        let timing = silicon.timing(&netlist);
        let library = silicon.limits(limits);
        let analysis = StaticTiming::new(&netlist, &timing);
        let pins = ReadPins::find(&netlist);
        let words = ReadProbe::Word.bus(&netlist);
        let requirements = |cuts: &[NetId]| {
            Requirements::new(
                &netlist,
                &analysis,
                pins.clk,
                cuts,
                &library,
                silicon.corner,
            )
            .expect("the readout has no loop")
        };
        let latest = |windows: &mut dyn Iterator<Item = (Time, Time)>| {
            let latest = windows.map(|window| window.1).max();
            latest.expect("READ_CLK reaches it")
        };
        let (cut, uncut) = (requirements(&words), requirements(&[]));
        let after_rise = cut.arrivals(Edge::Rise);
        let to_words = latest(&mut words.iter().filter_map(|&net| after_rise.window(net)));
        let data_out = latest(&mut pins.data.iter().filter_map(|&net| after_rise.window(net)));
        let from_words: Vec<_> = words
            .iter()
            .flat_map(|&net| Edge::BOTH.map(|edge| (net, edge)))
            .collect();
        let from_words = analysis.arrivals(&from_words, &[]).expect("no loop");
        let stages = netlist.cells().iter().filter(|c| c.kind.is_flip_flop());
        let set_up = stages.flat_map(|cell| {
            let limits = library.checks(cell.kind);
            Edge::BOTH.map(|edge| {
                let setup = limits.edge_limit(CheckKind::Setup, edge, silicon.corner);
                let window = from_words.edge_window(cell.input(0), edge);
                window.map(|(_, last)| last + setup)
            })
        });
        let set_up = set_up.flatten().max().expect("words are taken");
        let is_hold = |r: &&Requirement| r.kind == CheckKind::Hold;
        let holds = uncut.all().iter().filter(is_hold);
        let others = cut.all().iter().filter(|r| !is_hold(r));
        ReadTiming {
            read_clk: others.chain(holds).copied().collect(),
            word: to_words + set_up,
            word_periods: order.word_periods(),
            data_out,
            netlist: netlist.clone(),
        }
    }

    /// Shortest READ_CLK period; none if no period does.
    pub fn period(&self) -> Option<Time> {
        let word_fs = self.word.as_fs() as usize;
        let word = Time::from_fs(word_fs.div_ceil(self.word_periods) as i64);
        let own = super::longest(self.read_clk.iter())?;
        Some(own.max(word).max(self.data_out * 2))
    }
}

/// Whether the event kernel reads arbitrary counts of two rows right at a READ_CLK period and, if limits are to be kept, breaks
/// none. More rows only take longer to settle, and words have time.
pub fn read_works(
    config: &SensorConfig,
    silicon: &Silicon,
    limits: Limits,
) -> impl Fn(Time) -> bool {
    const ROWS: usize = 2;
    let order = ReadoutOrder::new(&one_pin(config, ROWS));
    let netlist = Netlist::elaborate(&with_counts(order));
    let pins = ReadPins::find(&netlist);
    let most = ((1u32 << order.bits) - 1) as u16;
    let counts: Vec<u16> = (0..ROWS * order.cols * order.bins)
        .map(|i| (i as u16).wrapping_mul(0x9e37).rotate_left(7) & most)
        .collect();
    let timing = silicon.timing(&netlist);
    let (library, corner) = (silicon.limits(limits), silicon.corner);
    move |period| {
        let Ok(clock) = Frequency::from_period(period) else {
            return false;
        };
        let mut sampler = PinSampler::new(&netlist, |_| Logic::X);
        let mut checks =
            TimingChecks::new(&netlist, &library, corner).not_before(gates::RESET_RELEASED);
        let mut kernel = Kernel::new(&netlist, &timing);
        let (end, mut read) = read_stimulus(&pins, clock, READ_ENABLED, order.periods());
        let mut power_up = Stimulus::sorted(power_up(&netlist, &order, &counts));
        kernel
            .run(
                &mut power_up,
                READ_ENABLED,
                &mut (&mut sampler, &mut checks),
            )
            .expect("no loop of cells without delay");
        match limits {
            Limits::Kept => kernel
                .run(&mut read, end, &mut (&mut sampler, &mut checks))
                .expect("no loop of cells without delay"),
            Limits::Ignored => kernel
                .run(&mut read, end, &mut sampler)
                .expect("no loop of cells without delay"),
        }
        let found = sampler.counts(&order);
        let is_right = found.iter().zip(&counts).all(|(a, b)| *a == Some(*b));
        is_right && (limits == Limits::Ignored || checks.report(&netlist).violated() == 0)
    }
}
