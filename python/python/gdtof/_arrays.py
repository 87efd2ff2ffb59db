"""What frames hold: arrays by macropixel, and why some have no depth."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ._gdtof import REASONS, WALKS_LEFT
from .errors import InputError

Map: TypeAlias = Literal["depth", "guide", "truth", "peak", "error", "confidence", "reason", "counts"]

REASON_NAMES = ("depth", *REASONS)
"""By :class:`Reason`."""

WALK_LEFT_NAMES = ("none", *WALKS_LEFT)
"""By :class:`WalkLeft`."""

SPEED_OF_LIGHT_M_PER_S = 299_792_458.0


class Reason(IntEnum):
    """Why a macropixel has no depth: the first of these that holds."""

    DEPTH = 0
    """It has one."""
    NO_SURFACE = 1
    """It sees the sky."""
    NO_GUIDE = 2
    """The guide has no estimate; its SPADs are off."""
    OUT_OF_REACH = 3
    """No start value opens a window on the guide's estimate; its SPADs are off."""
    SPADS_OFF = 4
    """No SPAD can fire."""
    SATURATED = 5
    """A bin of the peak is full."""
    OUTSIDE_WINDOW = 6
    """The surface lies outside the window, and no peak is significant."""
    NO_SIGNIFICANT_PEAK = 7
    """The surface lies in the window, and no peak is significant."""
    BEHIND_LIDAR = 8
    """The echo seems to come from behind the lidar, by more than its bound."""


class WalkLeft(IntEnum):
    """Why a depth has no bound: range walk is left in it, or was taken out to a bin only."""

    NONE = 0
    """Nothing is left, or there is no depth."""
    DELAY_LINE = 1
    """On the line that a delay line's SPADs share photons cancel."""
    COUNTER_TDC = 2
    """A counter TDC adds up SPADs."""
    JOINED_SPADS = 3
    """The front end joins SPADs on one line."""
    SHORT_LASER_CYCLE = 4
    """SPADs have not recovered from one echo before the window opens again."""
    PULSE_SHAPE = 5
    """The laser pulse is measured, and no Gaussian."""
    NOT_ONE_ECHO = 6
    """The counts are not those of one echo of the laser pulse."""
    CUT_ECHO = 7
    """The echo's centre lies outside the window, and what is within does not tell its width."""
    TO_A_BIN = 8
    """The counts tell only the bin; the bound is one."""
    AMBIGUOUS = 9
    """Two different lights give such counts."""
    NOT_CONVERGED = 10
    """No most likely light was found."""


def reason_name(reason: Reason) -> str:
    """As the tables and pictures of `gdtof frame` have it."""
    return REASON_NAMES[reason]


@dataclass(frozen=True, eq=False, repr=False)
class FrameArrays:
    """The arrays of :class:`Maps`, and what follows from them."""

    histograms: NDArray[np.uint16]
    """Counts, shape (rows, cols, bins), bin 0 earliest."""
    bin_edges_ns: NDArray[np.float64]
    """Edges of the bins after STOP, ns, shape (rows, cols, bins + 1); NaN where the window does not open."""
    depth: NDArray[np.float64]
    """Measured distance, m, where a peak is significant and not saturated."""
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
    guide: NDArray[np.float64]
    """The guide's estimate, m."""
    truth: NDArray[np.float64]
    """True distance, m; NaN for the sky."""
    peak: NDArray[np.float64]
    """Distance of the histogram's peak with its range walk, m, significant or not."""
    confidence: NDArray[np.float64]
    """-log10 of the chance that light without an echo makes such a peak; NaN where there is no peak."""
    reason: NDArray[np.uint8]
    """Why there is no depth, a :class:`Reason`; 0 where there is one."""
    walk_left: NDArray[np.uint8]
    """Why a depth has no bound, or one of a bin, a :class:`WalkLeft`; 0 elsewhere."""
    start: NDArray[np.int32]
    """Start value of the P-counter; -1 where SPADs are off."""
    in_window: NDArray[np.bool_]
    """Whether the echo's centre lies in the time window."""
    points: NDArray[np.float64]
    """Where macropixels with a depth see their surface, m from the lidar: x right, y down, z forward, shape (depths, 3), row by row. In the files
    of `gdtof export frame` they are the points whose `return` is 1, in float32; ``np.isfinite(depth)`` says whose they are."""
    bin_m: float
    """Light's way there and back in one bin, as a distance, m."""
    summary: dict[str, Any]
    """The frame in a few numbers, as in frame.json; distances in m."""
    work: dict[str, int]
    """What the engine did, and what it left out."""
    run_times: dict[str, float]
    """Wall-clock seconds of each phase of the simulation."""

    @property
    def shape(self) -> tuple[int, int, int]:
        """Rows, columns and bins."""
        rows, cols, bins = self.histograms.shape
        return rows, cols, bins

    @property
    def error(self) -> NDArray[np.float64]:
        """Measured less true distance, m; NaN where one of them is missing."""
        return self.depth - self.truth

    @property
    def counts(self) -> NDArray[np.uint32]:
        """Counts of all bins together."""
        counts: NDArray[np.uint32] = self.histograms.sum(axis=2, dtype=np.uint32)
        return counts

    @property
    def bin_edges_m(self) -> NDArray[np.float64]:
        """Edges of the bins as distances, m, shape (rows, cols, bins + 1)."""
        return self.bin_edges_ns * (SPEED_OF_LIGHT_M_PER_S / 2.0 * 1e-9)

    def map(self, name: Map) -> NDArray[Any]:
        """One of the maps by name."""
        if name not in ("depth", "guide", "truth", "peak", "error", "confidence", "reason", "counts"):
            raise InputError(
                f"{name!r} is not a map; give depth, guide, truth, peak, error, confidence, reason or counts"
            )
        array: NDArray[Any] = getattr(self, name)
        return array
