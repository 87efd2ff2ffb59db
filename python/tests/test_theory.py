"""Formulas over arrays."""

from __future__ import annotations

import math

import numpy as np
import pytest

import gdtof
from gdtof import theory


def test_detection_is_eq_17() -> None:
    # Two bins, ties by lot, against a sum over both counts.
    signal, background = 0.8, 1.5

    def poisson(mean: float, k: int) -> float:
        return math.exp(-mean) * mean**k / math.factorial(k)

    wins = 0.0
    for ours in range(60):
        for other in range(60):
            chance = 1.0 if ours > other else 0.5 if ours == other else 0.0
            wins += poisson(signal + background, ours) * poisson(background, other) * chance
    found = theory.detection_probability(signal, background, 2, 1)
    assert found == pytest.approx(wins, rel=1e-12)
    assert theory.miss_probability(signal, background, 2, 1) == pytest.approx(1 - wins, rel=1e-12)
    strict, by_lot, loose = (
        theory.detection_probability(signal, background, 2, 1, model)
        for model in ("poisson_strict", "poisson", "poisson_loose")
    )
    assert strict < by_lot < loose


def test_arguments_are_broadcast() -> None:
    cycles = np.arange(1, 40)
    table = theory.detection_probability([[0.01], [0.1]], 0.02, 16, cycles)
    assert table.shape == (2, 39)
    assert (np.diff(table) > 0).all() and (table[1] > table[0]).all()
    needed = theory.laser_cycles_for(0.5, [0.01, 0.1], 0.02, 16)
    for row, n in zip([0.01, 0.1], needed, strict=True):
        assert theory.detection_probability(row, 0.02, 16, n) >= 0.5
        assert theory.detection_probability(row, 0.02, 16, n - 1) < 0.5
    assert np.isnan(theory.laser_cycles_for(1.0, 0.1, 0.1, 16))
    assert isinstance(float(theory.thompson(1, 1, 0, 100)), float)


def test_precision_and_its_bound() -> None:
    # Without background and in narrow bins both come to sigma over the root of the counts.
    assert theory.thompson(1e-3, 2.0, 0.0, 400.0) == pytest.approx(0.1, rel=1e-3)
    assert theory.cramer_rao(1e-2, 2.0, 0.0, 400.0) == pytest.approx(0.1, rel=1e-3)
    cycles = theory.cramer_rao_laser_cycles(0.1, 1.0, 1.0, 0.01, 0.1)
    assert theory.cramer_rao(1.0, 1.0, 0.01 * cycles, 0.1 * cycles) == pytest.approx(0.1, rel=1e-9)


def test_few_bins_cost_laser_cycles() -> None:
    light = dict(signal=1e4, background_hz=1e7, pulse_sigma_s=1e-9, precision_m=0.05, probability=0.95)
    ranges = np.array([10.0, 50.0, 150.0])
    zooming = theory.penalty("zooming", ranges, **light, bins=16, bin_s=2.6e-9)
    sliding = theory.penalty("sliding", ranges, **light, bins=16, bin_s=2.6e-9)
    assert (zooming >= 1).all() and (sliding >= 1).all()
    assert sliding[2] > sliding[0]
    assert theory.penalty("full", ranges, **light, bins=16, bin_s=2.6e-9) == pytest.approx(1.0)


def test_guides_and_front_ends() -> None:
    assert theory.tolerated_sigma_m(384e6, 16) == pytest.approx(16 * 299_792_458 / (2 * 384e6) / 6)
    assert theory.stereo_depth_error_m(50.0, 0.3, 1000.0, 0.5) == pytest.approx(50**2 * 0.3 / 500, rel=0.02)
    assert theory.non_paralysable_hz(1e8, 1e-8) == pytest.approx(5e7)
    assert theory.paralysable_hz(1e8, 1e-8) == pytest.approx(1e8 / math.e)
    assert theory.any_periods_hz(16, 1e6, 4e8) > theory.odd_periods_hz(16, 1e6, 4e8)
    assert theory.xor_edges_hz(1e8, 5e-11) < 1e8


def test_confidence_is_that_of_frames() -> None:
    sensor = gdtof.Sensor(rows=16, cols=16)
    frame = gdtof.frame(sensor, laser_cycles=200)
    bin_ns = 1e9 / sensor.clk_hz
    sigma_bins = gdtof.Scene()["lidar.pulse_fwhm_ns"] / math.sqrt(8 * math.log(2)) / bin_ns
    found = theory.confidence(frame.histograms, sigma_bins, 200)
    seen = np.isfinite(frame.confidence)
    assert seen.any()
    assert np.allclose(found[seen], frame.confidence[seen])


@pytest.mark.parametrize(
    ("ask", "says"),
    [
        (lambda: theory.detection_probability(-1, 1, 2, 3), "signal: -1.0 is impossible; give 0 or more"),
        (lambda: theory.detection_probability(1, 1, 0, 3), "bins: 0.0 is impossible; give 1 or more"),
        (lambda: theory.detection_probability(1, 1, 2, 3, "normal"), "is no model"),  # type: ignore[arg-type]
        (lambda: theory.thompson([1, 2], [1, 2, 3], 0, 1), "shapes do not go together"),
        (lambda: theory.confidence(3, 1.0, 10), "holds no counts"),
        (lambda: theory.confidence([1, -1], 1.0, 10), "counts are from 0"),
    ],
)
def test_what_cannot_be(ask: object, says: str) -> None:
    assert callable(ask)
    with pytest.raises(gdtof.InputError, match=says):
        ask()


def test_a_bound_of_nothing_is_infinite() -> None:
    assert np.isinf(gdtof.theory.cramer_rao(1.0, 1.0, 1.0, 0.0))
    assert np.isinf(gdtof.theory.cramer_rao(1.0, 0.0, 1.0, 10.0))
