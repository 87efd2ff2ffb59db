//! Switching activity and its SAIF file tell what the waveform of the same run shows, counted from the dump; and of pulses
//! that no dump has, what each cell by itself makes of the waves at its pins.

use std::io::Cursor;

use femtogate::kernel::{Activity, Kernel, Stimulus};
use femtogate::netlist::Netlist;
use femtogate::units::Time;
use femtogate::waves::{VcdWriter, WaveSelection};
use proptest::prelude::*;

use crate::every_edge::circuit::{self, Case};
use crate::every_edge::waves::Waves;
use crate::saif::{compare, saif};

fn random_circuit(case: &Case) -> Result<(), TestCaseError> {
    let netlist = Netlist::elaborate(&case.circuit());
    let drives = case.drives(&netlist);
    let end = drives.last().map_or(Time::ZERO, |d| d.time) + Time::from_ns(2);
    let all = WaveSelection::all().with_anonymous();
    let mut dump = VcdWriter::new(Vec::new(), &netlist, &all).unwrap();
    let mut activity = Activity::new(&netlist, Time::ZERO);
    let timing = case.timing(&netlist);
    let mut kernel = Kernel::new(&netlist, &timing);
    kernel
        .run(
            &mut Stimulus::sorted(drives),
            end,
            &mut (&mut dump, &mut activity),
        )
        .unwrap();
    let dump = Cursor::new(dump.finish(end).unwrap());
    let waves = Waves::read(dump, &netlist.scopes()[0].name);
    let text = saif(&netlist, &activity, end);
    compare(&text, (&netlist, &timing), &waves, end)?;
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 120, ..ProptestConfig::default() })]

    #[test]
    fn in_random_circuits(case in prop_oneof![circuit::flat(), circuit::hierarchical()]) {
        random_circuit(&case)?;
    }
}
