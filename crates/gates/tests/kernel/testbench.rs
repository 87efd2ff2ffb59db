//! Verilog that does to a circuit what was done to it in our kernel.

use std::fmt::Write as _;

use femtogate::kernel::Drive;
use femtogate::netlist::{Direction, Module, Netlist};
use femtogate::units::Time;

/// A testbench that replays `drives` into `top`.
pub fn testbench(top: &Module, netlist: &Netlist, drives: &[Drive], parameters: &str) -> String {
    let mut text = format!("module tb;\n{parameters}");
    let mut ports = Vec::new();
    let mut pins = Vec::new();
    for (direction, signal) in top.port_signals() {
        let name = &signal.name;
        if direction == Direction::Output {
            ports.push(format!(".{name}()"));
            continue;
        }
        ports.push(format!(".{name}({name})"));
        let width = signal.width();
        if signal.is_bus {
            writeln!(text, "  reg [{}:0] {name};", width - 1).unwrap();
            pins.extend((0..width).map(|bit| format!("{name}[{bit}]")));
        } else {
            writeln!(text, "  reg {name};").unwrap();
            pins.push(name.clone());
        }
    }
    writeln!(text, "  {} dut({});", top.name(), ports.join(", ")).unwrap();
    writeln!(text, "  initial begin").unwrap();
    let inputs = netlist.inputs();
    let mut now = Time::ZERO;
    for drive in drives {
        if drive.time > now {
            writeln!(text, "    #{};", (drive.time - now).as_fs()).unwrap();
            now = drive.time;
        }
        let pin = inputs.iter().position(|&net| net == drive.net).unwrap();
        writeln!(text, "    {} = 1'b{};", pins[pin], drive.value).unwrap();
    }
    writeln!(text, "  end\nendmodule").unwrap();
    text
}
