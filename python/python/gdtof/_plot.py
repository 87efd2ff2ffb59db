"""Pictures of frames, with matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ._arrays import FrameArrays, Map, Reason, reason_name
from .errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TITLES: dict[Map, str] = {
    "depth": "depth (m)",
    "guide": "guide (m)",
    "truth": "truth (m)",
    "peak": "peak (m)",
    "error": "depth less truth (m)",
    "confidence": "confidence",
    "reason": "why there is no depth",
    "counts": "counts",
}

DISTANCES = ("depth", "guide", "truth", "peak")

NOTHING = "0.8"
"""Grey of macropixels without a value."""

REASON_COLOURS = ["white", "#d9d9d9", "#80b1d3", "#bebada", "#666666", "#fb8072", "#fdb462", "#8dd3c7", "#8b5a2b"]
"""One for each reason, that of a depth first; told apart by their brightness, too."""

MOST_BY_DEFAULT = 8


def _pyplot() -> Any:
    try:
        import matplotlib.pyplot as plt
    except ImportError as error:
        raise ImportError("plots need matplotlib; pip install 'gdtof[plot]'") from error
    return plt


def plot_maps(frame: FrameArrays, maps: list[Map], title: str | None) -> Figure:
    plt = _pyplot()
    if not 1 <= len(maps) <= MOST_BY_DEFAULT:
        raise InputError(f"maps: {len(maps)} maps; give 1 to {MOST_BY_DEFAULT}")
    rows, cols, _ = frame.shape
    arrays = [frame.map(name) for name in maps]
    across = min(len(maps), 2) if cols > rows * 1.5 else min(len(maps), 4)
    down = -(-len(maps) // across)
    width = 3.6
    figure, axes = plt.subplots(
        down,
        across,
        figsize=(width * across, down * (width * 0.85 * rows / cols + 0.7)),
        squeeze=False,
        layout="constrained",
    )
    shown = [a[np.isfinite(a)] for name, a in zip(maps, arrays, strict=True) if name in DISTANCES]
    all_m = np.concatenate(shown) if shown else np.empty(0)
    near, far = np.percentile(all_m, [1, 99]) if all_m.size else (0.0, 1.0)
    for at, (name, array) in enumerate(zip(maps, arrays, strict=True)):
        ax = axes[at // across, at % across]
        if name == "reason":
            _reasons(ax, array)
        else:
            _map(figure, ax, name, array, near, far, frame.bin_m)
        ax.set_title(TITLES[name], fontsize=10)
        ax.set_xticks([])
        ax.set_yticks([])
    for at in range(len(maps), down * across):
        axes[at // across, at % across].set_axis_off()
    if title:
        figure.suptitle(title)
    # Notebooks show what a cell returns; another reference would show it twice.
    plt.close(figure)
    return figure  # type: ignore[no-any-return]


def _map(
    figure: Any, ax: Any, name: Map, array: Any, near: float, far: float, bin_m: float
) -> None:
    import matplotlib

    limits: dict[str, Any] = {}
    colours = "viridis"
    if name in DISTANCES:
        limits, colours = {"vmin": near, "vmax": far}, "turbo"
    elif name == "error":
        limits, colours = {"vmin": -bin_m, "vmax": bin_m}, "RdBu_r"
    shades = matplotlib.colormaps[colours].with_extremes(bad=NOTHING)
    image = ax.imshow(np.ma.masked_invalid(array), cmap=shades, interpolation="nearest", **limits)
    extend = "both" if name == "error" else "neither"
    figure.colorbar(image, ax=ax, shrink=0.8, extend=extend)


def _reasons(ax: Any, array: Any) -> None:
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch

    edges = np.arange(len(REASON_COLOURS) + 1) - 0.5
    norm = BoundaryNorm(edges, len(REASON_COLOURS))
    ax.imshow(array, cmap=ListedColormap(REASON_COLOURS), norm=norm, interpolation="nearest")
    there = [Reason(int(value)) for value in np.unique(array)]
    patches = [
        Patch(facecolor=REASON_COLOURS[reason], edgecolor="0.4", label=reason_name(reason)) for reason in there
    ]
    ax.legend(handles=patches, loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=7, frameon=False)


def plot_histogram(frame: FrameArrays, row: int, col: int, ax: Axes | None) -> Axes:
    rows, cols, _ = frame.shape
    if not (0 <= row < rows and 0 <= col < cols):
        raise InputError(
            f"macropixel ({row}, {col}) is outside the {rows}x{cols} array; "
            f"give rows 0 to {rows - 1} and columns 0 to {cols - 1}"
        )
    if ax is None:
        plt = _pyplot()
        figure, ax = plt.subplots(figsize=(6.0, 3.2), layout="constrained")
        plt.close(figure)
    assert ax is not None
    reason = Reason(int(frame.reason[row, col]))
    edges = frame.bin_edges_m[row, col]
    if np.isnan(edges).any():
        ax.text(0.5, 0.5, f"SPADs are off: {reason_name(reason)}", ha="center", va="center", transform=ax.transAxes)
    else:
        ax.stairs(frame.histograms[row, col], edges, fill=True, color="0.75")
        ax.stairs(frame.histograms[row, col], edges, color="0.35")
        marks = (
            ("truth", frame.truth, "tab:green", "-"),
            ("guide", frame.guide, "tab:blue", ":"),
            ("depth", frame.depth, "tab:red", "--"),
        )
        for name, metres, colour, dashes in marks:
            value = float(metres[row, col])
            if np.isfinite(value):
                ax.axvline(value, color=colour, linestyle=dashes, label=f"{name} {value:.2f} m")
        ax.legend(fontsize=8)
        ax.set_xlabel("distance (m)")
        ax.set_ylabel("counts")
    what = f"confidence {frame.confidence[row, col]:.1f}" if reason is Reason.DEPTH else reason_name(reason)
    ax.set_title(f"macropixel ({row}, {col}): {what}", fontsize=10)
    return ax
