//! Macropixel: its SPADs, their time window and their histogram (thesis 4.2, 4.3, Fig. 47, 48, 55).
//!
//! ```text
//!   SPAD_RAW ─► front_end ─► correlation ─► metdc ─HIT─► histogram
//!                                             ▲ LOCAL_STOP
//!   STOP, CLK ─► p_counter_timing ──────► p_counter ◄── COUNTER_INIT, MEMORY_LOAD
//!                    ▲                        │
//!                    └──────── LOCAL_STOP ────┘
//!   ROW_READ, BIN_READ ─► bin_select ◄── counts of the histogram
//!                             └─► WORD
//! ```
//!
//! Where delay lines time photons, `photon_line` is the front end and `metdc_delay_line` the METDC, and nothing is correlated:
//!
//! ```text
//!   SPAD_RAW ─► photon_line ─PHOTONS─► metdc_delay_line ─HIT─► histogram
//! ```
//!
//! Where a counter times photons, `metdc_counter` is the METDC, and `histogram_sums` adds up how many SPADs fired:
//!
//! ```text
//!   SPAD_RAW ─► front_end ─► adder ─EVENTS─────► histogram_sums
//!                  LOCAL_STOP ─► metdc_counter ─SELECTED─┘
//! ```
//!
//! [`macropixel_model`](super::macropixel_model) has those with CLK in plain Rust.

use std::sync::Arc;

use super::{
    correlation, finished, front_end, histogram, histogram_sums, metdc, metdc_counter,
    metdc_delay_line, p_counter, p_counter_timing, photon_line, readout,
};
use crate::chip::config::{SensorConfig, Tdc};
use crate::chip::own_block::block::OwnBlock;
use crate::netlist::{Module, ModuleBuilder};
use crate::photon::count_bits;

/// Name of the module.
pub(crate) const NAME: &str = "macropixel";

/// One macropixel.
///
/// Ports: CLK, STOP, RESETB, ENABLE, PIXEL_CLEAR, CONVENTIONAL, TYPE\<2\>, THRESHOLD\<bits\>,
/// COUNTER_INIT\<bits\>, MEMORY_LOAD, SPAD_RAW\<SPADs\>, ROW_READ, BIN_READ\<bins\> → LOCAL_STOP, WORD\<bin bits\>.
pub fn circuit(config: &SensorConfig) -> Arc<Module> {
    let mut m = ModuleBuilder::new(NAME);
    for pin in [
        "CLK",
        "STOP",
        "RESETB",
        "ENABLE",
        "PIXEL_CLEAR",
        "CONVENTIONAL",
    ] {
        m.input(pin);
    }
    m.input_bus("TYPE", 2);
    m.input_bus("THRESHOLD", config.threshold_bits());
    let init = m.input_bus("COUNTER_INIT", config.counter_bits);
    m.input("MEMORY_LOAD");
    m.input_bus("SPAD_RAW", config.spads());
    m.input("ROW_READ");
    m.input_bus("BIN_READ", config.bins);
    m.output("LOCAL_STOP");
    m.output_bus("WORD", config.bin_bits);

    for wire in ["COUNTER_CLK", "COUNTER_RESET", "MEMORY_RESET", "STOP_D"] {
        m.wire(wire);
    }
    match config.tdc {
        Tdc::Clocked => {
            m.wire_bus("SPAD_TIMED", config.lines());
            m.wire("SPAD_EVENT");
            m.wire_bus("HIT", config.bins);
        }
        Tdc::Counter => {
            m.wire_bus("SPAD_TIMED", config.lines());
            m.wire_bus("EVENTS", count_bits(config.lines()));
            m.wire_bus("SELECTED", config.bins);
        }
        Tdc::DelayLine => {
            m.wire("PHOTONS");
            m.wire_bus("HIT", config.bins);
        }
    }
    let placed = |name: &str, own: &Option<OwnBlock>, built_in: &dyn Fn() -> Arc<Module>| {
        OwnBlock::or(own.as_ref(), name, built_in)
    };
    let counts = m.wire_bus("COUNT", config.bins * config.bin_bits);

    let timing = p_counter_timing::circuit(config.after_borrow, config.reset_buffers());
    m.instance_by_names("p_counter_timing", &timing, &[]);
    m.instance_by_names("p_counter", &p_counter::circuit(config), &[]);
    if config.tdc.has_clk_bins() {
        let front_end = placed("front_end", &config.front_end_block, &|| {
            front_end::circuit(config)
        });
        m.instance_by_names("front_end", &front_end, &[]);
    }
    match config.tdc {
        Tdc::Clocked => {
            let correlation = placed("correlation", &config.correlation_block, &|| {
                correlation::circuit(config.lines())
            });
            m.instance_by_names("correlation", &correlation, &[]);
            let metdc = placed("metdc", &config.metdc_block, &|| {
                metdc::circuit(config.bins)
            });
            m.instance_by_names("metdc", &metdc, &[]);
        }
        Tdc::Counter => {
            m.instance_by_names("adder", &metdc_counter::adder(config.lines()), &[]);
            m.instance_by_names("metdc", &metdc_counter::circuit(config.bins), &[]);
        }
        Tdc::DelayLine => {
            let front_end = photon_line::circuit(config.spads());
            m.instance_by_names("front_end", &front_end, &[]);
            let lines = metdc_delay_line::circuit(config.bins, &config.delay_elements());
            m.instance_by_names("metdc", &lines, &[("COUNTER_INIT", &init[..1])]);
        }
    }
    let bins: Vec<String> = (0..config.bins).map(histogram::bin_name).collect();
    let of_bins = bins.iter().zip(counts.chunks(config.bin_bits));
    let of_bins: Vec<_> = of_bins
        .map(|(name, count)| (name.as_str(), count))
        .collect();
    let (bins, bits, overflow) = (config.bins, config.bin_bits, config.overflow);
    let histogram = placed("histogram", &config.histogram_block, &|| match config.tdc {
        Tdc::Counter => histogram_sums::circuit(bins, bits, count_bits(config.lines()), overflow),
        Tdc::Clocked | Tdc::DelayLine => histogram::circuit(bins, bits, overflow),
    });
    m.instance_by_names("histogram", &histogram, &of_bins);
    let bin_select = readout::bin_select(config.bins, config.bin_bits);
    m.instance_by_names("bin_select", &bin_select, &[]);
    finished(m.finish())
}
