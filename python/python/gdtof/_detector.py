"""Histograms of any sensor."""

from __future__ import annotations

import json
import math
import warnings
from dataclasses import dataclass
from numbers import Integral, Real
from os import PathLike, fspath
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _gdtof
from ._arguments import whole
from .errors import InputError


@dataclass(frozen=True, eq=False, repr=False)
class Detected:
    """What :meth:`Detector.range` gives; arrays of the shape of the zones."""

    depth: NDArray[np.float64]
    """Distance of the clearest echo, m; NaN without one."""
    bound: NDArray[np.float64]
    """Its standard deviation, m; NaN where counts are not those of echoes of this pulse."""
    spread: NDArray[np.float64]
    """Standard deviation of the depths that the zone sees there, m; NaN where there is no bound."""
    photons: NDArray[np.float64]
    """Photons of the echo in all laser cycles."""
    confidence: NDArray[np.float64]
    """-log10 of the chance that light without this echo makes such counts."""
    returns: NDArray[np.float64]
    """Depths of up to four echoes, m, the clearest first, in a further axis of 4; NaN where there are fewer."""
    returns_bound: NDArray[np.float64]
    """Their standard deviations, m."""
    returns_photons: NDArray[np.float64]
    """Their photons."""
    reason: NDArray[np.str_]
    """Why there is no depth; empty where there is one."""
    walk_left: NDArray[np.uint8]
    """Why a depth has no bound, or one of a bin, a :class:`WalkLeft`; 0 elsewhere."""

    def __repr__(self) -> str:
        return f"<Detected: {np.count_nonzero(np.isfinite(self.depth))} depths of {self.depth.size} zones>"


class Agreement(NamedTuple):
    """What :meth:`Detector.check` gives."""

    chi_squared: float
    """Sum of squared deviations, each over its variance."""
    cells: int
    """Cells that were compared; bins with few counts are put together."""
    p: float
    """Chance that counts of the expected light deviate at least as much. Below 0.001 the counts are of other light, or counted wrong."""


def _rows(counts: Any) -> Any:
    """Tables of pandas and Arrow as arrays: with a column for each bin, or one column of lists."""
    # Arrays of xarray have it, too, for two axes.
    if hasattr(counts, "to_pandas") and not hasattr(counts, "__array__"):
        counts = counts.to_pandas()
    if np.ma.isMaskedArray(counts):
        return counts
    unequal = InputError("counts: has zones with different numbers of bins; give each zone as many")
    try:
        array = np.asarray(counts)
    except ValueError:
        raise unequal from None
    if array.dtype.kind != "O" or array.size == 0:
        return array
    if array.ndim == 2 and array.shape[1] == 1:
        array = array[:, 0]
    cells = [np.asarray(cell) for cell in array.ravel()]
    if len({cell.shape for cell in cells}) > 1:
        raise unequal
    return np.stack(cells).reshape(array.shape + cells[0].shape)


def _plain(number: object) -> object:
    """A number of NumPy as one of JSON."""
    if isinstance(number, np.generic):
        return number.item()
    raise InputError(f"detector: {number!r} is no number; give one")


class Coincidence(NamedTuple):
    """SPADs that fire together make an event. The output of a SPAD is high for a time after a photon."""

    spads: int
    """How many outputs must be high."""
    within_ns: float
    """How long an output is high, ns."""
    of: int
    """SPADs on which the light comes evenly."""


