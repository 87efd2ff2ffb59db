//! The same sensor and stimulus for Verilog tools.
//!
//! A folder of three files, whatever is done with it:
//!
//! | file | what it is |
//! |---|---|
//! | `design.v` | the structural netlist |
//! | `cells.v` | cells that agree with our kernel to the femtosecond, in the sensor's corner: Icarus Verilog |
//! | `cells_specify.v` | cells with `specify` blocks in three corners, which take SDF: any tool |
//!
//! For a stimulus there are `stimulus.txt` (every change of every input pin: time in fs, pin, value) and `tb.v`, which
//! replays it on either cells, and writes `histograms.csv` and `local_stops.csv`, for a plan with a readout what the pins tell of the
//! histograms as `readout.csv`, and `dut.vcd` when run with `+vcd`.
//! Compiled with the macro `SDF`, the name of a delay file in quotes, it annotates that onto `cells_specify.v`. Where
//! cells have delays of their own without it, it includes `delays.v`, which sets the parameters of `cells.v`.

use std::io::{self, Write};
use std::path::Path;

use super::plan::StimulusPlan;
use crate::chip::readout::ReadoutOrder;
use crate::chip::{ReadProbe, SensorConfig, SensorPins, Silicon, array, probes};
use crate::files::{InputError, OutputFile, create_folder};
use crate::netlist::{Chain, Corner, Direction, Module, Netlist, Timing};
use crate::units::Time;
use crate::verilog::{
    write_cells, write_delays, write_modules, write_parametric_cells, write_standard_cells,
};

/// What is exported of a sensor.
#[derive(Clone, Copy)]
pub struct Export<'a> {
    /// Name of the top module.
    pub top: &'a str,
    /// For a testbench.
    pub plan: Option<&'a StimulusPlan>,
    /// Delays of [`array::circuit`]'s cells, where they are not the library's: the cells of `cells.v` take delays as parameters then,
    /// and one more file, `delays.v`, sets those that differ from the library.
    pub timing: Option<&'a Timing>,
}

impl Export<'_> {
    /// Writes cells and netlist of the whole array and, for a plan, stimulus and testbench into `folder`.
    ///
    /// # Errors
    /// When the folder or a file in it cannot be written.
    pub fn write(self, folder: &Path, config: &SensorConfig) -> Result<(), InputError> {
        let (silicon, corner) = (Silicon::new(config), config.corner);
        let library = silicon.cell_library.cells();
        let top = array::circuit(config);
        let netlist = Netlist::elaborate(&top);
        let has_own =
            !netlist.own_delays().is_empty() || silicon.cell_library.from_file().is_some();
        let own = has_own.then(|| silicon.timing(&netlist));
        let timing = self.timing.or(own.as_ref());
        let chains = Chain::all(&netlist);
        let top = top.renamed(self.top);

        create_folder(folder)?;
        let file = |name: &str| folder.join(name);
        OutputFile::write_with(&file("cells.v"), |out| match timing {
            None => write_cells(out, library, corner),
            Some(_) => write_parametric_cells(out, library, &chains, corner),
        })?;
        OutputFile::write_with(&file("cells_specify.v"), |out| {
            write_standard_cells(out, library, &chains)
        })?;
        OutputFile::write_with(&file("design.v"), |out| write_modules(out, &top))?;
        if let Some(timing) = timing {
            let nominal = Timing::of_library(&netlist, library, corner);
            OutputFile::write_with(&file("delays.v"), |out| {
                write_delays(out, "dut", &netlist, timing, &nominal)
            })?;
        }
        if let Some(plan) = self.plan {
            OutputFile::write_with(&file("stimulus.txt"), |out| {
                write_stimulus(out, &netlist, plan)
            })?;
            OutputFile::write_with(&file("tb.v"), |out| {
                write_testbench(out, &top, config, plan, timing.is_some())
            })?;
        }
        Ok(())
    }
}

/// Writes the chip of a sensor into `folder`: see [`Export`], whose top module has the chip's own name.
///
/// # Errors
/// Output that cannot be written.
pub fn export_verilog(
    folder: &Path,
    config: &SensorConfig,
    plan: Option<&StimulusPlan>,
    timing: Option<&Timing>,
) -> Result<(), InputError> {
    let top = array::NAME;
    Export { top, plan, timing }.write(folder, config)
}

fn write_stimulus(out: &mut dyn Write, netlist: &Netlist, plan: &StimulusPlan) -> io::Result<()> {
    let mut pin_of_net = vec![0; netlist.net_count()];
    for (pin, net) in netlist.inputs().into_iter().enumerate() {
        pin_of_net[net.index()] = pin;
    }
    for drive in plan.stimulus(&SensorPins::find(netlist)) {
        let (time_fs, pin) = (drive.time.as_fs(), pin_of_net[drive.net.index()]);
        writeln!(out, "{time_fs} {pin} {}", drive.value)?;
    }
    Ok(())
}

