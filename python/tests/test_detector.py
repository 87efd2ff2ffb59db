"""Histograms of any sensor."""

import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gdtof
import numpy as np
import pandas
import pyarrow.parquet
import pytest
from conftest import Command


BIN_NS, FWHM_NS = 0.8, 1.5


def tof(first_of: int | None = None) -> gdtof.Detector:
    return gdtof.Detector(bins=48, bin_ns=BIN_NS, pulse_fwhm_ns=FWHM_NS, start_ns=2.0, first_of=first_of)


def drawn(detector: gdtof.Detector, depths: np.ndarray, photons: float, background: float) -> np.ndarray:
    """Counts drawn laser cycle by laser cycle with NumPy alone."""
    random = np.random.default_rng(5)
    cycles = 4000
    counts = np.zeros((len(depths), detector.bins), dtype=np.int64)
    for zone, depth in enumerate(depths):
        for _ in range(cycles):
            centre = 2 * depth / 0.299792458
            echo = random.normal(centre, FWHM_NS / 2.354820045, random.poisson(photons / cycles))
            span = detector.bins * BIN_NS
            light = random.uniform(0, span, random.poisson(background / cycles)) + (detector.start_ns or 0.0)
            times = np.concatenate([echo, light])
            bins = np.floor((times - (detector.start_ns or 0.0)) / BIN_NS).astype(int)
            bins = bins[(bins >= 0) & (bins < detector.bins)]
            if detector.first_of is not None:
                bins = np.sort(bins)[:1]
            np.add.at(counts[zone], bins, 1)
    return counts


