//! Places where the thesis contradicts itself or physics, and what the model makes of each.

use serde::Serialize;

/// One slip.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Slip {
    /// Section, equation, figure or table.
    pub place: &'static str,
    /// What is printed there.
    pub printed: &'static str,
    /// What it cannot stand beside.
    pub against: &'static str,
    /// What the model does.
    pub model: &'static str,
}

/// Every slip that is known, in the thesis's order.
pub const SLIPS: [Slip; 6] = [
    Slip {
        place: "Eq. 18, 19",
        printed: "σ of a count is its mean",
        against: "σ = √mean of a Poisson count; Fig. 32, whose Monte Carlo the formula matches only so",
        model: "exact Poisson; both Gaussian forms are shown (claim 9)",
    },
    Slip {
        place: "4.4.1, 4.5",
        printed: "LOCAL_STOP is the MSB of the 9-bit counter",
        against: "2⁹ window steps (Table 9): start values from 256 on have their MSB high at the reset",
        model: "a tenth stage makes the borrow (tap = borrow); tap = msb is the literal reading",
    },
    Slip {
        place: "Fig. 54, caption",
        printed: "LOCAL_STOP after every 5 × CLK",
        against: "4.5: the counter reaches 0 after five edges, LOCAL_STOP rises on the next",
        model: "the sixth edge (claim 3)",
    },
    Slip {
        place: "Table 11",
        printed: "PDE 3.5 % at 840 nm",
        against: "4.9.4: 3.5 % at 850 nm; 7.3.3: 3.5 % at 940 nm",
        model: "none of them: the demonstrator's signal is the measured 89 z⁻² (claim 21)",
    },
    Slip {
        place: "Table 14",
        printed: "window step 1.875 m (1.25 ns)",
        against: "1.875 m are 12.5 ns",
        model: "12.5 ns (claim 23)",
    },
    Slip {
        place: "6.4.2",
        printed: "145 ms before the exposure are at most 7 fps",
        against: "7.3.3, of the same Fig. 106: at most 6 fps; 1/145 ms is 6.9",
        model: "6.9, which is 7 in one digit and 6 in whole frames (claim 27)",
    },
];
