//! Every start value sent through the serial pin arrives in its macropixel's memory, at gate level, for any array.

use guided_dtof::chip::SensorConfig;
use guided_dtof::engine::load::{load, load_netlist};
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]

    #[test]
    fn through_deserialiser_and_row_scanner(
        rows in 1usize..9,
        cols in 1usize..9,
        counter_bits in 2usize..12,
        load_clk_mhz in 50f64..800.0,
        seed: u64,
    ) {
        let config = SensorConfig {
            rows,
            cols,
            counter_bits,
            load_clk_hz: load_clk_mhz * 1e6,
            ..SensorConfig::default()
        };
        let starts: Vec<u16> = (0..config.pixels())
            .map(|i| (seed.rotate_left(i as u32 * 7) >> 13) as u16 & config.largest_start())
            .collect();
        let found = load(&config, &load_netlist(&config), &starts, &mut ());
        let expected: Vec<Option<u16>> = starts.into_iter().map(Some).collect();
        prop_assert_eq!(found.starts, expected);
    }
}

#[test]
fn a_whole_array_of_64_by_64() {
    let config = SensorConfig::default();
    let starts: Vec<u16> = (0..4096u32)
        .map(|i| (i.wrapping_mul(2_654_435_761) >> 7) as u16 & 511)
        .collect();
    let found = load(&config, &load_netlist(&config), &starts, &mut ());
    assert!(
        found
            .starts
            .iter()
            .zip(&starts)
            .all(|(f, s)| *f == Some(*s))
    );
}