def drawn_together(
    detector: gdtof.Detector, depths: list[float], photons: list[float], background: float, seed: int
) -> np.ndarray:
    """Counts of SPADs that fire together, drawn photon by photon, with the light of several surfaces in each laser cycle."""
    random = np.random.default_rng(seed)
    assert detector.coincidence is not None and detector.laser_cycles is not None and detector.start_ns is not None
    spads, within_ns, of = detector.coincidence
    counts = np.zeros(detector.bins, dtype=np.int64)
    before, span = 10.0, detector.bins * BIN_NS
    for _ in range(detector.laser_cycles):
        parts = [
            random.normal(2 * depth / 0.299792458, FWHM_NS / 2.354820045, random.poisson(number / detector.laser_cycles))
            for depth, number in zip(depths, photons, strict=True)
        ]
        dark = random.poisson(background * (1 + before / span) / detector.laser_cycles)
        parts.append(random.uniform(detector.start_ns - before, detector.start_ns + span, dark))
        last_ns: dict[int, float] = {}
        for time_ns in np.sort(np.concatenate(parts)).tolist():
            spad = int(random.integers(of))
            high = {other for other, at in last_ns.items() if time_ns - at < within_ns}
            one_bin = int((time_ns - detector.start_ns) // BIN_NS)
            if spad not in high and len(high) + 1 == spads and 0 <= one_bin < detector.bins:
                counts[one_bin] += 1
            last_ns[spad] = time_ns
    return counts


@pytest.mark.parametrize("first_of", [None, 4000])
def test_depths_and_checks_of_photons_drawn_by_numpy(first_of: int | None) -> None:
    detector = tof(first_of)
    depths = np.linspace(1.5, 4.5, 7)
    counts = drawn(detector, depths, 1500, 2500)
    found = detector.range(counts)
    assert (np.abs(found.depth - depths) < 5 * found.bound).all()
    assert (np.abs(found.photons / 1500 - 1) < 0.2).all()
    means = np.stack([detector.expected(depth, 1500, 2500) for depth in depths])
    assert min(agreement.p for agreement in detector.check(counts, means)) > 1e-3
    wrong = np.stack([detector.expected(depth + 0.2, 1500, 2500) for depth in depths])
    assert max(agreement.p for agreement in detector.check(counts, wrong)) < 1e-3


def test_counts_of_any_type_order_and_shape_are_the_same() -> None:
    detector = tof()
    counts = detector.expected(3.0, 900, 480).round().astype(np.uint16)
    whole = np.stack([counts, counts[::-1]]).reshape(2, 1, -1)
    first = detector.range(whole)
    assert first.depth.shape == (2, 1) and first.returns.shape == (2, 1, 4)
    for same in (whole.astype(np.float32), np.asfortranarray(whole), whole.tolist(), np.ma.array(whole)):
        assert np.array_equal(detector.range(same).depth, first.depth)
    assert detector.range(counts).depth.shape == ()
    assert detector.range(counts > 20).depth.shape == ()


def test_what_cannot_be_is_said() -> None:
    detector = tof()
    with pytest.raises(gdtof.InputError, match="48 bins in the last axis"):
        detector.range(np.zeros((3, 47), dtype=int))
    with pytest.raises(gdtof.InputError, match="whole"):
        detector.range(np.full(48, 0.5))
    with pytest.raises(gdtof.InputError, match="masked"):
        detector.range(np.ma.masked_equal(np.zeros(48, dtype=int), 0))
    with pytest.raises(gdtof.InputError, match="from 0"):
        detector.range(np.full(48, -1))
    with pytest.raises(gdtof.InputError, match="bin_ns"):
        gdtof.Detector(bins=48, bin_ns=0, pulse_fwhm_ns=1)
    with pytest.raises(gdtof.InputError, match="laser cycles"):
        tof(10).range(np.full(48, 3))
    assert detector.range(np.zeros(48, dtype=int)).reason == "no significant peak"
    with pytest.raises(gdtof.InputError, match="shape"):
        detector.check(np.zeros((2, 48), dtype=int), np.zeros((3, 48)))


def test_a_file_describes_a_detector_as_its_arguments_do(tmp_path: Path) -> None:
    file = tmp_path / "detector.toml"
    file.write_text(
        "bin_edges_ns = [0, 1, 2, 3.5]\npulse_fwhm_ns = 1\ncounts = \"first\"\nlaser_cycles = 70\nmost_counts = 63\n"
        "coincidence = { spads = 2, within_ns = 4, of = 16 }\n"
    )
    same = gdtof.Detector(
        bins=3,
        pulse_fwhm_ns=1.0,
        bin_edges_ns=[0.0, 1.0, 2.0, 3.5],
        first_of=70,
        most_counts=63,
        coincidence=gdtof.Coincidence(2, 4.0, 16),
    )
    assert gdtof.Detector.load(file, 3) == same
    with pytest.raises(gdtof.InputError, match="coincidence.spads"):
        gdtof.Detector(bins=3, bin_ns=1.0, pulse_fwhm_ns=1, laser_cycles=9, coincidence=gdtof.Coincidence(3, 4, 2))
    with pytest.raises(gdtof.InputError, match="bin_edges_ns"):
        gdtof.Detector(bins=3, pulse_fwhm_ns=1, bin_edges_ns=np.array([0, 1, 2]))


def test_a_surface_in_the_flank_of_a_glass_is_ranged() -> None:
    detector = gdtof.Detector(bins=48, bin_ns=BIN_NS, pulse_fwhm_ns=FWHM_NS, start_ns=-4.0)
    depths = np.array([0.35, 0.6, 2.0, 4.0])
    glass = drawn(detector, np.zeros(4), 3000, 2500)
    counts = drawn(detector, depths, 900, 0) + glass
    alone = np.stack([drawn(detector, np.zeros(4), 3000, 2500) for _ in range(3)])
    light = detector.crosstalk(alone)
    found = detector.range(counts, crosstalk=light)
    # Counts of the surface in the light of the glass: the glass as it was measured is off by its own noise.
    assert (np.abs(found.depth - depths) < 5 * found.bound).all()
    assert (np.abs(detector.range(counts).depth) < 0.1).all()
    fitted = detector.range(counts[2:], crosstalk=detector.crosstalk(counts[None, 2:], fit=True))
    assert (np.abs(fitted.depth - depths[2:]) < 5 * fitted.bound).all()
    with pytest.raises(gdtof.InputError, match="captures"):
        detector.crosstalk(counts)
    with pytest.raises(gdtof.InputError, match="crosstalk"):
        detector.range(counts, crosstalk=np.zeros(47))


def test_a_glass_is_ranged_through_where_spads_fire_together() -> None:
    pair = gdtof.Detector(
        bins=48, bin_ns=BIN_NS, pulse_fwhm_ns=FWHM_NS, start_ns=-4.0, laser_cycles=4000, coincidence=gdtof.Coincidence(2, 4.0, 16)
    )
    alone = np.stack([drawn_together(pair, [0.0], [6000], 4000, seed) for seed in range(3)])[:, None]
    light = pair.crosstalk(alone)
    # Photons, and not the fewer events that they make.
    assert light.shape == (1, 48) and abs(light.sum() / 6000 - 1) < 0.1 and light.sum() > 1.5 * alone.mean(axis=0).sum()
    depths = np.array([0.35, 0.5, 2.0, 4.0])
    counts = np.stack([drawn_together(pair, [0.0, depth], [6000, 4000], 4000, 7) for depth in depths])
    found = pair.range(counts, crosstalk=light[0])
    # Counts of the surface in the light of the glass: the glass as it was measured is off by its own noise.
    assert (np.abs(found.depth - depths) < 6 * found.bound).all()
    assert (np.abs(pair.range(counts).depth) < 0.3).all()
    fitted = pair.crosstalk(counts[None, 2:], fit=True)
    assert (np.abs(fitted.sum(axis=1) / 6000 - 1) < 0.1).all()
    away = np.stack([drawn_together(pair, [4.0], [4000], 4000, seed) for seed in range(2)])[:, None]
    assert (pair.crosstalk(away, fit=True) == 0).all()
    flat = np.zeros((1, 1, 48), dtype=int)
    flat[..., 3:15] = 400
    with pytest.raises(gdtof.InputError, match="zone 0 has counts of SPADs that fire together .* pulse_fwhm_ns"):
        pair.crosstalk(flat)


def test_tables_of_pandas_and_arrow_are_ranged(tmp_path: Path, command: Command) -> None:
    detector = tof()
    counts = np.stack([detector.expected(depth, 900, 480) for depth in (2.0, 3.0, 4.0)]).round().astype(np.uint16)
    depths = detector.range(counts).depth
    lists = pandas.DataFrame({"zone": [0, 1, 2], "counts": list(counts)})
    wide = pandas.DataFrame(counts)
    file = tmp_path / "captures.parquet"
    lists.to_parquet(file)
    table = pyarrow.parquet.read_table(file)
    for given in (
        lists["counts"],
        lists[["counts"]],
        lists["counts"].to_numpy(),
        wide,
        wide.astype("Int32"),
        pandas.read_parquet(file)["counts"],
        table["counts"],
        table.select(["counts"]),
        counts.tolist(),
    ):
        found = detector.range(given)
        assert found.depth.shape == (3,) and np.array_equal(found.depth, depths), type(given)
    assert detector.range(wide.iloc[:0]).returns.shape == (0, 4)
    assert repr(found) == "<Detected: 3 depths of 3 zones>"
    refused: list[tuple[Any, str]] = [
        (lists, "numbers of bins"),
        ([[1] * 48, [1] * 47], "numbers of bins"),
        (pandas.Series([[1] * 48, [1] * 47]), "numbers of bins"),
        (lists["zone"], "48 bins in the last axis"),
        (None, "whole ones"),
        (counts + 0.5, r"holds \d+\.5; give whole numbers"),
        (counts * np.nan, "holds nan; give whole numbers"),
        (wide.astype("Int32").reindex([0, 5]), "whole ones"),
        (wide.reindex([0, 5]), "holds nan"),
    ]
    for given, words in refused:
        with pytest.raises(gdtof.InputError, match=words):
            detector.range(given)
    # The command says what to do, and it does.
    words = "range --format counts --bin-width-ns 1 --pulse-fwhm-ns 2 --histograms"
    said = command(*words.split(), file, fails=True)
    assert "is a Parquet file" in said
    line = said[said.index("numpy.save") :].split(", or give")[0]
    run = f"import numpy, pandas; {line}"
    subprocess.run([sys.executable, "-c", run], cwd=tmp_path, check=True)
    assert np.array_equal(np.load(tmp_path / "counts.npy"), counts)


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_the_command_reads_archives_of_numpy(save: Callable[..., None], tmp_path: Path, command: Command) -> None:
    detector = tof()
    counts = np.stack([detector.expected(depth, 900, 480) for depth in (2.0, 3.0, 4.0)]).round().astype(np.uint16)
    file = tmp_path / "captures.npz"
    save(file, counts=np.asfortranarray(counts), time_s=np.zeros(3))
    words = f"range --format counts --bin-width-ns {BIN_NS} --pulse-fwhm-ns {FWHM_NS} --start-ns 2 --json --histograms"
    zones = json.loads(command(*words.split(), file))["zones"]
    assert [zone["returns"][0]["depth_m"] for zone in zones] == list(detector.range(counts).depth)


def test_what_is_no_number_is_refused_and_odd_units_are_warned_of() -> None:
    wrongs: list[tuple[dict[str, Any], str]] = [
        ({"bin_ns": "1 ns"}, "bin_ns: '1 ns' is no number"),
        ({"bin_ns": float("nan")}, "bin_ns: nan is impossible"),
        ({"pulse_fwhm_ns": True}, "pulse_fwhm_ns: True is no number"),
        ({"bins": "64"}, "bins: '64' is no whole number"),
        ({"bins": 64.0}, "bins: 64.0 is no whole number"),
    ]
    for wrong, says in wrongs:
        with pytest.raises(gdtof.InputError, match=re.escape(says)):
            gdtof.Detector(**({"bins": 64, "bin_ns": 1.0, "pulse_fwhm_ns": 2.0} | wrong))
    with pytest.warns(UserWarning, match="if you mean 1000 ps, give 1 ns") as warned:
        gdtof.Detector(64, 1000, 2)
    assert warned[0].filename == __file__


def test_echoes_unlike_the_pulse_are_warned_of() -> None:
    wide = gdtof.Detector(bins=48, bin_ns=BIN_NS, pulse_fwhm_ns=6 * FWHM_NS, start_ns=2.0)
    counts = wide.expected(1.0 + 0.075 * 48 * BIN_NS, 5000, 480).round().astype(np.uint16)
    with pytest.warns(UserWarning, match="wide at half maximum, .* times wider than pulse_fwhm_ns") as warned:
        tof().range(counts)
    assert warned[0].filename == __file__
    wide.range(counts)


def test_detectors_with_edges_are_equal_and_have_a_hash() -> None:
    edges = np.arange(65.0)
    one, other = (gdtof.Detector(64, pulse_fwhm_ns=2.0, bin_edges_ns=edges) for _ in "ab")
    assert one == other and hash(one) == hash(other)
    assert one != gdtof.Detector(64, pulse_fwhm_ns=2.0, bin_edges_ns=edges + 1)
