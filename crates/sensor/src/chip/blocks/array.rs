//! QuantIC4x4: the array, its load path, its readout, and the one flip-flop that starts an exposure (thesis 4.2, 4.7).
//!
//! ```text
//!   COUNTER_INITS, LOAD_CLK, LOAD_ENABLE ─► deserialiser, row_scanner ─┬ COUNTER_INIT_ROW (by column)
//!                                                                      └ MEMORY_LOAD (by row)
//!   ENABLE ─►[RUN]─► ENABLE of every macropixel       RESETB, HISTOGRAM_CLEAR ─► PIXEL_CLEAR
//!             ▲
//!            STOP                                     instances mp_r{row}_c{col}
//!   READ_CLK, READ_ENABLE ─► readout_scanner ─► WORD of a row ─► columns, serialisers ─► DATA_OUT
//! ```
//!
//! RUN takes ENABLE on rising STOP edges, so that counting starts with a whole laser cycle and stops
//! with one: releasing the counters in mid-cycle would give a false LOCAL_STOP.
//!
//! Where CLK is skewed, CLK, STOP and RUN come to each column as much later as the wires to it are longer, all three alike: what a
//! macropixel does is then the same at another time.
//!
//! Start values are loaded while RUN is low. PIXEL_CLEAR empties histograms and pipelines without
//! touching the start values, which RESETB wipes.

use std::sync::Arc;

use super::readout::ReadoutOrder;
use super::{finished, load_path, macropixel, readout};
use crate::chip::config::SensorConfig;
use crate::netlist::{CellKind, Module, ModuleBuilder, Net, OwnDelay};
use crate::units::Time;

/// The name of the top.
pub const NAME: &str = "quantic4x4";

/// The instance name of a macropixel.
pub fn pixel_name(row: usize, col: usize) -> String {
    format!("mp_r{row}_c{col}")
}

/// The sensor with every macropixel of the configuration.
///
/// Ports: CLK, STOP, RESETB, ENABLE, HISTOGRAM_CLEAR, CONVENTIONAL, TYPE\<2\>, THRESHOLD\<bits\>, LOAD_CLK,
/// LOAD_ENABLE, COUNTER_INITS, READ_CLK, READ_ENABLE, SPAD_RAW\<rows × cols × SPADs\> (row-major) →
/// LOCAL_STOP\<rows × cols\>, DATA_OUT\<readout pins\>.
pub fn circuit(config: &SensorConfig) -> Arc<Module> {
    subarray(config, (0, 0), (config.rows, config.cols))
}

/// What brings CLK later to a column than to the first, and STOP and RUN alike.
fn wire_to(config: &SensorConfig, col: usize) -> Option<OwnDelay> {
    let typical = config.clk_wire(col);
    (typical > Time::ZERO).then(|| OwnDelay::wire(typical))
}

/// The wire that brings CLK to a column, by itself: CLK → CLK_C; none where it comes as to the first.
pub(crate) fn clk_wire(config: &SensorConfig, col: usize) -> Option<Arc<Module>> {
    let wire = wire_to(config, col)?;
    let mut m = ModuleBuilder::new(NAME);
    let clk = m.input("CLK");
    let output = m.output("CLK_C");
    m.cell_with_delay("clk_c", CellKind::Buf, &[clk], &[output], wire);
    Some(finished(m.finish()))
}

/// A rectangle of the sensor, as a chip of its own: `size` (rows, cols) macropixels from `first`
/// (row, col) on, with a load path of that size. Instances keep the names they have in the array.
///
/// # Panics
/// When the rectangle is empty.
pub fn subarray(
    config: &SensorConfig,
    first: (usize, usize),
    (rows, cols): (usize, usize),
) -> Arc<Module> {
    assert!(rows > 0 && cols > 0, "a sensor needs a macropixel");
    let (bits, spads) = (config.counter_bits, config.spads());
    let pixel = macropixel::circuit(config);
    let mut m = ModuleBuilder::new(NAME);
    let clk = m.input("CLK");
    let stop = m.input("STOP");
    let resetb = m.input("RESETB");
    let enable = m.input("ENABLE");
    let histogram_clear = m.input("HISTOGRAM_CLEAR");
    m.input("CONVENTIONAL");
    m.input_bus("TYPE", 2);
    m.input_bus("THRESHOLD", config.threshold_bits());
    m.input("LOAD_CLK");
    let load_enable = m.input("LOAD_ENABLE");
    m.input("COUNTER_INITS");
    m.input("READ_CLK");
    let read_enable = m.input("READ_ENABLE");
    let raw = m.input_bus("SPAD_RAW", rows * cols * spads);
    let local_stop = m.output_bus("LOCAL_STOP", rows * cols);
    let order = ReadoutOrder::of_array(config, (rows, cols));
    let data_out = m.output_bus("DATA_OUT", order.pins());

    let run = m.wire("RUN");
    let pixel_clear = m.wire("PIXEL_CLEAR");
    let reset = m.gate(CellKind::Inv, &[resetb]);
    m.cell(
        "run",
        CellKind::Dffr,
        &[enable, stop, reset],
        &[Some(run), None],
    );
    m.gate_into(CellKind::Or2, &[reset, histogram_clear], pixel_clear);
    let (row_bits, load) = load_path::place(&mut m, rows, cols, bits, [load_enable, resetb]);

    let columns: Vec<[Net; 3]> = (first.1..first.1 + cols)
        .map(|col| {
            [("CLK", clk), ("STOP", stop), ("RUN", run)].map(|(name, net)| {
                let Some(wire) = wire_to(config, col) else {
                    return net;
                };
                let output = m.wire(&format!("{name}_C{col}"));
                let name = format!("{}_c{col}", name.to_lowercase());
                m.cell_with_delay(&name, CellKind::Buf, &[net], &[output], wire);
                output
            })
        })
        .collect();
    let read = readout::place(&mut m, order, [read_enable, resetb], &data_out);

    for row in 0..rows {
        for col in 0..cols {
            let [clk, stop, run] = columns[col];
            let index = row * cols + col;
            m.instance_by_names(
                &pixel_name(first.0 + row, first.1 + col),
                &pixel,
                &[
                    ("CLK", &[clk]),
                    ("STOP", &[stop]),
                    ("ENABLE", &[run]),
                    ("COUNTER_INIT", &row_bits[col * bits..][..bits]),
                    ("MEMORY_LOAD", &load[row..=row]),
                    ("SPAD_RAW", &raw[index * spads..][..spads]),
                    ("ROW_READ", &read.rows[row..=row]),
                    ("LOCAL_STOP", &local_stop[index..=index]),
                    ("WORD", &read.words[index * order.bits..][..order.bits]),
                ],
            );
        }
    }
    finished(m.finish())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::netlist::Netlist;

    #[test]
    fn the_array_elaborates_and_is_addressed_by_name() {
        let config = SensorConfig {
            rows: 3,
            cols: 2,
            ..SensorConfig::default()
        };
        let netlist = Netlist::elaborate(&circuit(&config));
        assert!(netlist.net("mp_r2_c1.p_counter.LOCAL_STOP").is_some());
        assert_eq!(
            netlist.net("mp_r2_c1.LOCAL_STOP"),
            netlist.net("LOCAL_STOP[5]")
        );
        assert_eq!(
            netlist.net("mp_r1_c1.COUNTER_INIT[0]"),
            netlist.net("COUNTER_INIT_ROW[9]")
        );
    }
}
