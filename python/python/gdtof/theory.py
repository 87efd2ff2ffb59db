"""Chapter 3 of the thesis: how often the echo is found, how precisely, and what few bins cost.

Arguments are numbers or arrays, which are broadcast against each other; results have their common shape.
"""

from __future__ import annotations

from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _gdtof
from ._arguments import numbers, whole
from .errors import InputError

__all__ = [
    "any_periods_hz",
    "confidence",
    "cramer_rao",
    "cramer_rao_laser_cycles",
    "detection_probability",
    "laser_cycles_for",
    "miss_probability",
    "non_paralysable_hz",
    "odd_periods_hz",
    "paralysable_hz",
    "penalty",
    "scheme_laser_cycles",
    "stereo_depth_error_m",
    "thompson",
    "thompson_best_ratio",
    "tolerated_sigma_m",
    "xor_edges_hz",
]

Model: TypeAlias = Literal[
    "poisson",
    "poisson_strict",
    "poisson_loose",
    "bernoulli",
    "bernoulli_strict",
    "bernoulli_loose",
    "gaussian",
    "gaussian_as_printed",
]
"""How P_D is computed: Poisson counts, or one hit a bin and laser cycle (bernoulli), as the chip has it; ties are won by lot, never
(strict) or always (loose). The Gaussians are Eq. 18 and 19, as meant and as printed."""

Scheme: TypeAlias = Literal["full", "zooming", "sliding"]
Precision: TypeAlias = Literal["thompson", "cramer_rao"]
Numbers: TypeAlias = NDArray[np.float64]


def _apply(
    name: str,
    words: list[str],
    columns: dict[str, ArrayLike],
    least: dict[str, float] | None = None,
) -> Numbers:
    arrays = {key: numbers(value) for key, value in columns.items()}
    for key, bound in (least or {}).items():
        wrong = ~(np.isfinite(arrays[key]) & (arrays[key] >= bound))
        if wrong.any():
            raise InputError(f"{key}: {arrays[key][wrong].flat[0]} is impossible; give {bound:g} or more")
    try:
        together = np.broadcast_arrays(*arrays.values())
    except ValueError as error:
        shapes = ", ".join(f"{key} {array.shape}" for key, array in arrays.items())
        raise InputError(f"{name}: shapes do not go together: {shapes}; give equal ones") from error
    flat = [np.ascontiguousarray(array, np.float64).ravel() for array in together]
    return _gdtof.theory(name, words, flat).reshape(together[0].shape)


def _of_light(
    name: str, signal: ArrayLike, background: ArrayLike, bins: ArrayLike, last: dict[str, ArrayLike], model: str
) -> Numbers:
    columns = {"signal": signal, "background": background, "bins": bins, **last}
    least = dict.fromkeys(columns, 0.0) | {"bins": 1.0}
    return _apply(name, [model], columns, least)


def detection_probability(
    signal: ArrayLike, background: ArrayLike, bins: ArrayLike, laser_cycles: ArrayLike, model: Model = "poisson"
) -> Numbers:
    """P_D: how often the signal bin is the fullest (Eq. 17).

    `signal` photons in the signal bin and `background` photons in each of `bins` bins, in a laser cycle on average.
    """
    last = {"laser_cycles": laser_cycles}
    return _of_light("detection_probability", signal, background, bins, last, model)


def miss_probability(
    signal: ArrayLike, background: ArrayLike, bins: ArrayLike, laser_cycles: ArrayLike, model: Model = "poisson"
) -> Numbers:
    """1 - P_D with its own full accuracy, also where it is very small; arguments as of :func:`detection_probability`."""
    last = {"laser_cycles": laser_cycles}
    return _of_light("miss_probability", signal, background, bins, last, model)


def laser_cycles_for(
    probability: ArrayLike, signal: ArrayLike, background: ArrayLike, bins: ArrayLike, model: Model = "poisson"
) -> Numbers:
    """Laser cycles until P_D reaches `probability`, NaN where none do; light as of :func:`detection_probability`."""
    return _of_light("laser_cycles_for", signal, background, bins, {"probability": probability}, model)


