//! What there is in a macropixel that something outside the circuits looks at, with its name and its path.

use crate::chip::histogram;

/// A net or bus of a macropixel that something outside the circuits looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Probe {
    /// CLK.
    Clk,
    /// STOP.
    Stop,
    /// STOP after the timing block's chain, which strobes the METDC in the conventional mode.
    StopD,
    /// ENABLE, the sensor's RUN.
    Enable,
    /// PIXEL_CLEAR.
    PixelClear,
    /// MEMORY_LOAD of its row.
    MemoryLoad,
    /// MEMORY_RESET.
    MemoryReset,
    /// COUNTER_INIT of its column.
    CounterInit,
    /// SPAD_RAW, one bit a SPAD.
    SpadRaw,
    /// Shaped pulses, one bit a SPAD; only front ends with pulse shapers have them.
    Shaped,
    /// The wire that all SPADs share; only front ends that join them have one.
    Wire,
    /// SPAD_TIMED, one bit a SPAD, or one for all.
    SpadTimed,
    /// SPAD_EVENT.
    SpadEvent,
    /// LOCAL_STOP.
    LocalStop,
    /// COUNTER_CLK.
    CounterClk,
    /// COUNTER_RESET.
    CounterReset,
    /// The part of COUNTER_RESET that STOP's rising edge makes.
    ResetPulse,
    /// What keeps CLK from COUNTER_CLK.
    Block,
    /// The start value; a P-counter without memory has none.
    Memory,
    /// COUNTER_CLK divided; only where windows step by several CLK periods.
    StepClk,
    /// The count.
    CounterOut,
    /// The METDC's shift register, newest event first.
    Shift,
    /// All SPADs on one line; only where delay lines time it.
    Photons,
    /// Clock of the flip-flops that sample the delay lines; only there.
    SampleClk,
    /// Taps of the delay line of even start values, behind the first element first; only there.
    EvenTap,
    /// Those of odd start values.
    OddTap,
    /// Clock of the HIT flip-flops.
    Strobe,
    /// Reset of the HIT flip-flops.
    HitReset,
    /// HIT, one bit a bin; a counter TDC has none.
    Hit,
    /// What STROBE sets in a counter TDC; this and the following only there.
    Start,
    /// START as CLK samples it.
    Counting,
    /// CLK periods of the window so far.
    Code,
    /// The bin that events are added to, one bit each.
    Select,
    /// SPADs that fired in the last CLK period.
    Events,
}

impl Probe {
    /// Every probe, in the order of their declaration.
    pub const ALL: [Probe; 34] = [
        Probe::Clk,
        Probe::Stop,
        Probe::StopD,
        Probe::Enable,
        Probe::PixelClear,
        Probe::MemoryLoad,
        Probe::MemoryReset,
        Probe::CounterInit,
        Probe::SpadRaw,
        Probe::Shaped,
        Probe::Wire,
        Probe::SpadTimed,
        Probe::SpadEvent,
        Probe::LocalStop,
        Probe::CounterClk,
        Probe::CounterReset,
        Probe::ResetPulse,
        Probe::Block,
        Probe::Memory,
        Probe::StepClk,
        Probe::CounterOut,
        Probe::Shift,
        Probe::Photons,
        Probe::SampleClk,
        Probe::EvenTap,
        Probe::OddTap,
        Probe::Strobe,
        Probe::HitReset,
        Probe::Hit,
        Probe::Start,
        Probe::Counting,
        Probe::Code,
        Probe::Select,
        Probe::Events,
    ];

    /// Block of the macropixel whose inner net it is (none: the macropixel's own), and its name there.
    const fn place(self) -> (Option<&'static str>, &'static str) {
        match self {
            Probe::Clk => (None, "CLK"),
            Probe::Stop => (None, "STOP"),
            Probe::StopD => (None, "STOP_D"),
            Probe::Enable => (None, "ENABLE"),
            Probe::PixelClear => (None, "PIXEL_CLEAR"),
            Probe::MemoryLoad => (None, "MEMORY_LOAD"),
            Probe::MemoryReset => (None, "MEMORY_RESET"),
            Probe::CounterInit => (None, "COUNTER_INIT"),
            Probe::SpadRaw => (None, "SPAD_RAW"),
            Probe::Shaped => (Some(FRONT_END), "SHAPED"),
            Probe::Wire => (Some(FRONT_END), "WIRE"),
            Probe::SpadTimed => (None, "SPAD_TIMED"),
            Probe::SpadEvent => (None, "SPAD_EVENT"),
            Probe::LocalStop => (None, "LOCAL_STOP"),
            Probe::CounterClk => (None, "COUNTER_CLK"),
            Probe::CounterReset => (None, "COUNTER_RESET"),
            Probe::ResetPulse => (Some(P_COUNTER_TIMING), "PULSE"),
            Probe::Block => (Some(P_COUNTER_TIMING), "BLOCK"),
            Probe::Memory => (Some(P_COUNTER), "MEMORY"),
            Probe::StepClk => (Some(P_COUNTER), "STEP_CLK"),
            Probe::CounterOut => (Some(P_COUNTER), "COUNTER_OUT"),
            Probe::Shift => (Some(METDC), "SHIFT"),
            Probe::Photons => (None, "PHOTONS"),
            Probe::SampleClk => (Some(METDC), "SAMPLE_CLK"),
            Probe::EvenTap => (Some(METDC), "EVEN_TAP"),
            Probe::OddTap => (Some(METDC), "ODD_TAP"),
            Probe::Strobe => (Some(METDC), "STROBE"),
            Probe::HitReset => (Some(METDC), "HIT_RESET"),
            Probe::Hit => (None, "HIT"),
            Probe::Start => (Some(METDC), "START"),
            Probe::Counting => (Some(METDC), "COUNTING"),
            Probe::Code => (Some(METDC), "CODE"),
            Probe::Select => (None, "SELECTED"),
            Probe::Events => (None, "EVENTS"),
        }
    }

    /// The signal's name, as in the thesis where that has one.
    pub const fn name(self) -> &'static str {
        self.place().1
    }

    /// Dotted path of the signal in the macropixel at `macropixel` (empty: at the top).
    pub fn path(self, macropixel: &str) -> String {
        let (block, name) = self.place();
        join([macropixel, block.unwrap_or(""), name])
    }
}

pub(super) const FRONT_END: &str = "front_end";
pub(super) const P_COUNTER_TIMING: &str = "p_counter_timing";
pub(super) const P_COUNTER: &str = "p_counter";
pub(super) const METDC: &str = "metdc";

/// A dotted path of parts, of which empty ones are left out.
pub(super) fn join<const N: usize>(parts: [&str; N]) -> String {
    let parts: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).collect();
    parts.join(".")
}

/// Dotted path of the retiming of a SPAD in the macropixel at `macropixel`.
pub(crate) fn spad_path(macropixel: &str, spad: usize) -> String {
    join([macropixel, FRONT_END, &format!("spad_{spad}")])
}

/// Dotted path of a bin's count in the macropixel at `macropixel`.
pub fn bin_path(macropixel: &str, bin: usize) -> String {
    join([macropixel, "histogram", &histogram::bin_name(bin)])
}
