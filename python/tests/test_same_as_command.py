"""Python and the command line take the same road: the same numbers to the bit, the same sentences."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Command
from numpy.typing import NDArray

import gdtof

SMALL = ("--rows", 16, "--cols", 16)


def of_macropixels(report: dict[str, Any], key: str) -> NDArray[np.float64]:
    values = [pixel[key] for pixel in report["macropixels"]]
    rows, cols, _ = report["histograms_shape"]
    return np.array([np.nan if v is None else v for v in values], np.float64).reshape(rows, cols)


@pytest.mark.parametrize(
    ("options", "keys"),
    [
        (("--laser-cycles", 300), {"laser_cycles": 300}),
        (
            ("--seed", 7, "--laser-cycles", 200, "--engine", "cohort", "--false-alarm-rate", 0.01),
            {"seed": 7, "laser_cycles": 200, "engine": "cohort", "false_alarm_rate": 0.01},
        ),
        (
            ("--guide", "radar:range_sigma_m=0.2", "--guide", "stereo", "--windows", "unguided=neighbour,steps_in_doubt=true", "--laser-cycles", 200),
            {
                "guide": ["radar:range_sigma_m=0.2", "stereo"],
                "windows": {"unguided": "neighbour", "steps_in_doubt": True},
                "laser_cycles": 200,
            },
        ),
        (
            ("--bins-from-guide", "--windows", "within=0.8", "--no-walk-correction", "--laser-cycles", 200),
            {"bins_from_guide": True, "windows": {"within": 0.8}, "correct_walk": False, "laser_cycles": 200},
        ),
        (("--tolerance", 0.05, "--laser-cycles", 200), {"tolerance_m": 0.05, "laser_cycles": 200}),
        (("--no-skip", "--laser-cycles", 50), {"skip": False, "laser_cycles": 50}),
    ],
)
def test_a_frame(command: Command, tmp_path: Path, options: tuple[Any, ...], keys: dict[str, Any]) -> None:
    command("frame", *SMALL, "--probe", "none", "--out", tmp_path / "out", *options)
    report = json.loads((tmp_path / "out" / "frame.json").read_text())
    frame = gdtof.frame(gdtof.Sensor(rows=16, cols=16), **keys)
    assert np.array_equal(frame.histograms, np.load(tmp_path / "out" / "histograms.npy"))
    for array, key in [
        (frame.depth, "measured_m"),
        (frame.guide, "guide_m"),
        (frame.truth, "true_m"),
        (frame.peak, "peak_m"),
        (frame.confidence, "confidence"),
    ]:
        assert np.array_equal(array, of_macropixels(report, key), equal_nan=True), key
    reasons = [pixel["no_depth"] or "depth" for pixel in report["macropixels"]]
    assert [gdtof.Reason(int(r)).name.lower() for r in frame.reason.ravel()] == reasons
    assert frame.summary == report["summary"]
    assert frame.work == report["work"]
    assert frame.stop_periods == report["stop_periods"]
    assert frame.sensor.to_dict() == report["sensor"]
    timing = gdtof.timing(frame.sensor)
    found = {key: getattr(timing, key) for key in report["timing"]}
    assert found == report["timing"]


def test_a_frame_of_single_keys_of_sensor_and_scene(command: Command, tmp_path: Path) -> None:
    sets = ("--set", "sensor.clk_hz=300 MHz", "--set", "scene.object.car.reflectivity=0.8")
    command("frame", *SMALL, *sets, "--probe", "none", "--laser-cycles", 200, "--out", tmp_path / "out")
    sensor = gdtof.Sensor(rows=16, cols=16, clk_hz="300 MHz")
    scene = gdtof.Scene().with_({"object.car.reflectivity": 0.8})
    frame = gdtof.frame(sensor, scene, laser_cycles=200)
    assert np.array_equal(frame.histograms, np.load(tmp_path / "out" / "histograms.npy"))
    assert scene == gdtof.Scene("street", {"object.car.reflectivity": "80 %"})


def test_delay_lines_and_their_calibration(command: Command, tmp_path: Path) -> None:
    size = ("--sensor", "hslidar_delay_line", "--rows", 4, "--cols", 8)
    profile = tmp_path / "calibration.json"
    command("calibrate", *size, "--laser-cycles", 50, "--step-ps", 100, "--out", profile)
    periods = ("--stop-periods", 140, "--laser-cycles", 500)
    options = ("--calibration", profile, "--probe", "none", "--out", tmp_path / "out")
    command("frame", *size, *periods, *options)
    sensor = gdtof.Sensor("hslidar_delay_line", rows=4, cols=8)
    frame = gdtof.frame(sensor, stop_periods=140, laser_cycles=500, calibration=profile)
    assert np.array_equal(frame.histograms, np.load(tmp_path / "out" / "histograms.npy"))
    # Every macropixel has edges of its own.
    widths = np.diff(frame.bin_edges_ns, axis=2)
    assert len(np.unique(widths[np.isfinite(widths)])) > 20


def test_a_drive(command: Command, tmp_path: Path) -> None:
    options = ("--frames", 3, "--tracking", "--laser-cycles", 200, "--stop-periods", 300, "--no-pictures")
    command("drive", "van", *SMALL, *options, "--out", tmp_path / "out")
    sensor = gdtof.Sensor(rows=16, cols=16)
    frames = list(gdtof.drive("van", sensor, frames=3, tracking=True, laser_cycles=200, stop_periods=300))
    assert [frame.number for frame in frames] == [0, 1, 2]
    assert np.array_equal([f.histograms for f in frames], np.load(tmp_path / "out" / "histograms.npy"))
    lines = [json.loads(line) for line in (tmp_path / "out" / "frames.jsonl").read_text().splitlines()]
    for frame, line in zip(frames, lines, strict=True):
        assert frame.summary == line["summary"]
        assert frame.times == line["times"]
        assert frame.reused == line["reused"]


def test_a_replay(command: Command, tmp_path: Path) -> None:
    rows, cols, periods, cycles, n = 3, 4, 100, 20, 4000
    random = np.random.default_rng(1)
    sensor = gdtof.Sensor(rows=rows, cols=cols)
    end_fs = int(periods * cycles / sensor.clk_hz * 1e15)
    time_fs = random.integers(0, int(end_fs * 1.01), n)
    pixel, spad = random.integers(0, rows * cols, n), random.integers(0, 16, n)
    starts = random.integers(0, 60, (rows, cols))
    inits = ["row,col,init"] + [f"{r},{c},{starts[r, c]}" for r in range(rows) for c in range(cols)]
    (tmp_path / "inits.csv").write_text("\n".join(inits))
    lines = [f"{t},{p // cols},{p % cols},{s}" for t, p, s in zip(time_fs, pixel, spad, strict=True)]
    (tmp_path / "events.csv").write_text("\n".join(["time_fs,row,col,spad", *lines]))
    histograms = {}
    for engine in ("window", "cycle", "gate"):
        out = tmp_path / f"{engine}.npy"
        report = command(
            *("replay", "--rows", rows, "--cols", cols, "--engine", engine, "--json", "--out", out),
            *("--inits", tmp_path / "inits.csv", "--events", tmp_path / "events.csv"),
            *("--stop-periods", periods, "--laser-cycles", cycles),
        )
        replayed = gdtof.replay(
            time_fs, pixel, spad, starts, sensor=sensor, stop_periods=periods, laser_cycles=cycles, engine=engine
        )
        assert np.array_equal(replayed.histograms, np.load(out))
        told = json.loads(report)
        assert told["events"] == replayed.photons == n
        assert told["lost_to_dead_time"] == replayed.lost_to_dead_time
        assert told["after_the_end"] == replayed.after_the_end
        assert told["photons_that_cancel"] == replayed.cancelled
        histograms[engine] = replayed.histograms
    assert histograms["window"].sum() > 0
    assert np.array_equal(histograms["window"], histograms["gate"])


@pytest.mark.parametrize(
    ("options", "ask"),
    [
        (("--laser-cycles", 0), lambda: gdtof.frame(laser_cycles=0)),
        (("--false-alarm-rate", 2), lambda: gdtof.frame(false_alarm_rate=2.0)),
        (("--set", "sensor.rows=0"), lambda: gdtof.Sensor(rows=0)),
        (("--set", "sensor.rows=2.5"), lambda: gdtof.Sensor(rows=2.5)),  # type: ignore[arg-type]
        (("--set", "sensor.rows=true"), lambda: gdtof.Sensor(rows=True)),
        (("--set", "scene.lidar.pde=[1]"), lambda: gdtof.Scene("street", {"lidar.pde": [1]})),
        (("--set", "scene.lidar.pde=2"), lambda: gdtof.Scene("street", {"lidar.pde": 2})),
        (("--sensor", "hslidr"), lambda: gdtof.Sensor("hslidr")),
        (("--scene", "strret"), lambda: gdtof.Scene("strret")),
        (("--scene", "nowhere.toml"), lambda: gdtof.Scene("nowhere.toml")),
        (("--guide", "lidar"), lambda: gdtof.frame(guide="lidar")),
        (("--windows", "x=1"), lambda: gdtof.frame(windows={"x": 1})),
        (("--sensor", "hslidar_delay_line", "--engine", "cycle"), lambda: gdtof.frame("hslidar_delay_line", engine="cycle")),
    ],
)
def test_sentences(command: Command, tmp_path: Path, options: tuple[Any, ...], ask: Any) -> None:
    said = command("frame", *options, "--out", tmp_path / "out", fails=True).strip()
    with pytest.raises(gdtof.InputError) as raised:
        ask()
    # The command line writes its options as such.
    names = {"--laser-cycles": "laser_cycles", "--false-alarm-rate": "false_alarm_rate", "--guide": "guide"}
    names |= {"--windows": "windows", "--engine window": 'engine = "window"'}
    said = said.removeprefix("gdtof: ").removeprefix("error: ")
    for option, key in names.items():
        said = said.replace(option, key)
    # Python says in which call a key stands.
    said = re.sub(r"^--set (sensor|scene)\.(.*?): ", lambda found: f"{found[1].title()}({found[2]}): ", said)
    assert str(raised.value) == said