def thompson(bin_ns: ArrayLike, sigma_ns: ArrayLike, background: ArrayLike, signal: ArrayLike) -> Numbers:
    """Standard deviation of a measured time after Thompson, ns (Eq. 20).

    Bins of `bin_ns`, a pulse of standard deviation `sigma_ns`, `background` counts in each bin, `signal` counts in all.
    """
    columns = {"bin_ns": bin_ns, "sigma_ns": sigma_ns, "background": background, "signal": signal}
    return _apply("thompson", [], columns, dict.fromkeys(columns, 0.0))


def cramer_rao(bin_ns: ArrayLike, sigma_ns: ArrayLike, background: ArrayLike, signal: ArrayLike) -> Numbers:
    """The Cramér-Rao bound of a Gaussian pulse's time in bins, ns; arguments as of :func:`thompson`."""
    columns = {"bin_ns": bin_ns, "sigma_ns": sigma_ns, "background": background, "signal": signal}
    return _apply("cramer_rao", [], columns, dict.fromkeys(columns, 0.0))


def cramer_rao_laser_cycles(
    target_ns: ArrayLike, bin_ns: ArrayLike, sigma_ns: ArrayLike, background: ArrayLike, signal: ArrayLike
) -> Numbers:
    """Laser cycles for a precision of `target_ns` by that bound; counts of `background` and `signal` are those of one laser cycle."""
    columns = {
        "target_ns": target_ns,
        "bin_ns": bin_ns,
        "sigma_ns": sigma_ns,
        "background": background,
        "signal": signal,
    }
    return _apply("cramer_rao_laser_cycles", [], columns, dict.fromkeys(columns, 0.0))


def thompson_best_ratio(background: ArrayLike, signal: ArrayLike) -> Numbers:
    """The ratio of bin to pulse width (standard deviation) with the best precision by :func:`thompson` (Eq. 21)."""
    columns = {"background": background, "signal": signal}
    return _apply("thompson_best_ratio", [], columns, dict.fromkeys(columns, 0.0))


def scheme_laser_cycles(
    scheme: Scheme,
    range_m: ArrayLike,
    *,
    signal: ArrayLike,
    background_hz: ArrayLike,
    pulse_sigma_s: ArrayLike,
    precision_m: ArrayLike,
    probability: ArrayLike,
    bins: ArrayLike,
    bin_s: ArrayLike,
    overlap: ArrayLike = 0,
    model: Model = "poisson",
    precision: Precision = "thompson",
) -> Numbers:
    """Laser cycles that a full (or guided), zooming or sliding histogram takes for a target at `range_m` (3.3.3, 3.4).

    Parameters
    ----------
    scheme
        full (which a guided one is, in the right window), zooming or sliding.
    range_m
        Distance of the target, m.
    signal
        Signal photons a pulse at 1 m; they fall with the square of the distance.
    background_hz
        Background photons, 1/s.
    pulse_sigma_s
        Standard deviation of the pulse, s.
    precision_m
        Standard deviation of the distance that is wanted, m.
    probability
        Probability of detection that is wanted.
    bins, bin_s
        Bins of the histogram, and the length of one, s.
    overlap
        Bins that each window of a sliding histogram repeats of the one before.
    model, precision
        The formulas that are believed.
    """
    columns: dict[str, ArrayLike] = {
        "range_m": range_m,
        "signal": signal,
        "background_hz": background_hz,
        "pulse_sigma_s": pulse_sigma_s,
        "precision_m": precision_m,
        "probability": probability,
        "bins": bins,
        "bin_s": bin_s,
        "overlap": overlap,
    }
    if np.any(np.asarray(overlap) >= np.asarray(bins)):
        raise InputError("overlap: a window repeats fewer bins than it has; give less than bins")
    least = dict.fromkeys(columns, 0.0) | {"bins": 1.0}
    return _apply("scheme_laser_cycles", [scheme, model, precision], columns, least)


def penalty(scheme: Scheme, range_m: ArrayLike, **keys: Any) -> Numbers:
    """How many times the laser cycles of a guided histogram another scheme takes; arguments as of :func:`scheme_laser_cycles`."""
    return scheme_laser_cycles(scheme, range_m, **keys) / scheme_laser_cycles("full", range_m, **keys)


