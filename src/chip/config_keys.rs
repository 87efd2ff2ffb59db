//! The keys of a sensor file: units, ranges, sources.

use super::spad_grid::{MOST_SPADS, count_bits};
use crate::settings::{Key, Range, Section};

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
    Key::new("rows", "", whole(1, 256), "Macropixel rows", CHIP),
    Key::new("cols", "", whole(1, 256), "Macropixel columns", CHIP),
    Key::new(
        "spad_rows",
        "",
        whole(1, 8),
        "Rows of a macropixel's SPADs: 1, 2, 4 or 8",
        "thesis 4.2",
    ),
    Key::new(
        "spad_cols",
        "",
        whole(1, 8),
        "Columns of a macropixel's SPADs: 1, 2, 4 or 8",
        "thesis 4.2",
    ),
    Key::new(
        "front_end",
        "",
        Range::OneOf(&["summation", "or_tree", "xor_tree", "coincidence"]),
        "How SPADs' pulses become events; all but the first join them on one line, for the gate engine",
        "thesis 2.4.1, Fig. 22",
    ),
    Key::new(
        "coincident_spads",
        "",
        whole(1, MOST_SPADS as u32),
        "SPADs that must fire together with front_end = \"coincidence\"",
        CHOSEN,
    ),
    Key::new(
        "counter_bits",
        "",
        whole(2, 12),
        "Programmable bits of the P-counter",
        "thesis 4.5",
    ),
    Key::new(
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
    Key::new(
        "tap",
        "",
        Range::OneOf(&["borrow", "msb"]),
        "Where LOCAL_STOP comes from; the comparator has no msb",
        "chosen: the thesis's msb (4.5) is high from the reset on for start values of 2^(n-1) and more",
    ),
    Key::new(
        "after_borrow",
        "",
        Range::OneOf(&["hold", "wrap"]),
        "What the P-counter does after LOCAL_STOP; without memory it must wrap",
        "thesis 4.5",
    ),
    Key::new(
        "step_periods",
        "",
        whole(1, 8),
        "CLK periods from a start value's window to the next one's: 1, 2, 4 or 8; without memory 1",
        "thesis 4.9.3, Table 10",
    ),
    Key::new(
        "tdc",
        "",
        Range::OneOf(&["clocked", "delay_line"]),
        "What times photons: a shift register, with bins of CLK periods (HSLIDAR's clocked mode has a counter in the thesis), or delay lines, whose elements are the bins and on which photons of a bin cancel in pairs",
        "thesis 4.9.3, Table 10; the shift register and that photons cancel are chosen",
    ),
    Key::new(
        "delay_control_v",
        "V",
        Range::Within(0.5, 1.1),
        "Control voltage of the delay lines: 0.7 V makes elements of 2.6 ns",
        "chosen: the thesis has the delay, not the voltage (6.3.1)",
    ),
    Key::new(
        "delay_sigma",
        "",
        Range::Within(0.0, 0.25),
        "How the delay lines' elements differ, relative to their mean",
        "thesis 6.3.1, Fig. 91: 0.4 ns of 2.6 ns",
    ),
    Key::new(
        "delay_seed",
        "",
        whole(0, u32::MAX),
        "Which chip, of those whose elements differ",
        CHOSEN,
    ),
    Key::new(
        "clk_skew_ps",
        "ps",
        Range::Within(0.0, 200.0),
        "How much later CLK and STOP come to each column than to the one left of it",
        "chosen: Fig. 90 shows it without a scale",
    ),
    Key::new("bins", "", whole(1, 64), "Histogram bins", CHIP),
    Key::new("bin_bits", "", whole(1, 16), "Bits of each bin", CHIP),
    Key::new(
        "clk_hz",
        "Hz",
        Range::Within(1e6, 2e9),
        "CLK frequency; its period is one histogram bin of a clocked TDC",
        "thesis 4.8",
    ),
    Key::new(
        "stop_phase_ps",
        "ps",
        Range::Within(-5e5, 5e5),
        "Rise of STOP after the falling edge of CLK; at most half a CLK period either way",
        CHOSEN,
    ),
    Key::new(
        "load_clk_hz",
        "Hz",
        Range::Within(1e6, 1e9),
        "Deserialiser clock",
        "thesis 4.7, a few hundred megahertz",
    ),
    Key::new(
        "reset_to_load",
        "",
        Range::Switch,
        "Whether the sensor must be reset, and stand still, before windows are written",
        "thesis 4.9.5, Table 11: no, but HSLIDAR must",
    ),
    Key::new(
        "readout_pins",
        "",
        whole(1, 256),
        "Pins through which histograms leave, each with a serialiser for its share of the columns",
        CHOSEN,
    ),
    Key::new(
        "read_clk_hz",
        "Hz",
        Range::Within(1e6, 1e9),
        "Serialiser clock",
        "chosen: that of the deserialiser",
    ),
    Key::new(
        "dead_time_ns",
        "ns",
        Range::Above(0.0, 1e6),
        "SPAD dead time and width of a SPAD_RAW pulse",
        CHOSEN,
    ),
    Key::new(
        "paralysable",
        "",
        Range::Switch,
        "Whether a photon during the dead time begins it anew",
        CHOSEN,
    ),
    Key::new(
        "afterpulse_probability",
        "",
        Range::Within(0.0, 1.0),
        "Chance that an avalanche has an afterpulse",
        "chosen: none",
    ),
    Key::new(
        "afterpulse_time_ns",
        "ns",
        Range::Within(0.0, 1e6),
        "Time constant of afterpulses after the dead time",
        CHOSEN,
    ),
    Key::new(
        "crosstalk_probability",
        "",
        Range::Within(0.0, 1.0),
        "Chance that an avalanche fires one of its SPAD's four neighbours",
        "chosen: none",
    ),
    Key::new(
        "event_type",
        "",
        Range::OneOf(&["less", "equal", "greater"]),
        "TYPE: how the number of fired SPADs is compared with THRESHOLD",
        "thesis 4.2",
    ),
    Key::new(
        "threshold",
        "",
        whole(0, (1 << count_bits(MOST_SPADS)) - 1),
        "THRESHOLD: SPADs; at most 31 with 4x4 of them",
        "chosen: any photon counts",
    ),
    Key::new(
        "overflow",
        "",
        Range::OneOf(&["saturate", "wrap"]),
        "What full bins do",
        CHOSEN,
    ),
    Key::new(
        "mode",
        "",
        Range::OneOf(&["guided", "conventional"]),
        "Which STOP counts: each macropixel's own, or the global one",
        "thesis 4.3 and 4.2",
    ),
    Key::new(
        "corner",
        "",
        Range::OneOf(&["slow", "typ", "fast"]),
        "Silicon whose delays the cells have; min and max are taken for fast and slow",
        CHOSEN,
    ),
];
