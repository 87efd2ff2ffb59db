//! The same sensor and stimulus for any Verilog simulator.
//!
//! A folder of four files: `cells.v` (cell models with the delays of the corner), `design.v` (the
//! structural netlist), `stimulus.txt` (every change of every input pin: time in fs, pin, value) and `tb.v`, which
//! replays the stimulus (and, where cells have delays of their own, includes `delays.v`) and writes `histograms.csv` and `local_stops.csv`, and `dut.vcd` when run with `+vcd`.

use std::io::{self, Write};
use std::path::Path;

use super::stimulus::{Pins, StimulusPlan};
use crate::chip::{SensorConfig, histogram, sensor};
use crate::files::{InputError, OutputFile, create_folder};
use crate::netlist::{
    Direction, Library, Module, Netlist, Timing, write_cells, write_delays, write_modules,
    write_parametric_cells,
};

/// Writes cells, netlist, stimulus and testbench of the whole array into `folder`.
///
/// # Errors
/// When the folder or a file in it cannot be written.
pub fn export_verilog(
    folder: &Path,
    config: &SensorConfig,
    plan: &StimulusPlan<'_>,
) -> Result<(), InputError> {
    export(folder, config, plan, None)
}

/// As [`export_verilog`], with the delays of `timing`, which is that of [`sensor::circuit`]: cells take
/// delays as parameters, and a fifth file, `delays.v`, sets those that differ from the library.
///
/// # Errors
/// As [`export_verilog`].
pub fn export_annotated_verilog(
    folder: &Path,
    config: &SensorConfig,
    plan: &StimulusPlan<'_>,
    timing: &Timing,
) -> Result<(), InputError> {
    export(folder, config, plan, Some(timing))
}

fn export(
    folder: &Path,
    config: &SensorConfig,
    plan: &StimulusPlan<'_>,
    timing: Option<&Timing>,
) -> Result<(), InputError> {
    let top = sensor::circuit(config);
    let netlist = Netlist::elaborate(&top);
    create_folder(folder)?;
    let file = |name: &str| folder.join(name);
    OutputFile::write_with(&file("cells.v"), |out| {
        let library = Library::default();
        match timing {
            None => write_cells(out, &library, config.corner),
            Some(_) => write_parametric_cells(out, &library, config.corner),
        }
    })?;
    if let Some(timing) = timing {
        OutputFile::write_with(&file("delays.v"), |out| {
            let library = Timing::nominal(&netlist, &Library::default(), config.corner);
            write_delays(out, "dut", &netlist, timing, &library)
        })?;
    }
    OutputFile::write_with(&file("design.v"), |out| write_modules(out, &top))?;
    OutputFile::write_with(&file("stimulus.txt"), |out| {
        write_stimulus(out, &netlist, plan)
    })?;
    OutputFile::write_with(&file("tb.v"), |out| {
        write_testbench(out, &top, config, plan, timing.is_some())
    })
}

fn write_stimulus(
    out: &mut dyn Write,
    netlist: &Netlist,
    plan: &StimulusPlan<'_>,
) -> io::Result<()> {
    let mut pin_of_net = vec![0; netlist.net_count()];
    for (pin, net) in netlist.inputs().into_iter().enumerate() {
        pin_of_net[net.index()] = pin;
    }
    for drive in plan.stimulus(&Pins::of(netlist)) {
        let (time_fs, pin) = (drive.time.as_fs(), pin_of_net[drive.net.index()]);
        writeln!(out, "{time_fs} {pin} {}", drive.value)?;
    }
    Ok(())
}

fn write_testbench(
    out: &mut dyn Write,
    top: &Module,
    config: &SensorConfig,
    plan: &StimulusPlan<'_>,
    is_annotated: bool,
) -> io::Result<()> {
    let include = if is_annotated {
        "  `include \"delays.v\"\n"
    } else {
        ""
    };
    let schedule = plan.schedule();
    let name = top.name();
    let mut pins = 0;
    let mut ports = Vec::new();
    for (direction, signal) in top.port_signals() {
        let connection = match direction {
            Direction::Output => "local_stop".to_owned(),
            Direction::Input => {
                let low = pins;
                pins += signal.width();
                if signal.is_bus {
                    format!("pins[{}:{low}]", pins - 1)
                } else {
                    format!("pins[{low}]")
                }
            }
        };
        ports.push(format!("    .{}({connection})", signal.name));
    }
    let (pixels, cols) = (config.pixels(), config.cols);
    write!(
        out,
        "\
// iverilog -g2005 -o sim tb.v design.v cells.v && vvp sim +vcd
`timescale 1fs/1fs
module tb;
  reg [{last_pin}:0] pins;
  wire [{last_pixel}:0] local_stop;
  reg value;
  reg [63:0] at;
  integer stimulus, histograms, stops, pin;

  {name} dut(
{ports}
  );
{include}
  genvar i;
  generate
    for (i = 0; i < {pixels}; i = i + 1) begin : watch
      // Times count from the first rising edge of STOP.
      always @(posedge local_stop[i])
        if ($time >= {origin})
          $fwrite(stops, \"%0d,%0d,%0d\\n\", i / {cols}, i % {cols}, $time - {origin});
    end
  endgenerate

  initial begin
    stimulus = $fopen(\"stimulus.txt\", \"r\");
    stops = $fopen(\"local_stops.csv\", \"w\");
    $fwrite(stops, \"row,col,time_fs\\n\");
    if ($test$plusargs(\"vcd\")) begin
      $dumpfile(\"dut.vcd\");
      $dumpvars(0, dut);
    end
    while ($fscanf(stimulus, \"%d %d %b\", at, pin, value) == 3) begin
      if (at > $time) #(at - $time);
      pins[pin] = value;
    end
    if ({end} > $time) #({end} - $time);
    histograms = $fopen(\"histograms.csv\", \"w\");
    $fwrite(histograms, \"row,col,bin,count\\n\");
",
        last_pin = pins - 1,
        last_pixel = pixels - 1,
        ports = ports.join(",\n"),
        origin = schedule.origin.as_fs(),
        end = schedule.end.as_fs(),
    )?;
    for pixel in 0..pixels {
        let (row, col) = (pixel / cols, pixel % cols);
        let path = sensor::pixel_name(row, col);
        for bin in 0..config.bins {
            let count = histogram::bin_name(bin);
            writeln!(
                out,
                "    $fwrite(histograms, \"{row},{col},{bin},%0d\\n\", dut.{path}.histogram.{count});"
            )?;
        }
    }
    write!(
        out,
        "\
    $fclose(histograms);
    $fclose(stops);
    $finish;
  end
endmodule
"
    )
}