@dataclass(frozen=True)
class Detector:
    """A sensor whose histograms are ranged: how long its bins are, and which events they count.

    >>> import gdtof
    >>> tof = gdtof.Detector(bins=64, bin_ns=1.0, pulse_fwhm_ns=2.0)
    >>> mean = tof.expected(depth_m=4.0, photons=400, background=640)
    >>> found = tof.range(mean.round())
    >>> bool(abs(found.depth - 4.0) < 0.02)
    True
    """

    bins: int
    """Bins of a histogram."""
    bin_ns: float | None = None
    """Length of a bin, ns."""
    pulse_fwhm_ns: float | None = None
    """Full width at half maximum of the laser pulse with all jitter, ns."""
    start_ns: float | None = None
    """When bin 0 begins after the centre of the laser pulse has left, ns; 0 if it is not given."""
    first_of: int | None = None
    """Laser cycles of a histogram, if each counts its first event only; None if bins count every event."""
    bin_edges_ns: ArrayLike | None = None
    """In place of ``bin_ns`` and ``start_ns``: where bins begin, and the last one ends, after the centre of the laser pulse has left."""
    laser_cycles: int | None = None
    """Laser cycles of a histogram where every event counts, which a coincidence needs."""
    coincidence: Coincidence | None = None
    """What an event is, if it is not a photon."""
    most_counts: int | None = None
    """Counts at which a bin stops."""

    def __post_init__(self) -> None:
        for name in ("bin_ns", "pulse_fwhm_ns", "start_ns"):
            number = getattr(self, name)
            if number is not None and not isinstance(number, Real) or isinstance(number, bool):
                raise InputError(f"{name}: {number!r} is no number; give one, in ns")
            if number is not None and not math.isfinite(number):
                raise InputError(f"{name}: {number!r} is impossible; give a finite number, in ns")
        if not isinstance(self.bins, Integral):
            raise InputError(f"bins: {self.bins!r} is no whole number; give 2 to 65536")
        if not 2 <= self.bins <= 65536:
            raise InputError(f"bins: {self.bins} is impossible; give 2 to 65536")
        if self.first_of is not None and self.laser_cycles is not None:
            raise InputError("laser_cycles: says the same as first_of; leave one of them out")
        if self.bin_edges_ns is not None:
            edges = np.asarray(self.bin_edges_ns, np.float64)
            object.__setattr__(self, "bin_edges_ns", tuple(edges.ravel().tolist()))
        for said in _gdtof.detector_checked(self._described()):
            # The caller's line is behind the one that makes the object.
            warnings.warn(said, UserWarning, stacklevel=3)

    @classmethod
    def load(cls, path: str | PathLike[str], bins: int) -> Detector:
        """The detector that a file describes, as ``gdtof range --detector`` reads it.

        Parameters
        ----------
        path
            TOML file.
        bins
            Bins of a histogram.
        """
        keys = json.loads(_gdtof.detector_file(fspath(path)))
        together = keys["coincidence"]
        is_first = keys["counts"] == "first"
        return cls(
            bins,
            keys["bin_width_ns"],
            keys["pulse_fwhm_ns"],
            keys["start_ns"],
            first_of=keys["laser_cycles"] if is_first else None,
            bin_edges_ns=keys["bin_edges_ns"],
            laser_cycles=None if is_first else keys["laser_cycles"],
            coincidence=None if together is None else Coincidence(**together),
            most_counts=keys["most_counts"],
        )

    def _described(self) -> tuple[int, str]:
        together = self.coincidence
        keys = {
            "bin_width_ns": self.bin_ns,
            "bin_edges_ns": self.bin_edges_ns,
            "start_ns": self.start_ns,
            "pulse_fwhm_ns": self.pulse_fwhm_ns,
            "counts": "every" if self.first_of is None else "first",
            "laser_cycles": self.laser_cycles if self.first_of is None else self.first_of,
            "most_counts": self.most_counts,
            "coincidence": None if together is None else Coincidence(*together)._asdict(),
        }
        return self.bins, json.dumps(keys, default=_plain)

    def _zones(self, counts: ArrayLike) -> tuple[NDArray[np.uint32], tuple[int, ...]]:
        numbers = whole("counts", _rows(counts))
        if numbers.ndim == 0 or numbers.shape[-1] != self.bins:
            raise InputError(f"counts: is an array of shape {numbers.shape}; give {self.bins} bins in the last axis")
        if numbers.size and not 0 <= numbers.min() <= numbers.max() <= np.iinfo(np.uint32).max:
            raise InputError("counts: are from 0 to 4294967295; give such")
        return np.ascontiguousarray(numbers.reshape(-1, self.bins), dtype=np.uint32), numbers.shape[:-1]

    def crosstalk(self, counts: ArrayLike, *, fit: bool = False) -> NDArray[np.float64]:
        """Photons of a cover glass in each bin of one histogram, for :meth:`range`: zones × bins.

        Of a coincidence, too, these are photons and not events: the light of the echoes whose mean histogram fits the counts.

        Parameters
        ----------
        counts
            Captures × zones × bins: of captures without a target, or of any captures with ``fit``.
        fit
            Take the echo nearest to the sensor in the sum of all captures for the glass.
        """
        flat, shape = self._zones(counts)
        if len(shape) != 2:
            raise InputError(f"counts: is an array of shape {(*shape, self.bins)}; give captures × zones × bins")
        sums = flat.reshape(*shape, self.bins).sum(axis=0, dtype=np.uint64)
        if sums.size and sums.max() > np.iinfo(np.uint32).max:
            raise InputError("counts: are more than 4294967295 in all captures; give fewer captures")
        return _gdtof.detector_crosstalk(self._described(), sums.astype(np.uint32), shape[0], fit)

    def range(
        self,
        counts: ArrayLike,
        *,
        crosstalk: ArrayLike | None = None,
        false_alarm_rate: float = 1e-3,
        correct_walk: bool = True,
    ) -> Detected:
        """Finds depths in histograms.

        Parameters
        ----------
        counts
            Whole numbers of any type, bins in the last axis, the earliest first. A table of pandas or Arrow has a row for each zone, and a column
            for each bin or one column of lists.
        crosstalk
            Photons of a cover glass in each bin, in the shape of ``counts`` or of its last axes, as of :meth:`crosstalk`.
        false_alarm_rate
            Share of zones without an echo that may get a depth.
        correct_walk
            Take the range walk of strong echoes out, where first photons count.

        Raises
        ------
        InputError
            What cannot be, and what would help.
        """
        zones, shape = self._zones(counts)
        known = None
        if crosstalk is not None:
            light = np.asarray(crosstalk, dtype=np.float64)
            if not (np.isfinite(light).all() and (light >= 0).all()):
                raise InputError("crosstalk: holds what is no number of photons; give numbers from 0")
            try:
                light = np.broadcast_to(light, (*shape, self.bins))
            except ValueError:
                raise InputError(
                    f"crosstalk: is an array of shape {light.shape}; give one of {(*shape, self.bins)} or its last axes"
                ) from None
            known = np.ascontiguousarray(light.reshape(-1, self.bins))
        found = _gdtof.detector_range(self._described(), zones, known, float(false_alarm_rate), correct_walk)
        if found["remark"] is not None:
            warnings.warn(found["remark"], UserWarning, stacklevel=2)

        def of_first(name: str) -> NDArray[np.float64]:
            return np.ascontiguousarray(found[name][:, 0]).reshape(shape)

        def of_all(name: str) -> NDArray[np.float64]:
            array: NDArray[np.float64] = found[name].reshape(*shape, found[name].shape[-1])
            return array

        return Detected(
            depth=of_first("depth"),
            bound=of_first("bound"),
            spread=of_first("spread"),
            photons=of_first("photons"),
            confidence=of_first("confidence"),
            returns=of_all("depth"),
            returns_bound=of_all("bound"),
            returns_photons=of_all("photons"),
            reason=np.array(found["reason"], dtype=np.str_).reshape(shape),
            walk_left=found["walk_left"].reshape(shape),
        )

    def expected(self, depth_m: float, photons: float, background: float = 0.0) -> NDArray[np.float64]:
        """The mean count of each bin in light of one surface.

        Parameters
        ----------
        depth_m
            Distance of the surface, m.
        photons
            Photons of its echo in all laser cycles.
        background
            Background photons in all bins and all laser cycles, evenly spread.
        """
        if not (np.isfinite(depth_m) and 0 <= photons < 1e18 and 0 <= background < 1e18):
            raise InputError("photons and background: are from 0 to 1e18, and depth_m is a number; give such")
        return _gdtof.detector_expected(self._described(), (float(depth_m), float(photons), float(background)))

    def check(self, counts: ArrayLike, expected: ArrayLike) -> list[Agreement]:
        """Whether counts are what this detector has that expects these means: one answer for each zone.

        Parameters
        ----------
        counts
            Whole numbers, bins in the last axis.
        expected
            Means in the same shape, as of :meth:`expected`, or one histogram for all zones.
        """
        zones, _ = self._zones(counts)
        means = np.asarray(expected, dtype=np.float64)
        if means.ndim == 1:
            means = np.broadcast_to(means, (len(zones), len(means)))
        means = np.ascontiguousarray(means.reshape(-1, means.shape[-1]))
        if not (np.isfinite(means).all() and (means >= 0).all()):
            raise InputError("expected: holds what is no mean; give numbers from 0")
        return [Agreement(*one) for one in _gdtof.detector_agreement(self._described(), zones, means)]
