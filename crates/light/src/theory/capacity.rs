//! How much memory a histogram needs, and what it costs in silicon (thesis 3.3.4 and 3.3.5, Fig. 36 to 41).
//!
//! A full histogram has a bin for every bin interval of the range; each bin must hold at least the background
//! that an exposure puts there. The product is compared with the area of a pixel, one static RAM cell a bit.
//! Decoders, sense amplifiers and wiring are left out, as in the thesis: the areas are lower bounds.

/// The area of a six-transistor static RAM cell in one process generation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SramCell {
    /// Name of the generation, nm.
    pub node_nm: u32,
    /// Area of one bit, µm².
    pub area_um2: f64,
    /// Who published it.
    pub source: &'static str,
}

impl SramCell {
    const fn new(node_nm: u32, area_um2: f64, source: &'static str) -> Self {
        SramCell {
            node_nm,
            area_um2,
            source,
        }
    }
}

/// Published high-density cells, oldest first. The thesis's own values (Fig. 39, after its reference 154) are
/// only drawn, not printed. Those of 90, 65, 22, 16, 7 and 5 nm agree with the makers' announcements; the others are cited
/// as they are commonly quoted and were not compared with anything.
pub const SRAM_CELLS: [SramCell; 10] = [
    SramCell::new(130, 2.45, "Tyagi, IEDM 2000 (Intel), as commonly quoted"),
    SramCell::new(90, 1.0, "Thompson, IEDM 2002 (Intel)"),
    SramCell::new(65, 0.57, "Bai, IEDM 2004 (Intel)"),
    SramCell::new(
        40,
        0.242,
        "Cheng, IEDM 2007 (TSMC 45/40 nm), as commonly quoted",
    ),
    SramCell::new(
        32,
        0.171,
        "Natarajan, IEDM 2008 (Intel), as commonly quoted",
    ),
    SramCell::new(
        28,
        0.127,
        "Wu, VLSI Technology 2009 (TSMC), as commonly quoted",
    ),
    SramCell::new(22, 0.1, "Haran, IEDM 2008 (IBM)"),
    SramCell::new(16, 0.07, "Wu, IEDM 2013 (TSMC)"),
    SramCell::new(7, 0.027, "Wu, IEDM 2016 (TSMC)"),
    SramCell::new(5, 0.021, "Yeap, IEDM 2019 (TSMC)"),
];

/// The memory of one pixel's histogram.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Storage {
    /// Bins.
    pub bins: u32,
    /// Bits of each bin.
    pub bin_bits: u32,
}

impl Storage {
    /// All bits of the histogram.
    pub fn bits(self) -> u64 {
        u64::from(self.bins) * u64::from(self.bin_bits)
    }

    /// Its area in `cell`, µm².
    pub fn area_um2(self, cell: &SramCell) -> f64 {
        self.bits() as f64 * cell.area_um2
    }

    /// The oldest (cheapest) generation in which it fits into `area_um2`.
    pub fn oldest_node(self, area_um2: f64) -> Option<&'static SramCell> {
        let fits = |cell: &&SramCell| self.area_um2(cell) <= area_um2;
        SRAM_CELLS.iter().find(fits)
    }
}

/// Bins that cover `range` with bins of `bin` (both in metres, or both in seconds).
///
/// A range that is a whole number of bins but for rounding takes just that many.
pub fn full_bins(range: f64, bin: f64) -> u32 {
    debug_assert!(range > 0.0 && bin > 0.0);
    (range / bin * (1.0 - 1e-12)).ceil() as u32
}

/// Bits of a counter that holds `count`; at least one.
pub fn bits_for(count: f64) -> u32 {
    debug_assert!((0.0..1e18).contains(&count));
    (count.ceil() as u64).max(1).ilog2() + 1
}

/// Bins of `bin_bits` that fit into `area_um2` of `cell`.
pub fn bins_within(area_um2: f64, bin_bits: u32, cell: &SramCell) -> u32 {
    debug_assert!(bin_bits > 0);
    (area_um2 / (cell.area_um2 * f64::from(bin_bits))).floor() as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn generations_shrink() {
        for pair in SRAM_CELLS.windows(2) {
            assert!(pair[0].node_nm > pair[1].node_nm && pair[0].area_um2 > pair[1].area_um2);
        }
    }

    #[test]
    fn counters_hold_what_they_must() {
        let cases = [
            (0.0, 1),
            (1.0, 1),
            (1.5, 2),
            (2500.0, 12),
            (4095.0, 12),
            (4096.0, 13),
        ];
        for (count, bits) in cases {
            assert_eq!(bits_for(count), bits, "{count}");
        }
    }

    #[test]
    fn a_whole_number_of_bins_is_not_rounded_up() {
        assert_eq!(full_bins(200.0, 0.8), 250);
        assert_eq!(full_bins(0.3, 0.1), 3);
        assert_eq!(full_bins(75.0, 0.39), 193);
    }

    proptest! {
        #[test]
        fn bits_are_enough_and_no_more(count in 1u64..1 << 50) {
            let bits = bits_for(count as f64);
            prop_assert!(count < 1 << bits && count >= 1 << (bits - 1));
        }

        #[test]
        fn what_fits_is_the_most_that_fits(bits in 1u32..20, area in 1.0f64..1e4, node in 0usize..10) {
            let cell = &SRAM_CELLS[node];
            let bins = bins_within(area, bits, cell);
            let storage = |bins| Storage { bins, bin_bits: bits };
            prop_assert!(storage(bins).area_um2(cell) <= area * (1.0 + 1e-12));
            prop_assert!(storage(bins + 1).area_um2(cell) > area * (1.0 - 1e-12));
        }

        #[test]
        fn the_oldest_node_is_the_first_that_fits(bins in 1u32..4000, bits in 1u32..16) {
            let storage = Storage { bins, bin_bits: bits };
            if let Some(cell) = storage.oldest_node(225.0) {
                prop_assert!(storage.area_um2(cell) <= 225.0);
                let older = SRAM_CELLS.iter().filter(|c| c.node_nm > cell.node_nm);
                prop_assert!(older.into_iter().all(|c| storage.area_um2(c) > 225.0));
            }
        }
    }
}
