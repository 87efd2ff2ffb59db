"""A frame that is saved is the set of files that the command writes, and the command reads it."""

from __future__ import annotations

import copy
import html
import json
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Command

import gdtof

SMALL = ("--rows", 16, "--cols", 16, "--probe", "none")
FILES = {"frame.json", "histograms.npy", "depth.png", "manifest.json"}


def told(folder: Path, file: str = "frame.json") -> dict[str, Any]:
    """What frame.json says, but for how long it took."""
    report: dict[str, Any] = json.loads((folder / file).read_text())
    return {key: value for key, value in report.items() if "run_time" not in key}


@pytest.mark.parametrize(
    ("options", "keys"),
    [
        (("--laser-cycles", 200), {"laser_cycles": 200}),
        (("--scene", "fog", "--seed", 7, "--laser-cycles", 50), {"scene": "fog", "seed": 7, "laser_cycles": 50}),
        (
            (*"--guide radar --guide stereo --windows unguided=neighbour,within=0.8 --bins-from-guide --laser-cycles".split(), 50),
            {
                "guide": ["radar", "stereo"],
                "windows": {"unguided": "neighbour", "within": 0.8},
                "bins_from_guide": True,
                "laser_cycles": 50,
            },
        ),
        (
            ("--tolerance", 0.05, "--false-alarm-rate", 0.01, "--no-walk-correction", "--laser-cycles", 50),
            {"tolerance_m": 0.05, "false_alarm_rate": 0.01, "correct_walk": False, "laser_cycles": 50},
        ),
    ],
)
def test_a_saved_frame_is_the_commands(
    command: Command, tmp_path: Path, options: tuple[Any, ...], keys: dict[str, Any]
) -> None:
    theirs, ours = tmp_path / "theirs", tmp_path / "ours"
    command("frame", *SMALL, "--out", theirs, *options)
    frame = gdtof.frame(gdtof.Sensor(rows=16, cols=16), **keys)
    assert frame.save(ours) == ours
    assert {path.name for path in ours.iterdir()} == {path.name for path in theirs.iterdir()} == FILES
    assert told(ours) == told(theirs)
    for name in ("histograms.npy", "depth.png"):
        assert (ours / name).read_bytes() == (theirs / name).read_bytes(), name
    manifests = [json.loads((folder / "manifest.json").read_text()) for folder in (ours, theirs)]
    assert manifests[0]["configuration"] == manifests[1]["configuration"]
    assert manifests[0]["complete"] and manifests[0]["command"] == "frame"


def test_hints_are_data(command: Command, tmp_path: Path) -> None:
    """Cars nearer than the camera pair begins have no guide."""
    scene = gdtof.Scene("street", {"stereo.max_disparity_px": 180})
    frame = gdtof.frame(gdtof.Sensor(rows=32, cols=32), scene, laser_cycles=200)
    hint, *others = frame.hints
    without = (frame.reason == gdtof.Reason.NO_GUIDE) & np.isfinite(frame.truth)
    assert hint.reason is gdtof.Reason.NO_GUIDE and hint.surfaces == np.count_nonzero(without) > 0
    assert html.escape(hint.sentence) in frame._repr_html_()
    assert frame.to_xarray().attrs["hints"] == "\n".join(each.sentence for each in frame.hints)
    frame.save(tmp_path / "ours")
    words = "frame --rows 32 --cols 32 --probe none --laser-cycles 200 --set scene.stereo.max_disparity_px=180 --out".split()
    assert hint.sentence in command(*words, tmp_path / "theirs")
    hints = told(tmp_path / "ours")["hints"]
    assert hints == told(tmp_path / "theirs")["hints"]
    assert hints[0] == {"reason": "no_guide", "surfaces": hint.surfaces, "sentence": hint.sentence} and len(hints) == 1 + len(others)
    assert pickle.loads(pickle.dumps(frame)).hints == frame.hints


