"""Timing and windows of a sensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _gdtof
from ._arguments import SensorLike, numbers, real, sensor_of, starts_of


@dataclass(frozen=True)
class Timing:
    """What static timing says of a sensor; times in ps."""

    met: bool
    """Whether every limit is kept."""
    slack_ps: float
    """What is left over where it is tightest."""
    check: str
    """The check that is tightest."""
    path: str
    """Its path."""
    verdict: str
    """The verdict in words, with what would help."""
    notes: list[str]
    """What should be known beside it."""
    clk_period_ps: float
    """A CLK period."""
    ripple_ps: float
    """From CLK to LOCAL_STOP through all stages of the P-counter."""
    counter_period_ps: float
    """The shortest time from one count of the P-counter to the next."""
    strobe_ps: float
    """From LOCAL_STOP to the clock of the HIT flip-flops."""
    margins: list[tuple[str, str, float]]
    """The least margin of each check: the check, its path, what is left over; the tightest first."""


def timing(
    sensor: SensorLike = None,
    *,
    process: Literal["slow", "typ", "fast"] = "typ",
    voltage_v: float = 1.1,
    temperature_c: float | None = None,
) -> Timing:
    """Static timing of a sensor's macropixel and load path, as `gdtof timing` has it.

    Parameters
    ----------
    sensor
        As of :func:`frame`.
    process
        Silicon; like voltage and temperature it scales the delays of the sensor's corner.
    voltage_v
        Supply, V.
    temperature_c
        Junction temperature, °C; the sensor's ``temperature_c``, or 50, unless given.
    """
    return Timing(**_gdtof.timing(sensor_of(sensor), process, voltage_v, temperature_c))


def windows(sensor: SensorLike = None, *, stop_periods: int = 520) -> NDArray[np.float64]:
    """From where to where the window of each start value sees, m, shape (largest start + 1, 2); NaN where it does not open."""
    return _gdtof.windows(sensor_of(sensor), stop_periods)


def starts_for(
    range_m: ArrayLike, sensor: SensorLike = None, *, stop_periods: int = 520
) -> NDArray[np.int32]:
    """Start values whose windows hold distances nearest to their middle, in the shape of `range_m` (m); -1 where none does, and
    for NaN."""
    metres = numbers(range_m)
    flat = _gdtof.starts_for(sensor_of(sensor), real(metres.ravel()), stop_periods)
    return flat.reshape(metres.shape)


def bin_edges(
    starts: ArrayLike, sensor: SensorLike = None, *, stop_periods: int = 520
) -> NDArray[np.float64]:
    """Edges of the bins of every macropixel after STOP, ns, shape (rows, cols, bins + 1); NaN where a window does not open.

    `starts` are start values, shape (rows, cols) or one for all.
    """
    chip = sensor_of(sensor)
    return _gdtof.bin_edges(chip, starts_of(starts, chip), stop_periods)
