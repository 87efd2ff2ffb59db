"""Histograms of any sensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _gdtof
from ._arguments import whole
from .errors import InputError

_FWHM_PER_SIGMA = 2.354820045


@dataclass(frozen=True, eq=False)
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


class Agreement(NamedTuple):
    """What :meth:`Detector.check` gives."""

    chi_squared: float
    """Sum of squared deviations, each over its variance."""
    cells: int
    """Cells that were compared; bins with few counts are put together."""
    p: float
    """Chance that counts of the expected light deviate at least as much. Below 0.001 the counts are of other light, or counted wrong."""


@dataclass(frozen=True)
class Detector:
    """A sensor whose histograms are ranged: how long its bins are, and which photons they count.

    >>> import gdtof
    >>> tof = gdtof.Detector(bins=64, bin_ns=1.0, pulse_fwhm_ns=2.0)
    >>> mean = tof.expected(depth_m=4.0, photons=400, background=640)
    >>> found = tof.range(mean.round())
    >>> bool(abs(found.depth - 4.0) < 0.02)
    True
    """

    bins: int
    """Bins of a histogram."""
    bin_ns: float
    """Length of a bin, ns."""
    pulse_fwhm_ns: float
    """Full width at half maximum of the laser pulse with all jitter, ns."""
    start_ns: float = 0.0
    """When bin 0 begins after the centre of the laser pulse has left, ns."""
    first_of: int | None = None
    """Laser cycles of a histogram, if each counts its first photon only; None if bins count every photon."""

    def __post_init__(self) -> None:
        for name, value, least, most in (
            ("bins", self.bins, 2, 65536),
            ("bin_ns", self.bin_ns, 1e-3, 1e6),
            ("pulse_fwhm_ns", self.pulse_fwhm_ns, 0.0, 0.5 * self.bin_ns * self.bins),
            ("start_ns", self.start_ns, -1e9, 1e9),
            ("first_of", 1 if self.first_of is None else self.first_of, 1, 2**32 - 1),
        ):
            if not least <= value <= most:
                raise InputError(f"{name}: {value} is impossible; give {least} to {most}")

    def _spelled(self) -> tuple[int, float, float, float, int | None]:
        sigma_s = 1e-9 * self.pulse_fwhm_ns / _FWHM_PER_SIGMA
        return self.bins, 1e-9 * self.bin_ns, 1e-9 * self.start_ns, sigma_s, self.first_of

    def _zones(self, counts: ArrayLike) -> tuple[NDArray[np.uint32], tuple[int, ...]]:
        numbers = whole("counts", counts)
        if numbers.ndim == 0 or numbers.shape[-1] != self.bins:
            raise InputError(f"counts: is an array of shape {numbers.shape}; give {self.bins} bins in the last axis")
        if numbers.size and not 0 <= numbers.min() <= numbers.max() <= np.iinfo(np.uint32).max:
            raise InputError("counts: are from 0 to 4294967295; give such")
        return np.ascontiguousarray(numbers.reshape(-1, self.bins), dtype=np.uint32), numbers.shape[:-1]

    def range(self, counts: ArrayLike, *, false_alarm_rate: float = 1e-3, correct_walk: bool = True) -> Detected:
        """Finds depths in histograms.

        Parameters
        ----------
        counts
            Whole numbers of any type, bins in the last axis, the earliest first.
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
        found = _gdtof.detector_range(self._spelled(), zones, float(false_alarm_rate), correct_walk)

        def of_first(name: str) -> NDArray[np.float64]:
            return np.ascontiguousarray(found[name][:, 0]).reshape(shape)

        def of_all(name: str) -> NDArray[np.float64]:
            array: NDArray[np.float64] = found[name].reshape(*shape, -1)
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
        return _gdtof.detector_expected(self._spelled(), (float(depth_m), float(photons), float(background)))

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
        return [Agreement(*one) for one in _gdtof.detector_agreement(self._spelled(), zones, means)]
