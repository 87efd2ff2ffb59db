"""Light, photons and histograms of one's own."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _gdtof
from ._arguments import SceneLike, SensorLike, numbers, periods_of, real, scene_of, seed_of, sensor_of, starts_of, whole
from ._frame import Engine, _path
from .errors import InputError


@dataclass(frozen=True, eq=False, repr=False)
class Exposed:
    """What :func:`expose` gives."""

    histograms: NDArray[np.uint16]
    """Counts, shape (rows, cols, bins), bin 0 earliest."""
    work: dict[str, int]
    """What the engine did, and what it left out."""

    def __repr__(self) -> str:
        return f"<Exposed {_counted(self.histograms)}>"


@dataclass(frozen=True, eq=False, repr=False)
class Replayed:
    """What :func:`replay` gives."""

    histograms: NDArray[np.uint16]
    """Counts, shape (rows, cols, bins), bin 0 earliest."""
    photons: int
    """Photons that were given."""
    lost_to_dead_time: int
    """Those within the dead time of an earlier one of their SPAD, which make no edge."""
    after_the_end: int
    """Those at or after the end of the exposure."""
    cancelled: int
    """Those that cancel in the front end: two of a SPAD between the same two CLK edges."""

    def __repr__(self) -> str:
        return f"<Replayed {_counted(self.histograms)} of {self.photons} photons>"


@dataclass(frozen=True, eq=False, repr=False)
class Ranged:
    """What :func:`range` gives; arrays of shape (rows, cols)."""

    depth: NDArray[np.float64]
    """Distance, m, where a peak is significant and not saturated; NaN elsewhere."""
    bound: NDArray[np.float64]
    """Standard deviation of the depth, m: the least that its counts allow (Cramér-Rao), with what the spread adds; a bin where the echo is
    saturated. NaN where range walk is left in the depth or the window cuts its echo off."""
    spread: NDArray[np.float64]
    """Standard deviation of the depths within the macropixel, from the width of the echo, m; NaN where there is no bound."""
    returns: NDArray[np.float64]
    """Depths of up to four echoes of the window, m, strongest first, shape (rows, cols, 4); NaN where there are fewer."""
    returns_bound: NDArray[np.float64]
    """Their bounds, m; NaN where there is none."""
    returns_photons: NDArray[np.float64]
    """Photons of each that the SPADs would detect in a laser cycle without dead time."""
    peak: NDArray[np.float64]
    """Distance of the histogram's peak with its range walk, m, significant or not."""
    confidence: NDArray[np.float64]
    """-log10 of the chance that light without an echo makes such a peak; NaN where there is no peak."""
    reason: NDArray[np.uint8]
    """A :class:`Reason`: depth, no guide (SPADs are off), saturated, no significant peak, or an echo from behind the lidar."""
    walk_left: NDArray[np.uint8]
    """Why a depth has no bound, or one of a bin, a :class:`WalkLeft`; 0 elsewhere."""

    def __repr__(self) -> str:
        return f"<Ranged: {np.count_nonzero(np.isfinite(self.depth))} depths of {self.depth.size} macropixels>"


def _counted(histograms: NDArray[np.uint16]) -> str:
    return f"{'x'.join(map(str, histograms.shape))}: {histograms.sum(dtype=np.int64)} counts"


def expose(
    starts: ArrayLike,
    background_hz: ArrayLike = 0.0,
    signal: ArrayLike = 0.0,
    arrival_ns: ArrayLike = 0.0,
    *,
    sigma_ns: ArrayLike | None = None,
    profile_hz: ArrayLike | None = None,
    profile_edges_ns: ArrayLike | None = None,
    sensor: SensorLike = None,
    scene: SceneLike = None,
    stop_periods: int = 520,
    laser_cycles: int = 1000,
    seed: int = 1,
    engine: Engine = "window",
    progress: Callable[[int], object] | None = None,
) -> Exposed:
    """Exposes macropixels to light of your own.

    Numbers stand for all macropixels, arrays of shape (rows, cols) for each; echoes may have one more axis, for several of them. All
    photons are detected ones, of all SPADs of a macropixel together: photons times their detection efficiency.

    Parameters
    ----------
    starts
        Start values; -1 switches SPADs off. :func:`starts_for` gives them for distances.
    background_hz
        Background photons and dark counts of a macropixel, 1/s.
    signal
        Photons of the echo in each laser cycle, on average.
    arrival_ns
        When the echo's centre comes after STOP, ns: 2 z / c.
    sigma_ns
        Standard deviation of the photons' times, ns; the scene's laser pulse without it.
    profile_hz, profile_edges_ns
        Background that changes within the laser cycle, on top: rates, 1/s, shape (rows, cols, pieces) or (pieces,), and the edges of the
        pieces after STOP, ns, shape (pieces + 1,).
    sensor, stop_periods, laser_cycles, seed, engine, progress
        As of :func:`frame`.
    scene
        Whose laser pulse echoes have; nothing else of it matters.

    Raises
    ------
    InputError
        What cannot be, and what would help.
    """
    chip = sensor_of(sensor)
    rows, cols, _ = chip.shape
    shape = (rows, cols)
    photons, arrivals = numbers(signal), numbers(arrival_ns)
    sigmas = None if sigma_ns is None else numbers(sigma_ns)
    _warn_of_seconds("arrival_ns", arrivals)
    if sigmas is not None:
        _warn_of_seconds("sigma_ns", sigmas)
    several = [a.shape[2] for a in (photons, arrivals, sigmas) if a is not None and a.ndim == 3]
    of_echoes = (rows, cols, several[0] if several else 1)

    def echoes(values: NDArray[np.float64]) -> NDArray[np.float64]:
        if values.shape == shape:
            values = values[:, :, np.newaxis]
        return real(np.broadcast_to(values, of_echoes) if _fits(values, of_echoes) else values)

    profile: tuple[list[float], NDArray[np.float64]] | None = None
    if (profile_hz is None) != (profile_edges_ns is None):
        raise InputError("profile_hz: needs profile_edges_ns, and the other way round; give both")
    if profile_hz is not None and profile_edges_ns is not None:
        edges = [float(edge) for edge in np.asarray(profile_edges_ns, np.float64).ravel()]
        profile = (edges, real(profile_hz, (rows, cols, max(len(edges) - 1, 1))))
    exposed = _gdtof.expose(
        chip,
        scene_of(scene),
        starts_of(starts, chip),
        real(background_hz, shape),
        echoes(photons),
        echoes(arrivals),
        None if sigmas is None else echoes(sigmas),
        profile,
        periods_of(stop_periods, laser_cycles),
        seed_of(seed),
        engine,
        progress,
    )
    return Exposed(**exposed)


