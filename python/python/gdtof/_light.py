"""Light of a scene without a chip, and the pulses that SPADs make of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import _gdtof
from ._arguments import SceneLike, SensorLike, count, periods_of, scene_of, seed_of, sensor_of
from ._gdtof import Scene, Sensor


@dataclass(frozen=True, eq=False, repr=False)
class Photons:
    """Pulses of SPADs, what :meth:`Light.photons` gives: arrays of shape (n,), by macropixel, then time."""

    time_fs: NDArray[np.int64]
    """When the wire of the SPAD rises, fs after the first laser pulse."""
    laser_cycle: NDArray[np.int64]
    """Its laser cycle; the first one is 0. 64 bits, so that it can be multiplied by a period in fs."""
    row: NDArray[np.uint16]
    """Row of the macropixel."""
    col: NDArray[np.uint16]
    """Column of the macropixel."""
    spad: NDArray[np.uint8]
    """SPAD within the macropixel, row by row."""
    pixel: NDArray[np.int64]
    """Macropixel, row-major, as :func:`replay` takes it."""

    def __len__(self) -> int:
        return len(self.time_fs)

    def __repr__(self) -> str:
        return f"<Photons: {len(self)} pulses>"


@dataclass(frozen=True, eq=False, repr=False)
class Light:
    """The light of a scene on an array of SPADs, what :func:`light` gives; arrays of shape (rows, cols).

    A scene in which something moves is that at time 0 here; :meth:`photons` follows it.
    """

    signal: NDArray[np.float64]
    """Mean detected signal photons a laser cycle, of all SPADs of a macropixel, before dead time."""
    background_hz: NDArray[np.float64]
    """Mean detected background photons and dark counts of all SPADs of a macropixel, per second, before dead time."""
    arrival_ns: NDArray[np.float64]
    """When the brightest echo arrives after the laser pulse, ns; NaN without an echo."""
    truth_m: NDArray[np.float64]
    """Distance of the surface that sends back most light, m; NaN for the sky."""
    spads: int
    """SPADs of a macropixel."""
    pulse_ns: float
    """How long the wire of a SPAD is high, ns."""
    _sensor: Sensor
    _scene: Scene
    _asked: tuple[int | None, float | None]

    def __repr__(self) -> str:
        rows, cols = self.shape
        echoes = np.count_nonzero(np.isfinite(self.arrival_ns))
        return f"<Light of {self._scene.name}, {rows}x{cols} with {self.spads} SPADs each: {echoes} echoes>"

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        rows, cols = self.signal.shape
        return rows, cols

    def photons(
        self,
        period_ns: float | None = None,
        laser_cycles: int = 1000,
        seed: int = 1,
        *,
        stop_periods: int = 520,
        progress: Callable[[int], object] | None = None,
    ) -> Photons:
        """Draws the pulses of whole laser cycles: the same as `gdtof photons` writes, to the bit.

        Parameters
        ----------
        period_ns
            Length of a laser cycle, ns, 1 to 1e6; `stop_periods` of the sensor's CLK if left out.
        laser_cycles
            How many laser cycles.
        seed
            Equal seeds give equal photons.
        stop_periods
            CLK periods in a laser cycle, where `period_ns` is left out. The pulses are then those of :func:`frame`.
        progress
            Called with the macropixels that are done, about every 50 ms.

        Raises
        ------
        InputError
            What cannot be, and what would help.
        """
        drawn = _gdtof.photons(
            self._sensor,
            self._scene,
            *self._asked,
            period_ns,
            periods_of(stop_periods, laser_cycles),
            seed_of(seed),
            progress,
        )
        drawn["laser_cycle"] = drawn["laser_cycle"].astype(np.int64)
        pixel = drawn["row"].astype(np.int64) * self.shape[1] + drawn["col"]
        return Photons(**drawn, pixel=pixel)


def light(
    scene: SceneLike = None,
    sensor: SensorLike = None,
    *,
    spads: int | None = None,
    fov_deg: float | None = None,
) -> Light:
    """The light of a scene for any chip: no window and no guide.

    >>> import gdtof
    >>> light = gdtof.light("street", gdtof.Sensor(rows=4, cols=4), spads=9)
    >>> photons = light.photons(period_ns=1000, laser_cycles=50, seed=3)
    >>> light.signal.shape, int(photons.spad.max())
    ((4, 4), 8)

    Parameters
    ----------
    scene
        A :class:`Scene`, or what makes one; the street if left out.
    sensor
        Whose array, dead time, afterpulses, crosstalk and CLK these are; the QuantIC4x4 if left out.
    spads
        SPADs of a macropixel, 1 to 64, instead of the sensor's.
    fov_deg
        A single pixel with this horizontal field of view, degrees, instead of the array. All of the laser's energy falls into it.

    Raises
    ------
    InputError
        What cannot be, and what would help.
    """
    chip, world = sensor_of(sensor), scene_of(scene)
    means = _gdtof.light(chip, world, None if spads is None else count("spads", spads), fov_deg)
    return Light(**means, _sensor=chip, _scene=world, _asked=(spads, fov_deg))
