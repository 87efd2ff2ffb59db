"""Properties of the chip, in random sensors and exposures."""

import random

import gdtof
import numpy as np
import pytest

hypothesis = pytest.importorskip("hypothesis")
from gdtof.strategies import Exposure, exposures, sensors  # noqa: E402
from hypothesis import HealthCheck, given, settings  # noqa: E402

few = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much])
simple = gdtof.Sensor(rows=1, cols=1)


@few
@given(exposures())
def test_engines_count_the_same(exposure: Exposure) -> None:
    try:
        window = exposure.replay("window")
    except gdtof.InputError:
        # A chip whose timing the fast engine refuses.
        hypothesis.assume(False)
        raise
    assert np.array_equal(window.histograms, exposure.replay("gate").histograms)


@few
@given(exposures(simple))
def test_no_photon_counts_twice(exposure: Exposure) -> None:
    assert int(exposure.replay("window").histograms.sum()) <= len(exposure.time_fs)


@few
@given(exposures(simple))
def test_spads_that_are_off_count_nothing(exposure: Exposure) -> None:
    off = Exposure(**{**vars(exposure), "starts": np.full((1, 1), -1)})
    assert off.replay("window").histograms.sum() == 0


@few
@given(sensors())
def test_one_more_moves_the_window_by_one_step(sensor: gdtof.Sensor) -> None:
    try:
        windows = gdtof.windows(sensor, stop_periods=80)
    except gdtof.InputError:
        hypothesis.assume(False)
        raise
    keys = sensor.to_dict()
    step_m = 0.5 * 299_792_458 * keys["step_periods"] / keys["clk_hz"]
    steps = np.diff(windows[np.isfinite(windows[:, 0]), 0])
    assert np.allclose(np.abs(steps), step_m, rtol=1e-6)


def test_a_wrong_property_is_found_and_shrinks_to_one_photon() -> None:
    found = hypothesis.find(
        exposures(simple),
        lambda exposure: exposure.replay("window").histograms.sum() > 0,
        settings=settings(max_examples=2000, deadline=None, database=None),
        random=random.Random(1),
    )
    assert len(found.time_fs) == 1 and found.laser_cycles <= 2, found
