"""Strategies for property tests with hypothesis: sensors, start values and photons that the chip allows.

>>> from hypothesis import given                                  # doctest: +SKIP
>>> @given(exposures())                                           # doctest: +SKIP
... def test_no_photon_counts_twice(exposure):
...     assert exposure.replay("window").histograms.sum() <= len(exposure.time_fs)

They shrink to few macropixels, low start values and few photons. Needs hypothesis (`pip install "gdtof[hypothesis]"`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._frame import Engine
from ._gdtof import Sensor
from ._histograms import Replayed, replay
from .errors import InputError

try:
    from hypothesis import assume
    from hypothesis import strategies as st
except ImportError as missing:  # pragma: no cover
    raise ImportError('gdtof.strategies needs hypothesis; pip install "gdtof[hypothesis]"') from missing

__all__ = ["Exposure", "exposures", "photons", "sensors", "starts"]

Photons = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]


@dataclass(frozen=True, eq=False)
class Exposure:
    """A sensor and everything that happens to it."""

    sensor: Sensor
    starts: NDArray[np.int64]
    """Start values, shape (rows, cols); -1 where SPADs are off."""
    stop_periods: int
    """CLK periods of a laser cycle."""
    laser_cycles: int
    time_fs: NDArray[np.int64]
    """When SPADs fire, fs after the first rising edge of STOP, rising."""
    pixel: NDArray[np.int64]
    """Their macropixels, row-major."""
    spad: NDArray[np.int64]
    """SPADs within the macropixels."""

    def replay(self, engine: Engine = "gate", **more: Any) -> Replayed:
        """The histograms that an engine makes of it; `more` goes to :func:`gdtof.replay`."""
        return replay(
            self.time_fs,
            self.pixel,
            self.spad,
            self.starts,
            sensor=self.sensor,
            stop_periods=self.stop_periods,
            laser_cycles=self.laser_cycles,
            engine=engine,
            **more,
        )


@st.composite
def sensors(draw: st.DrawFn, /, **fixed: Any) -> Sensor:
    """Sensors of up to 2 x 2 macropixels.

    Parameters
    ----------
    fixed
        Keys that are not drawn, as of :class:`gdtof.Sensor`.
    """
    keys: dict[str, Any] = {
        "rows": draw(st.integers(1, 2)),
        "cols": draw(st.integers(1, 2)),
        "spad_rows": draw(st.sampled_from([4, 1, 2, 8])),
        "spad_cols": draw(st.sampled_from([4, 1, 2, 8])),
        "counter_bits": draw(st.integers(4, 9)),
        "p_counter": draw(st.sampled_from(["ripple", "set_reset", "synchronous", "comparator", "gray", "segmented"])),
        "bins": draw(st.sampled_from([16, 2, 8, 32])),
        "clk_hz": draw(st.sampled_from([384e6, 100e6, 200e6, 300e6])),
        "stop_phase_ps": draw(st.sampled_from([0.0, -300.0, 300.0])),
        "dead_time_ns": draw(st.sampled_from([8.0, 1.0, 3.0, 50.0])),
        "paralysable": draw(st.booleans()),
        "event_type": draw(st.sampled_from(["greater", "equal", "less"])),
        "threshold": draw(st.integers(0, 3)),
        "corner": draw(st.sampled_from(["typ", "slow", "fast"])),
    }
    keys.update(fixed)
    try:
        return Sensor(**keys)
    except InputError:
        # Keys that exclude each other.
        assume(False)
        raise


def starts(sensor: Sensor, stop_periods: int) -> st.SearchStrategy[NDArray[np.int64]]:
    """Start values of a sensor's macropixels, most of which open their window within a laser cycle; -1 where SPADs are off."""
    keys = sensor.to_dict()
    shape = (keys["rows"], keys["cols"])
    most = min(2 ** keys["counter_bits"] - 1, stop_periods // keys["step_periods"])
    one = st.one_of(st.integers(0, most), st.just(-1))
    pixels = shape[0] * shape[1]
    return st.lists(one, min_size=pixels, max_size=pixels).map(lambda all: np.array(all, dtype=np.int64).reshape(shape))


@st.composite
def photons(draw: st.DrawFn, sensor: Sensor, stop_periods: int, laser_cycles: int, most: int = 40) -> Photons:
    """Photons of a sensor: anywhere, near edges of CLK, or in bursts.

    Returns times in fs, macropixels and SPADs, in the order of time.
    """
    keys = sensor.to_dict()
    period_fs = 1e15 / keys["clk_hz"]
    end_fs = int(period_fs * stop_periods * laser_cycles)
    pixels = keys["rows"] * keys["cols"]
    spads = keys["spad_rows"] * keys["spad_cols"]
    anywhere = st.integers(0, end_fs - 1)
    half_periods = st.integers(0, 2 * stop_periods * laser_cycles - 1)
    edges = st.tuples(half_periods, st.integers(-100_000, 100_000))
    at_edges = edges.map(lambda edge: min(max(int(edge[0] * period_fs / 2) + edge[1], 0), end_fs - 1))
    times: list[int] = draw(st.lists(st.one_of(anywhere, at_edges), max_size=most))
    is_burst = draw(st.booleans())
    if times and is_burst:
        # A burst: all SPADs that there are, one after the other.
        times += [min(times[0] + 1000 * number, end_fs - 1) for number in range(min(spads, most))]
    which = [(draw(st.integers(0, pixels - 1)), draw(st.integers(0, spads - 1))) for _ in times]
    order = np.argsort(np.array(times, dtype=np.int64), kind="stable")
    columns = np.array([(time, *one) for time, one in zip(times, which, strict=True)], dtype=np.int64).reshape(-1, 3)
    columns = columns[order]
    return columns[:, 0].copy(), columns[:, 1].copy(), columns[:, 2].copy()


@st.composite
def exposures(draw: st.DrawFn, sensor: Sensor | None = None, most: int = 40) -> Exposure:
    """A sensor, drawn if none is given, with start values, laser cycles and photons."""
    chip = draw(sensors()) if sensor is None else sensor
    stop_periods = draw(st.integers(40, 80))
    laser_cycles = draw(st.integers(1, 4))
    values = draw(starts(chip, stop_periods))
    time_fs, pixel, spad = draw(photons(chip, stop_periods, laser_cycles, most))
    return Exposure(chip, values, stop_periods, laser_cycles, time_fs, pixel, spad)