@pytest.mark.parametrize("of", ["plain", "map", "starts", "tracking", "probed"])
def test_the_command_reads_what_is_saved(command: Command, tmp_path: Path, of: str) -> None:
    sensor = gdtof.Sensor(rows=16, cols=16)
    ways: dict[str, dict[str, Any]] = {
        "plain": {},
        "map": {"guide": gdtof.Scene().truth(16, 16)},
        "starts": {"starts": 60},
        "tracking": {"tracking": True},
        "probed": {"probes": [(8, 8)], "waves": tmp_path},
    }
    frame = gdtof.frame(sensor, laser_cycles=100, **ways[of])
    folder = frame.save(str(tmp_path / "deep" / "frame"))
    command("export", "frame", folder, "--out", tmp_path / "export")
    arrays = np.load(tmp_path / "export" / "frame.npz")
    assert np.array_equal(arrays["depth_m"], frame.depth.astype(np.float32), equal_nan=True)
    assert np.array_equal(arrays["histograms"], frame.histograms)
    assert np.array_equal(arrays["start"], frame.start)
    ply = (tmp_path / "export" / "frame.ply").read_bytes()
    body = ply[ply.index(b"end_header\n") + len(b"end_header\n") :]
    fields = [(name, "<f4") for name in ("x", "y", "z", "intensity", "confidence")]
    cloud = np.frombuffer(body, np.dtype([*fields, ("row", "<u2"), ("col", "<u2"), ("return", "<u2")]))
    assert len(cloud) == np.count_nonzero(np.isfinite(frame.returns))
    cloud = cloud[cloud["return"] == 1]
    points = np.stack([cloud["x"], cloud["y"], cloud["z"]], axis=1)
    assert len(points) > 0 and np.array_equal(points, frame.points.astype(np.float32))
    assert np.array_equal(np.stack([cloud["row"], cloud["col"]], axis=1), np.argwhere(np.isfinite(frame.depth)))
    ranged = tmp_path / "depths.csv"
    command("range", "--format", "frame", "--histograms", folder / "histograms.npy", "--out", ranged)
    assert len(ranged.read_text().splitlines()) >= 16 * 16
    row, col = np.argwhere(frame.start >= 0)[0]
    command("wave", "--frame", folder / "frame.json", "--pixel", f"{row},{col}", "--cycle", 1, "--out", tmp_path / "wave.vcd")
    assert len(gdtof.read_vcd(tmp_path / "wave.vcd")) > 100
    command("page", folder, "--out", tmp_path / "page.html")
    assert (tmp_path / "page.html").stat().st_size > 1000


def test_a_set_takes_the_place_of_the_one_before(frame: gdtof.Frame, tmp_path: Path) -> None:
    again = gdtof.frame(frame.sensor, laser_cycles=20)
    frame.save(tmp_path)
    again.save(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == FILES
    assert np.array_equal(np.load(tmp_path / "histograms.npy"), again.histograms)
    (tmp_path / "depth.png").write_text("mine")
    with pytest.warns(UserWarning, match=r"depth\.kept\.png"):
        frame.save(tmp_path)
    assert (tmp_path / "depth.kept.png").read_text() == "mine"
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    # What cannot be written leaves what was there, and nothing else.
    with pytest.raises(gdtof.InputError, match="histograms: 3840 counts of a frame of 16x16 macropixels"):
        replace(frame, histograms=frame.histograms[:, 1:]).save(tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    (tmp_path / "file").write_text("")
    with pytest.raises(gdtof.InputError, match="is not a folder"):
        frame.save(tmp_path / "file")
    with pytest.raises(gdtof.InputError, match="histograms"):
        replace(frame, histograms=frame.histograms[:, 1:]).save(tmp_path / "none")
    assert not (tmp_path / "none").exists()


def test_copies_are_saved_alike(frame: gdtof.Frame, tmp_path: Path) -> None:
    for number, back in enumerate([frame, pickle.loads(pickle.dumps(frame)), copy.deepcopy(frame)]):
        back.save(tmp_path / str(number))
        for name in FILES:
            assert (tmp_path / str(number) / name).read_bytes() == (tmp_path / "0" / name).read_bytes()
    assert np.array_equal(back.points, frame.points)