def tolerated_sigma_m(clk_hz: ArrayLike, bins: ArrayLike) -> Numbers:
    """The greatest standard deviation of a guide of which ±3 fit into the window of `bins` CLK periods, m (Eq. 25)."""
    columns = {"clk_hz": clk_hz, "bins": bins}
    return _apply("tolerated_sigma_m", [], columns, {"clk_hz": 1.0, "bins": 1.0})


def stereo_depth_error_m(
    depth_m: ArrayLike, disparity_error_px: ArrayLike, focal_px: ArrayLike, baseline_m: ArrayLike
) -> Numbers:
    """Depth error of a camera pair for a small disparity error, m (Eq. 27)."""
    columns = {
        "depth_m": depth_m,
        "disparity_error_px": disparity_error_px,
        "focal_px": focal_px,
        "baseline_m": baseline_m,
    }
    return _apply("stereo_depth_error_m", [], columns)


def non_paralysable_hz(photons_hz: ArrayLike, dead_time_s: ArrayLike) -> Numbers:
    """Avalanches of a SPAD, 1/s, in light of `photons_hz` that it would detect."""
    columns = {"photons_hz": photons_hz, "dead_time_s": dead_time_s}
    return _apply("non_paralysable_hz", [], columns, dict.fromkeys(columns, 0.0))


def paralysable_hz(pulses_hz: ArrayLike, width_s: ArrayLike) -> Numbers:
    """Edges of a wire that every pulse prolongs, 1/s, to which an OR tree of many SPADs comes."""
    columns = {"pulses_hz": pulses_hz, "width_s": width_s}
    return _apply("paralysable_hz", [], columns, dict.fromkeys(columns, 0.0))


def xor_edges_hz(toggles_hz: ArrayLike, gate_delay_s: ArrayLike) -> Numbers:
    """Edges of an XOR tree, 1/s, into which toggles come at random."""
    columns = {"toggles_hz": toggles_hz, "gate_delay_s": gate_delay_s}
    return _apply("xor_edges_hz", [], columns, dict.fromkeys(columns, 0.0))


def any_periods_hz(spads: ArrayLike, avalanches_hz: ArrayLike, clk_hz: ArrayLike) -> Numbers:
    """CLK periods, 1/s, in which any of `spads` SPADs fires: what synchronous summation counts."""
    columns = {"spads": spads, "avalanches_hz": avalanches_hz, "clk_hz": clk_hz}
    return _apply("any_periods_hz", [], columns, dict.fromkeys(columns, 0.0))


def odd_periods_hz(spads: ArrayLike, avalanches_hz: ArrayLike, clk_hz: ArrayLike) -> Numbers:
    """CLK periods, 1/s, in which an odd number of `spads` SPADs fire, which is what a sampled XOR tree tells."""
    columns = {"spads": spads, "avalanches_hz": avalanches_hz, "clk_hz": clk_hz}
    return _apply("odd_periods_hz", [], columns, dict.fromkeys(columns, 0.0))


def confidence(histograms: ArrayLike, pulse_sigma_bins: float, laser_cycles: int) -> Numbers:
    """How sure it is that histograms hold an echo, whose bins are their last axis: -log10 of the chance that light without an echo makes
    as full a stretch.

    The stretch is as wide as finds a pulse of standard deviation `pulse_sigma_bins` with the fewest counts.
    """
    counts = whole("histograms", histograms)
    if counts.ndim == 0 or counts.size == 0:
        raise InputError("histograms: holds no counts; give an array whose last axis is that of bins")
    if counts.min() < 0 or counts.max() > np.iinfo(np.uint32).max:
        raise InputError("histograms: counts are from 0 to 4294967295; give such")
    if not pulse_sigma_bins > 0 or laser_cycles < 1:
        raise InputError("pulse_sigma_bins, laser_cycles: are above 0; give such")
    rows = np.ascontiguousarray(counts.reshape(-1, counts.shape[-1]), np.uint32)
    return _gdtof.confidence(rows, pulse_sigma_bins, laser_cycles).reshape(counts.shape[:-1])
