//! How fast changes become a waveform file: 10 million of them, as a VCD and as an FST file. The writer must never be
//! what a simulation waits for; the kernel makes a few ten million changes a second.

use std::hint::black_box;
use std::io::{self, Cursor};

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use guided_dtof::kernel::Observer;
use guided_dtof::logic::Logic;
use guided_dtof::netlist::{CellKind, ModuleBuilder, NetId, Netlist};
use guided_dtof::units::Time;
use guided_dtof::waves::{Format, FstWriter, VcdWriter, WaveSelection, WaveWriter};

const CHANGES: u64 = 10_000_000;
const NETS: usize = 1 << 12;
const BUS_WIDTH: usize = 14;

/// Many inverters from one input to named outputs: scalars, or 14-bit buses.
fn netlist(is_bus: bool) -> Netlist {
    let mut m = ModuleBuilder::new("top");
    let input = m.input("A");
    let width = if is_bus { BUS_WIDTH } else { 1 };
    for i in 0..NETS / width {
        let name = format!("Z{i}");
        let outputs = if is_bus {
            m.output_bus(&name, width)
        } else {
            vec![m.output(&name)]
        };
        for output in outputs {
            m.gate_into(CellKind::Inv, &[input], output);
        }
    }
    Netlist::elaborate(&m.finish().expect("the circuit is sound"))
}

/// Toggles all nets in turn, `per_instant` of them at a time, 7 ps apart.
fn write(writer: WaveWriter<impl Format>, netlist: &Netlist, per_instant: u64) {
    let mut writer = writer;
    // Net 0 is the input; the outputs follow in order.
    let nets = netlist.net_count() as u64 - 1;
    let mut time = Time::from_ns(1_000_000);
    for i in 0..CHANGES {
        if i % per_instant == 0 {
            time += Time::from_ps(7);
        }
        let net = NetId::new((1 + i % nets) as usize);
        writer.change(time, net, Logic::from(i / nets % 2 == 1));
    }
    black_box(writer.finish(time).expect("memory takes all"));
}

fn waves(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("waves");
    group
        .throughput(Throughput::Elements(CHANGES))
        .sample_size(10);
    let (scalars, buses) = (netlist(false), netlist(true));
    let cases = [
        ("scalars, 16 an instant", &scalars, 16),
        ("scalars, each at its own time", &scalars, 1),
        ("14-bit buses, each bit at its own time", &buses, 1),
        ("14-bit buses, all bits at once", &buses, BUS_WIDTH as u64),
    ];
    let all = WaveSelection::all();
    for (name, netlist, per_instant) in cases {
        group.bench_function(format!("vcd: {name}"), |b| {
            let writer = || VcdWriter::new(io::sink(), netlist, &all).expect("a sink");
            b.iter(|| write(writer(), netlist, per_instant));
        });
        group.bench_function(format!("fst: {name}"), |b| {
            let writer = || {
                let file = Cursor::new(Vec::new());
                FstWriter::new(file, netlist, &all).expect("memory takes all")
            };
            b.iter(|| write(writer(), netlist, per_instant));
        });
    }
    group.finish();
}

criterion_group!(benches, waves);
criterion_main!(benches);
