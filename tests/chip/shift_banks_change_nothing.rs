//! Long shift registers go through the kernel a word at a time. A kernel that handles instants in a random order takes them
//! flip-flop by flip-flop: every change of every net must be the same, whatever happens in a load path. Registers on their own are held by the tests of femtogate.

use guided_dtof::chip::{LoadPins, LoadProbe, load_path};
use guided_dtof::kernel::Drive;
use guided_dtof::netlist::{Corner, Library, Netlist, Timing};
use guided_dtof::units::Time;
use proptest::prelude::*;

use crate::traces::trace;

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, ..ProptestConfig::default() })]

    /// A load path of eight columns and more, broken off and begun anew.
    #[test]
    fn in_a_load_path(
        corner in prop::sample::select(Corner::ALL.to_vec()),
        (rows, cols) in (1usize..4, 8usize..12),
        half_ps in 60i64..3_000,
        bits in prop::collection::vec((any::<bool>(), 0u8..120), 50..600),
    ) {
        let netlist = Netlist::elaborate(&load_path::with_memories(rows, cols, 9));
        prop_assert!(LoadProbe::Row.bus(&netlist).len() > 64);
        let timing = Timing::nominal(&netlist, &Library::generic_40nm(), corner);
        let pins = LoadPins::find(&netlist);
        let all = [pins.resetb, pins.enable, pins.clk, pins.serial];
        let mut drives: Vec<Drive> = all.map(|n| Drive::new(Time::ZERO, n, false)).into();
        drives.push(Drive::new(Time::from_ns(2), pins.resetb, true));
        drives.push(Drive::new(Time::from_ns(3), pins.enable, true));
        let half = Time::from_ps(half_ps);
        let mut now = Time::from_ns(5);
        for (bit, what) in bits {
            drives.push(Drive::new(now, pins.serial, bit));
            drives.push(Drive::new(now + half, pins.clk, true));
            now += half * 2;
            drives.push(Drive::new(now, pins.clk, false));
            if what == 0 {
                drives.push(Drive::new(now, pins.enable, false));
                now += half;
                drives.push(Drive::new(now, pins.enable, true));
            }
        }
        let apart = trace(&netlist, &timing, drives.clone(), Some(1));
        prop_assert_eq!(trace(&netlist, &timing, drives, None), apart);
    }
}
