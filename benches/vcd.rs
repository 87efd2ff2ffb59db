//! How fast changes become lines of a value change dump. The writer must never be what a
//! simulation waits for; the kernel makes a few ten million changes a second.

use std::hint::black_box;
use std::io;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use guided_dtof::kernel::Observer;
use guided_dtof::logic::Logic;
use guided_dtof::netlist::{CellKind, ModuleBuilder, NetId, Netlist};
use guided_dtof::units::Time;
use guided_dtof::waves::{Selection, VcdWriter};

const CHANGES: u64 = 1 << 20;
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
fn write(netlist: &Netlist, per_instant: u64) {
    let mut writer = VcdWriter::new(io::sink(), netlist, &Selection::all()).expect("a sink");
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
    black_box(writer.finish(time).expect("a sink"));
}

fn vcd(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("vcd");
    group.throughput(Throughput::Elements(CHANGES));
    let scalars = netlist(false);
    group.bench_function("scalars, 16 an instant", |b| {
        b.iter(|| write(&scalars, 16));
    });
    group.bench_function("scalars, each at its own time", |b| {
        b.iter(|| write(&scalars, 1));
    });
    let buses = netlist(true);
    group.bench_function("14-bit buses, each bit at its own time", |b| {
        b.iter(|| write(&buses, 1));
    });
    group.bench_function("14-bit buses, all bits at once", |b| {
        b.iter(|| write(&buses, BUS_WIDTH as u64));
    });
    group.finish();
}

criterion_group!(benches, vcd);
criterion_main!(benches);