fn write_testbench(
    out: &mut dyn Write,
    top: &Module,
    config: &SensorConfig,
    plan: &StimulusPlan,
    is_annotated: bool,
) -> io::Result<()> {
    let include = if is_annotated {
        "`ifndef SDF\n  `include \"delays.v\"\n`endif\n"
    } else {
        ""
    };
    let schedule = plan.schedule;
    let name = top.name();
    let mut pins = 0;
    let (mut ports, mut outputs) = (Vec::new(), Vec::new());
    let mut read_clk = 0;
    for (direction, signal) in top.port_signals() {
        let connection = match direction {
            Direction::Output => {
                let wire = signal.name.to_lowercase();
                outputs.push(format!("  wire [{}:0] {wire};\n", signal.width() - 1));
                wire
            }
            Direction::Input => {
                let low = pins;
                read_clk = if signal.name == ReadProbe::Clk.path() {
                    low
                } else {
                    read_clk
                };
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
// iverilog -g2005 -gspecify -T{delays} -DSDF='\"chip.sdf\"' -o sim tb.v design.v cells_specify.v && vvp sim
`timescale 1fs/1fs
module tb;
  reg [{last_pin}:0] pins;
{outputs}  reg value;
  reg [63:0] at;
  integer stimulus, histograms, stops, pin;

  {name} dut(
{ports}
  );
{include}
{sampler}  genvar i;
  generate
    for (i = 0; i < {pixels}; i = i + 1) begin : watch
      // Times count from the first rising edge of STOP.
      always @(posedge local_stop[i])
        if ($time >= {origin})
          $fwrite(stops, \"%0d,%0d,%0d\\n\", i / {cols}, i % {cols}, $time - {origin});
    end
  endgenerate

  initial begin
`ifdef SDF
    $sdf_annotate(`SDF, dut);
`endif
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
        delays = match config.corner {
            Corner::Fast => "min",
            Corner::Typ => "typ",
            Corner::Slow => "max",
        },
        last_pin = pins - 1,
        outputs = outputs.concat(),
        ports = ports.join(",\n"),
        sampler = plan.readout().map_or(String::new(), |order| sampler(&order, read_clk, schedule.counted)),
        origin = schedule.origin.as_fs(),
        end = schedule.end.as_fs(),
    )?;
    for pixel in 0..pixels {
        let (row, col) = (pixel / cols, pixel % cols);
        let path = array::pixel_name(row, col);
        for bin in 0..config.bins {
            let count = probes::bin_path(&path, bin);
            writeln!(
                out,
                "    $fwrite(histograms, \"{row},{col},{bin},%0d\\n\", dut.{count});"
            )?;
        }
    }
    if plan.readout().is_some() {
        writeln!(out, "    write_readout;")?;
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

/// Verilog that samples DATA_OUT with the falling edges of pin `clk`, and a task that writes what it has seen.
fn sampler(order: &ReadoutOrder, clk: usize, counted: Time) -> String {
    let ReadoutOrder {
        rows,
        cols,
        bins,
        bits,
        cols_per_pin,
    } = *order;
    format!(
        "\
  // Counts as the pins tell them, most significant bit first.
  reg [{last_bit}:0] counts[0:{last_count}];
  integer readout, period, word, column, out, count;
  initial period = 0;
  always @(negedge pins[{clk}])
    if ($time > {counted}) begin
      word = period / {word_periods};
      for (out = 0; out < {pins}; out = out + 1) begin
        column = out * {cols_per_pin} + period % {word_periods} / {bits};
        if (column < {cols}) begin
          count = (word / {bins} * {cols} + column) * {bins} + word % {bins};
          counts[count] = counts[count] << 1 | data_out[out];
        end
      end
      period = period + 1;
    end
  task write_readout;
    begin
      readout = $fopen(\"readout.csv\", \"w\");
      $fwrite(readout, \"row,col,bin,count\\n\");
      for (count = 0; count <= {last_count}; count = count + 1)
        $fwrite(readout, \"%0d,%0d,%0d,%0d\\n\", count / {row}, count / {bins} % {cols}, count % {bins}, counts[count]);
      $fclose(readout);
    end
  endtask
",
        last_bit = bits - 1,
        last_count = rows * cols * bins - 1,
        word_periods = order.word_periods(),
        pins = order.pins(),
        row = cols * bins,
        counted = counted.as_fs(),
    )
}
