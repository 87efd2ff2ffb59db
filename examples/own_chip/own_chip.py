"""A chip of another architecture in the light of a room: from photons to a depth map.

    python examples/own_chip/own_chip.py out

`gdtof` draws the SPAD pulses. `coarse_tdc.v` runs under cocotb in Icarus, or in the simulator that SIM names. Its counts are compared with a
model of twenty lines, one by one. Then they are ranged, and the depths compared with the scene's truth.
"""

import os
import sys
from pathlib import Path

import cocotb
import gdtof
import numpy as np
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer
from gdtof.cocotb import CountMonitor, Laser, Scoreboard, SpadPins, run_together

HERE = Path(__file__).parent
OUT = Path(os.environ.get("OWN_CHIP_OUT", "out")).absolute()
ROWS = COLS = 16
BINS = 32
CLK_NS = 8.0
LASER_CYCLES = 500
PERIOD_NS = 320.0
STOP_HIGH_NS = 2.0
# STOP rises this much after an edge of CLK, so that bin 0 begins before it.
STOP_AFTER_CLK_NS = 1.0


def light_of_the_room() -> gdtof.Light:
    return gdtof.light(HERE / "room.toml", gdtof.Sensor(rows=ROWS, cols=COLS), spads=1)


def photons_of(light: gdtof.Light) -> gdtof.Photons:
    return light.photons(PERIOD_NS, LASER_CYCLES, seed=1)


def model(photons: gdtof.Photons) -> np.ndarray:
    """What the chip should count: the first photon of each laser cycle that comes after STOP has fallen."""
    after_fs = photons.time_fs - photons.laser_cycle * round(1e6 * PERIOD_NS)
    caught = after_fs >= 1e6 * STOP_HIGH_NS
    pixel, cycle, after_fs = photons.pixel[caught], photons.laser_cycle[caught], after_fs[caught]
    # Photons are in the order of pixels and times: the first of each pixel and laser cycle.
    _, first = np.unique(pixel * LASER_CYCLES + cycle, return_index=True)
    bins = (after_fs[first] + round(1e6 * STOP_AFTER_CLK_NS)) // round(1e6 * CLK_NS)
    counts = np.zeros((ROWS * COLS, BINS), dtype=np.int64)
    within = bins < BINS
    np.add.at(counts, (pixel[first][within], bins[within]), 1)
    return counts


@cocotb.test()
async def every_count_is_the_model_s(dut) -> None:
    light = light_of_the_room()
    photons = photons_of(light)
    dut.stop.value = dut.spad.value = dut.read.value = 0
    dut.rst.value = 1
    await Timer(1, unit="ns")
    dut.rst.value = 0
    cocotb.start_soon(Clock(dut.clk, CLK_NS, unit="ns").start())
    # A rising edge of CLK comes with the clock's start, and each period after it.
    await Timer(4 * CLK_NS + STOP_AFTER_CLK_NS, unit="ns")
    await run_together(
        Laser(dut.stop, period_ns=PERIOD_NS, laser_cycles=LASER_CYCLES, high_ns=STOP_HIGH_NS),
        SpadPins(dut.spad, photons, light.pulse_ns),
    )
    await Timer(PERIOD_NS, unit="ns")
    counts = await read_out(dut)
    np.save(OUT / "counts.npy", counts.reshape(ROWS, COLS, BINS).astype(np.uint16))
    assert counts.sum() > 0.5 * ROWS * COLS * LASER_CYCLES * 0.3, "hardly anything counts"
    off = Scoreboard(model(photons)).report(counts)
    assert not off, off


async def read_out(dut) -> np.ndarray:
    monitor = CountMonitor(dut.clk, dut.read_valid, dut.read_count, (ROWS * COLS, BINS))
    for pixel in range(ROWS * COLS):
        for one in range(BINS):
            await FallingEdge(dut.clk)
            dut.read.value, dut.read_pixel.value, dut.read_bin.value = 1, pixel, one
    await FallingEdge(dut.clk)
    dut.read.value = 0
    return await monitor.counts(within_ns=10 * CLK_NS)


def simulate() -> None:
    from cocotb_tools.check_results import get_results
    from cocotb_tools.runner import get_runner

    OUT.mkdir(parents=True, exist_ok=True)
    runner = get_runner(os.environ.get("SIM", "icarus"))
    runner.build(sources=[HERE / "coarse_tdc.v"], hdl_toplevel="coarse_tdc", build_dir=OUT / "sim", always=True)
    results = runner.test(
        hdl_toplevel="coarse_tdc",
        test_module="own_chip",
        test_dir=OUT / "sim",
        extra_env={"PYTHONPATH": str(HERE), "OWN_CHIP_OUT": str(OUT)},
    )
    if get_results(results)[1]:
        sys.exit("the chip does not count as its model does")


def range_counts() -> None:
    light = light_of_the_room()
    counts = np.load(OUT / "counts.npy")
    detector = gdtof.Detector(bins=BINS, bin_ns=CLK_NS, pulse_fwhm_ns=12.0, start_ns=-STOP_AFTER_CLK_NS, first_of=LASER_CYCLES)
    found = detector.range(counts)
    seen = np.isfinite(found.depth) & np.isfinite(light.truth_m)
    off = found.depth[seen] - light.truth_m[seen]
    within = np.abs(off) < 3 * found.bound[seen]
    print(f"{seen.sum()} of {seen.size} pixels have a depth; {within.sum()} are within three bounds of the truth")
    print(f"median error {np.median(np.abs(off)):.3f} m, median bound {np.nanmedian(found.bound):.3f} m; a bin is {0.1498962 * CLK_NS:.1f} m")
    try:
        import matplotlib
    except ImportError:
        print("no matplotlib: no picture")
        return
    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, 2, figsize=(9, 4), layout="constrained")
    for axis, title, depth in zip(axes, ("the chip's depths, m", "truth, m"), (found.depth, light.truth_m), strict=True):
        shown = axis.imshow(depth, vmin=5, vmax=26, cmap="viridis_r")
        axis.set_title(title)
    figure.colorbar(shown, ax=axes)
    figure.savefig(OUT / "depth.png")
    print(f"{OUT / 'depth.png'}: the depth map beside the truth")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        OUT = Path(sys.argv[1]).absolute()
    simulate()
    range_counts()