def _warn_of_seconds(name: str, values_ns: NDArray[np.float64]) -> None:
    """Nanoseconds are at least thousandths where anything is timed."""
    known = values_ns[np.isfinite(values_ns) & (values_ns > 0)]
    if known.size and known.max() < 1e-3:
        said = f"{name}: {known.max():g} ns is far from the usual; if you mean {known.max():g} s, give {1e9 * known.max():g} ns"
        # The caller of `expose`.
        warnings.warn(said, UserWarning, stacklevel=3)


def _fits(values: NDArray[Any], shape: tuple[int, ...]) -> bool:
    try:
        return np.broadcast_shapes(values.shape, shape) == shape
    except ValueError:
        return False


def replay(
    time_fs: ArrayLike,
    pixel: ArrayLike,
    spad: ArrayLike,
    starts: ArrayLike,
    *,
    sensor: SensorLike = None,
    stop_periods: int = 520,
    laser_cycles: int,
    engine: Engine = "window",
    waves: str | PathLike[str] | None = None,
    progress: Callable[[int], object] | None = None,
) -> Replayed:
    """Runs photons of your own through the chip: the same numbers as `gdtof replay`, to the bit.

    Parameters
    ----------
    time_fs
        When each photon comes after the first rising edge of STOP, fs, in any order, shape (n,).
    pixel
        Its macropixel, row-major: row * cols + col, shape (n,).
    spad
        Its SPAD within the macropixel, shape (n,).
    starts
        Start values, shape (rows, cols) or one for all.
    sensor, stop_periods, laser_cycles, progress
        As of :func:`frame`.
    engine
        gate, cycle or window; cohort has no photons.
    waves
        File for a waveform of every named net, .vcd or .fst; of the engine gate. :func:`read_vcd` reads it.

    Raises
    ------
    InputError
        What cannot be, and what would help.
    """
    chip = sensor_of(sensor)

    def column(name: str, values: ArrayLike) -> NDArray[np.int64]:
        return np.ascontiguousarray(whole(name, values).ravel())

    replayed = _gdtof.replay(
        chip,
        starts_of(starts, chip),
        column("time_fs", time_fs),
        column("pixel", pixel),
        column("spad", spad),
        periods_of(stop_periods, laser_cycles),
        engine,
        _path(waves),
        progress,
    )
    return Replayed(**replayed)


def range(
    histograms: ArrayLike,
    starts: ArrayLike,
    *,
    sensor: SensorLike = None,
    scene: SceneLike = None,
    stop_periods: int = 520,
    laser_cycles: int = 1000,
    false_alarm_rate: float = 1e-3,
    correct_walk: bool = True,
    calibration: str | PathLike[str] | None = None,
) -> Ranged:
    """Finds depths in histograms, as a frame does in its own.

    Parameters
    ----------
    histograms
        Counts, shape (rows, cols, bins), whole numbers from 0 to 65535.
    starts
        Start values of the windows that they were counted in, shape (rows, cols) or one for all; -1 where SPADs were off.
    sensor, stop_periods, laser_cycles, false_alarm_rate, correct_walk, calibration
        As of :func:`frame`, and as they were counted.
    scene
        Whose laser pulse echoes have; nothing else of it matters.

    Raises
    ------
    InputError
        What cannot be, and what would help.
    """
    chip = sensor_of(sensor)
    counts = np.asarray(histograms)
    if counts.dtype != np.uint16 or np.ma.is_masked(histograms):
        wide = whole("histograms", histograms)
        if wide.size and (wide.min() < 0 or wide.max() > np.iinfo(np.uint16).max):
            raise InputError("histograms: counts are from 0 to 65535; give such")
        counts = wide.astype(np.uint16)
    ranged = _gdtof.range_counts(
        chip,
        scene_of(scene),
        counts,
        starts_of(starts, chip),
        periods_of(stop_periods, laser_cycles),
        float(false_alarm_rate),
        correct_walk,
        _path(calibration),
    )
    return Ranged(**ranged)
