//! The keys of a sensor file: units, ranges, sources.

use super::spad_grid::{MOST_SPADS, count_bits};
use crate::settings::{Key, Range, Section};

const fn key(
    name: &'static str,
    unit: &'static str,
    range: Range,
    what: &'static str,
    source: &'static str,
) -> Key {
    Key {
        name,
        what,
        unit,
        range,
        source,
    }
}

const fn whole(least: u32, most: u32) -> Range {
    Range::Within(least as f64, most as f64)
}

const CHIP: &str = "the QuantIC4x4, thesis Table 11";
const CHOSEN: &str = "chosen";

/// The one section of a sensor file.
pub(super) const SECTION: Section = Section {
    name: "",
    what: "A sensor; keys that are left out are the QuantIC4x4's",
    keys: KEYS,
};

pub(super) const KEYS: &[Key] = &[
    key("rows", "", whole(1, 256), "Macropixel rows", CHIP),
    key("cols", "", whole(1, 256), "Macropixel columns", CHIP),
    key(
        "spad_rows",
        "",
        whole(1, 8),
        "Rows of a macropixel's SPADs: 1, 2, 4 or 8",
        "thesis 4.2",
    ),
    key(
        "spad_cols",
        "",
        whole(1, 8),
        "Columns of a macropixel's SPADs: 1, 2, 4 or 8",
        "thesis 4.2",
    ),
    key(
        "front_end",
        "",
        Range::OneOf(&["summation", "or_tree", "xor_tree", "coincidence"]),
        "How SPADs' pulses become events; all but the first join them on one line, for the gate engine",
        "thesis 2.4.1, Fig. 22",
    ),
    key(
        "coincident_spads",
        "",
        whole(1, MOST_SPADS as u32),
        "SPADs that must fire together with front_end = \"coincidence\"",
        CHOSEN,
    ),
    key(
        "counter_bits",
        "",
        whole(2, 12),
        "Programmable bits of the P-counter",
        "thesis 4.5",
    ),
    key(
        "p_counter",
        "",
        Range::OneOf(&[
            "ripple",
            "set_reset",
            "synchronous",
            "comparator",
            "memoryless",
        ]),
        "How the P-counter is built",
        "thesis 4.4, Fig. 53",
    ),
    key(
        "tap",
        "",
        Range::OneOf(&["borrow", "msb"]),
        "Where LOCAL_STOP comes from; the comparator has no msb",
        "chosen: the thesis's msb (4.5) is high from the reset on for start values of 2^(n-1) and more",
    ),
    key(
        "after_borrow",
        "",
        Range::OneOf(&["hold", "wrap"]),
        "What the P-counter does after LOCAL_STOP; without memory it must wrap",
        "thesis 4.5",
    ),
    key(
        "step_periods",
        "",
        whole(1, 8),
        "CLK periods from a start value's window to the next one's: 1, 2, 4 or 8; without memory 1",
        "thesis 4.9.3, Table 10",
    ),
    key(
        "tdc",
        "",
        Range::OneOf(&["clocked", "delay_line"]),
        "What times photons: bins are CLK periods, or elements of delay lines",
        "thesis 4.9.3, Table 10",
    ),
    key(
        "delay_control_v",
        "V",
        Range::Within(0.5, 1.1),
        "Control voltage of the delay lines: 0.7 V makes elements of 2.6 ns",
        "chosen: the thesis has the delay, not the voltage (6.3.1)",
    ),
    key(
        "delay_sigma",
        "",
        Range::Within(0.0, 0.25),
        "How the delay lines' elements differ, relative to their mean",
        "thesis 6.3.1, Fig. 91: 0.4 ns of 2.6 ns",
    ),
    key(
        "delay_seed",
        "",
        whole(0, u32::MAX),
        "Which chip, of those whose elements differ",
        CHOSEN,
    ),
    key(
        "clk_skew_ps",
        "ps",
        Range::Within(0.0, 200.0),
        "How much later CLK and STOP come to each column than to the one left of it",
        "chosen: Fig. 90 shows it without a scale",
    ),
    key("bins", "", whole(1, 64), "Histogram bins", CHIP),
    key("bin_bits", "", whole(1, 16), "Bits of each bin", CHIP),
    key(
        "clk_hz",
        "Hz",
        Range::Within(1e6, 2e9),
        "CLK frequency; its period is one histogram bin of a clocked TDC",
        "thesis 4.8",
    ),
    key(
        "stop_phase_ps",
        "ps",
        Range::Within(-5e5, 5e5),
        "Rise of STOP after the falling edge of CLK; at most half a CLK period either way",
        CHOSEN,
    ),
    key(
        "load_clk_hz",
        "Hz",
        Range::Within(1e6, 1e9),
        "Deserialiser clock",
        "thesis 4.7, a few hundred megahertz",
    ),
    key(
        "reset_to_load",
        "",
        Range::Switch,
        "Whether the sensor must be reset, and stand still, before windows are written",
        "thesis 4.9.5, Table 11: no, but HSLIDAR must",
    ),
    key(
        "readout_pins",
        "",
        whole(1, 256),
        "Pins through which histograms leave, each with a serialiser for its share of the columns",
        CHOSEN,
    ),
    key(
        "read_clk_hz",
        "Hz",
        Range::Within(1e6, 1e9),
        "Serialiser clock",
        "chosen: that of the deserialiser",
    ),
    key(
        "dead_time_ns",
        "ns",
        Range::Above(0.0, 1e6),
        "SPAD dead time and width of a SPAD_RAW pulse",
        CHOSEN,
    ),
    key(
        "paralysable",
        "",
        Range::Switch,
        "Whether a photon during the dead time begins it anew",
        CHOSEN,
    ),
    key(
        "afterpulse_probability",
        "",
        Range::Within(0.0, 1.0),
        "Chance that an avalanche has an afterpulse",
        "chosen: none",
    ),
    key(
        "afterpulse_time_ns",
        "ns",
        Range::Within(0.0, 1e6),
        "Time constant of afterpulses after the dead time",
        CHOSEN,
    ),
    key(
        "crosstalk_probability",
        "",
        Range::Within(0.0, 1.0),
        "Chance that an avalanche fires one of its SPAD's four neighbours",
        "chosen: none",
    ),
    key(
        "event_type",
        "",
        Range::OneOf(&["less", "equal", "greater"]),
        "TYPE: how the number of fired SPADs is compared with THRESHOLD",
        "thesis 4.2",
    ),
    key(
        "threshold",
        "",
        whole(0, (1 << count_bits(MOST_SPADS)) - 1),
        "THRESHOLD: SPADs; at most 31 with 4x4 of them",
        "chosen: any photon counts",
    ),
    key(
        "overflow",
        "",
        Range::OneOf(&["saturate", "wrap"]),
        "What full bins do",
        CHOSEN,
    ),
    key(
        "mode",
        "",
        Range::OneOf(&["guided", "conventional"]),
        "Which STOP counts: each macropixel's own, or the global one",
        "thesis 4.3 and 4.2",
    ),
    key(
        "corner",
        "",
        Range::OneOf(&["slow", "typ", "fast"]),
        "Silicon whose delays the cells have; min and max are taken for fast and slow",
        CHOSEN,
    ),
];
