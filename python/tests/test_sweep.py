"""Sweeps in this process and on a cluster: the same table, whatever happens to workers."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Command
from distributed import Client, LocalCluster

import gdtof

STUDY = """
[study]
kind = "frame"
replicas = 2

[fixed]
sensor.rows = 8
sensor.cols = 8
frame.laser_cycles = 400
scene = "night"

[vary]
scene.lidar.pulse_energy_uj = { from = 5, to = 50, steps = 6 }
guide = ["stereo", "radar"]
"""


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("study") / "study.toml"
    path.write_text(STUDY)
    return path


@pytest.fixture(scope="module")
def table(study: Path, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """As one process makes it."""
    swept = gdtof.sweep(study, tmp_path_factory.mktemp("local"))
    assert (swept.points, swept.taken, swept.reused) == (24, 24, 0)
    return (swept.folder / "results.csv").read_bytes()


@pytest.fixture
def client() -> Iterator[Client]:
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        yield client


def test_a_sweep_is_the_commands(command: Command, study: Path, table: bytes, tmp_path: Path) -> None:
    command("sweep", study, "--out", tmp_path / "out")
    assert (tmp_path / "out" / "results.csv").read_bytes() == table
    # The folder is the command's as well: nothing is taken twice.
    swept = gdtof.sweep(study, tmp_path / "out")
    assert (swept.taken, swept.reused) == (0, 24)
    assert len(swept.to_pandas()) == 24


def test_a_study_comes_from_a_dict(study: Path, table: bytes, tmp_path: Path) -> None:
    nested: dict[str, Any] = {
        "study": {"kind": "frame", "replicas": 2},
        "fixed": {"sensor": {"rows": 8, "cols": np.int64(8)}, "frame": {"laser_cycles": 400}, "scene": "night"},
        "vary": {"scene": {"lidar": {"pulse_energy_uj": {"from": 5, "to": 50, "steps": 6}}}, "guide": ["stereo", "radar"]},
    }
    dotted: dict[str, Any] = {
        "study": nested["study"],
        "fixed": {"sensor.rows": 8, "sensor.cols": 8, "frame.laser_cycles": 400, "scene": "night"},
        "vary": {"scene.lidar.pulse_energy_uj": np.linspace(5, 50, 6), "guide": ("stereo", "radar")},
    }
    for name, asked in (("nested", nested), ("dotted", dotted)):
        swept = gdtof.sweep(asked, tmp_path / name)
        assert (swept.points, swept.taken) == (24, 24)
        assert (swept.folder / "results.csv").read_bytes() == table
    # It goes on where a file has been, and a file where it has been.
    assert gdtof.sweep(study, tmp_path / "nested").reused == 24


@pytest.mark.parametrize("keys", [("sensor.bins", "scene.lidar.pde"), ("scene.lidar.pde", "sensor.bins")])
def test_what_a_dict_varies_first_varies_slowest(keys: tuple[str, str], tmp_path: Path) -> None:
    values: dict[str, list[Any]] = {"sensor.bins": [16, 8], "scene.lidar.pde": [0.2, 0.1]}
    fixed = {"sensor.rows": 4, "sensor.cols": 4, "frame.laser_cycles": 20}
    vary = {key: values[key] for key in keys}
    table = gdtof.sweep({"study": {"kind": "frame"}, "fixed": fixed, "vary": vary}, tmp_path).to_pandas()
    slow, fast = keys
    assert list(table[slow]) == [value for value in values[slow] for _ in range(2)]
    assert list(table[fast]) == values[fast] * 2


def test_keys_that_go_together(tmp_path: Path) -> None:
    asked = {
        "study": {"kind": "frame", "out": "elsewhere"},
        "fixed": {"sensor.rows": 4, "sensor.cols": 4, "frame.laser_cycles": 20},
        "vary": {"zip": [{"sensor.bins": [8, 16], "scene.lidar.pde": [0.1, 0.2]}], "scene.light.illuminance_klux": [1, 2]},
    }
    table = gdtof.sweep(asked, tmp_path).to_pandas()
    together = {(row["sensor.bins"], row["scene.lidar.pde"]) for _, row in table.iterrows()}
    assert len(table) == 4 and together == {(8, 0.1), (16, 0.2)}


def test_a_lost_worker_changes_nothing(client: Client, study: Path, table: bytes, tmp_path: Path) -> None:
    folder = tmp_path / "cluster"
    killed: list[int] = []

    def kill_one(done: int) -> None:
        if not killed:
            pids: dict[str, int] = client.run(os.getpid)
            pid = next(iter(pids.values()))
            os.kill(pid, signal.SIGKILL)
            killed.append(pid)

    swept = gdtof.sweep(study, folder, client=client, parts=6, progress=kill_one)
    assert killed
    assert (folder / "results.csv").read_bytes() == table
    assert swept.points == 24 and swept.taken + swept.reused == 24
    # Each row is in one journal, once.
    lines = [line for journal in folder.glob("journal*.log") for line in journal.read_text().splitlines()]
    keys = [next(word for word in line.split() if len(word) == 32) for line in lines]
    assert len(keys) == len(set(keys)) == 24
    again = gdtof.sweep(study, folder, client=client)
    assert (again.taken, again.reused) == (0, 24)


def test_ctrl_c_ends_a_sweep_which_goes_on_later(study: Path, table: bytes, tmp_path: Path) -> None:
    def enough(done: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        gdtof.sweep(study, tmp_path / "out", progress=enough)
    for _ in range(100):
        try:
            swept = gdtof.sweep(study, tmp_path / "out")
            break
        except gdtof.InputError as error:
            # The points at hand are being finished.
            assert "another process takes these points" in str(error)
            time.sleep(0.2)
    assert swept.reused > 0
    assert (tmp_path / "out" / "results.csv").read_bytes() == table


def test_what_cannot_be(study: Path, tmp_path: Path) -> None:
    bad: Any = tmp_path / "bad.toml"
    bad.write_text("[vary]\nsensor.bin = [1]\n")
    with pytest.raises(gdtof.InputError, match=r"bad.toml:2: "):
        gdtof.sweep(bad)
    with pytest.raises(gdtof.InputError, match=r"^study: .*bin"):
        gdtof.sweep({"vary": {"sensor.bin": [1]}}, tmp_path / "none")
    with pytest.raises(gdtof.InputError, match=r"^study: replicas = 2.5 is impossible; give a whole number"):
        gdtof.sweep({"study": {"replicas": 2.5}, "vary": {"sensor.bins": [8]}}, tmp_path / "none")
    with pytest.raises(gdtof.InputError, match=r"^study: frame: this must be a section|^study: frame: unknown section"):
        gdtof.sweep({"frame": 3}, tmp_path / "none")
    assert not (tmp_path / "none").exists()
    with pytest.raises(gdtof.InputError, match="parts: are for a client"):
        gdtof.sweep(study, tmp_path, parts=3)


def test_a_sweep_without_any_result_raises_why(tmp_path: Path) -> None:
    study: dict[str, Any] = {"fixed": {"sensor.rows": 4, "sensor.cols": 4, "frame.laser_cycles": 100}}
    study["vary"] = {"sensor.clk_hz": ["900 MHz", "950 MHz"]}
    for _ in "ab":
        with pytest.raises(gdtof.InputError, match="no point has a result: "):
            gdtof.sweep(study, tmp_path / "out")
    study["vary"] = {"sensor.clk_hz": ["300 MHz", "900 MHz"]}
    for reused in (1, 2):
        swept = gdtof.sweep(study, tmp_path / "out")
        assert (swept.reused, swept.without_results) == (reused, 1)


def test_a_value_in_another_unit_is_warned_of_where_the_sweep_is_called(tmp_path: Path) -> None:
    study: dict[str, Any] = {"fixed": {"sensor.rows": 1, "sensor.cols": 1, "frame.laser_cycles": 10}}
    study["vary"] = {"scene.lidar.pulse_fwhm_ns": [5e-9, 5.0]}
    with pytest.warns(UserWarning, match="give 5 ns") as warned:
        gdtof.sweep(study, tmp_path / "out")
    assert warned[0].filename == __file__
