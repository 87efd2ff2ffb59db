"""Light without a chip: the pulses of the command to the bit, and means that they keep."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import Command

import gdtof

COLUMNS = ("time_fs", "row", "col", "spad")


@pytest.mark.parametrize(
    ("options", "keys", "drawn"),
    [
        ((), {}, {}),
        (("--period-ns", 700.5, "--spads", 9, "--seed", 5), {"spads": 9}, {"period_ns": 700.5, "seed": 5}),
        (("--stop-periods", 300), {}, {"stop_periods": 300}),
    ],
)
def test_pulses_of_the_command(
    command: Command, tmp_path: Path, options: tuple[object, ...], keys: dict[str, int], drawn: dict[str, float]
) -> None:
    size = ("--rows", 3, "--cols", 4, "--laser-cycles", 40)
    command("photons", *size, *options, "--format", "npy", "--out", tmp_path / "p")
    records = np.load(tmp_path / "p" / "photons.npy")
    light = gdtof.light("street", gdtof.Sensor(rows=3, cols=4), **keys)
    photons = light.photons(laser_cycles=40, **drawn)  # type: ignore[arg-type]
    assert len(photons) == len(records) > 1000
    assert repr(photons) == f"<Photons: {len(photons)} pulses>" and len(repr(light)) < 80
    for column in COLUMNS:
        assert np.array_equal(getattr(photons, column), records[column])
    assert np.array_equal(photons.pixel, 4 * photons.row.astype(int) + photons.col)
    means = np.genfromtxt(tmp_path / "p" / "light.csv", delimiter=",", names=True)
    for name in ("signal", "background_hz", "arrival_ns", "truth_m"):
        assert np.array_equal(getattr(light, name).ravel(), means[name], equal_nan=True)


def test_laser_cycles_have_their_period() -> None:
    light = gdtof.light(fov_deg=0.5, spads=1)
    assert light.shape == (1, 1)
    photons = light.photons(250.25, 300, seed=2)
    assert np.array_equal(photons.laser_cycle, photons.time_fs // 250_250_000)
    assert photons.laser_cycle.max() == 299
    assert not photons.spad.any()
    assert np.diff(photons.time_fs).min() >= light.pulse_ns * 1e6
    again = light.photons(250.25, 300, seed=2)
    assert np.array_equal(photons.time_fs, again.time_fs)
    assert not np.array_equal(photons.time_fs[:50], light.photons(250.25, 300, seed=3).time_fs[:50])


def test_rates_are_those_of_the_light() -> None:
    dim = gdtof.Scene("street", {"light.illuminance_klux": 0.5, "lidar.pulse_energy_uj": 0.1, "lidar.fov_deg": 1.5})
    light = gdtof.light(dim, gdtof.Sensor(rows=4, cols=4), spads=64)
    photons = light.photons(1000, 5000)
    counts = np.bincount(photons.pixel, minlength=16).reshape(4, 4)
    mean = 5000 * (light.signal + light.background_hz * 1e-6)
    lost = 5000 * light.signal**2 / 64
    assert (counts < mean + 5 * np.sqrt(mean)).all()
    assert (counts > mean - lost - 5 * np.sqrt(mean)).all()
    flight_ns = 2e9 * light.truth_m / 299_792_458
    assert np.nanmax(np.abs(light.arrival_ns - flight_ns)) < 20


def test_a_replay_of_them_is_the_frame() -> None:
    sensor = gdtof.Sensor(rows=6, cols=5)
    frame = gdtof.frame(sensor, laser_cycles=80)
    photons = gdtof.light("street", sensor).photons(laser_cycles=80)
    replayed = gdtof.replay(photons.time_fs, photons.pixel, photons.spad, frame.start, sensor=sensor, laser_cycles=80)
    lit = frame.start >= 0
    assert lit.any()
    assert np.array_equal(replayed.histograms[lit], frame.histograms[lit])


@pytest.mark.parametrize(
    ("keys", "drawn", "says"),
    [
        ({"spads": 65}, {}, "spads: 65 are no SPADs of a macropixel; give 1 to 64"),
        ({"fov_deg": 0.0}, {}, "fov_deg: fov_deg = 0 is impossible; give 0.1 to 150 deg"),
        ({}, {"period_ns": 0.1}, "period_ns: 0.1 ns is no laser period; give 1 to 1e6 ns"),
        ({}, {"laser_cycles": 0}, "laser_cycles: an exposure needs a laser cycle"),
        ({}, {"period_ns": 1e6, "laser_cycles": 100_000}, "laser_cycles: about .* pulses do not fit into memory"),
    ],
)
def test_what_cannot_be(keys: dict[str, float], drawn: dict[str, float], says: str) -> None:
    with pytest.raises(gdtof.InputError, match=says):
        gdtof.light(**keys).photons(**drawn)  # type: ignore[arg-type]


def test_spads_that_are_off_count_nothing_in_a_replay() -> None:
    sensor = gdtof.Sensor(rows=1, cols=2)
    time_fs = np.full(2, 1_300_000_000)
    for engine in ("gate", "cycle", "window"):
        replayed = gdtof.replay(time_fs, [0, 1], [3, 3], [[-1, 511]], sensor=sensor, laser_cycles=1, engine=engine)
        assert replayed.histograms.sum(axis=2).tolist() == [[0, 1]]


def test_seconds_for_nanoseconds_are_warned_of() -> None:
    sensor = gdtof.Sensor(rows=1, cols=1)
    with pytest.warns(UserWarning, match="if you mean 5e-08 s, give 50 ns") as warned:
        gdtof.expose(10, 1e6, 1.0, 50e-9, sensor=sensor, laser_cycles=1)
    assert warned[0].filename == __file__
