"""Pictures of frames, with matplotlib."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._arrays import FrameArrays, Map, Reason, reason_name
from ._gdtof import DEPTH_COLOURS, PATTERNS
from .errors import InputError

try:
    import matplotlib
    from matplotlib import pyplot as plt
    from matplotlib.colors import LinearSegmentedColormap, ListedColormap
    from matplotlib.image import BboxImage
    from matplotlib.legend_handler import HandlerBase
    from matplotlib.patches import Patch, Rectangle
    from matplotlib.transforms import Bbox, TransformedBbox
except ImportError as error:
    raise ImportError("plots need matplotlib; pip install 'gdtof[plot]'") from error

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TITLES: dict[Map, str] = {
    "depth": "Depth",
    "guide": "Guide's estimate",
    "truth": "True distance",
    "peak": "Distance of the highest peak",
    "error": "Error, depth less truth",
    "confidence": "Confidence",
    "reason": "Why there is no depth",
    "counts": "Counts of all bins",
}

SCALES: dict[Map, str] = {
    "depth": "distance (m)",
    "guide": "distance (m)",
    "truth": "distance (m)",
    "peak": "distance (m)",
    "error": "error (m)",
    "confidence": "−log₁₀ of the chance of a false alarm",
    "counts": "counts",
}

DISTANCES = ("depth", "guide", "truth", "peak")

NOTHING = "0.8"
"""Grey of macropixels without a value in maps that are no distances."""

TILES = np.array(PATTERNS, dtype=np.uint8)
"""Patterns of reasons, that of a depth left out: 4x4 greys each, as in depth.png."""

TILE = TILES.shape[1]

DEPTHS = LinearSegmentedColormap.from_list("gdtof_depth", np.array(DEPTH_COLOURS) / 255)
"""Colours of depths, near to far, as in depth.png."""

DEPTH = tuple(np.array(DEPTH_COLOURS[2]) / 255)
"""Colour of all macropixels with a depth, where only reasons are shown."""

MOST_MAPS = 8


def show_figure(figure: Figure, show: bool) -> None:
    """Opens windows if that is wanted and matplotlib has some; else closes the figure for pyplot, which would keep it for ever. Notebooks show
    what a cell returns, and would show it twice."""
    has_windows = getattr(figure.canvas, "required_interactive_framework", None) is not None
    if show and has_windows:
        plt.show()
    else:
        plt.close(figure)


def plot_maps(
    frame: FrameArrays, maps: list[Map], scale_m: tuple[float, float], title: str | None, show: bool
) -> Figure:
    """Maps side by side; distances have the colours of `scale_m`."""
    if not 1 <= len(maps) <= MOST_MAPS:
        raise InputError(f"maps: {len(maps)} maps; give 1 to {MOST_MAPS}")
    rows, cols, _ = frame.shape
    arrays = [frame.map(name) for name in maps]
    across = math.ceil(math.sqrt(len(maps)))
    down = -(-len(maps) // across)
    # Room for a map, its title above and its colour bar on the right.
    width = min(5.0, 15.0 / across)
    height = (width - 0.9) * min(rows / cols, 2.0) + 0.4
    figure, axes = plt.subplots(
        down, across, figsize=(width * across, height * down + 0.5), squeeze=False, layout="constrained"
    )
    reasons: set[Reason] = set()
    for at, (name, array) in enumerate(zip(maps, arrays, strict=True)):
        ax = axes[at // across, at % across]
        if name == "reason":
            ax.imshow(np.where(array == Reason.DEPTH, 1.0, np.nan), cmap=ListedColormap([DEPTH]), interpolation="nearest")
        else:
            _map(figure, ax, name, array, scale_m, frame.bin_m)
        missing = _missing(frame, name)
        _patterns(ax, missing)
        reasons |= {Reason(int(why)) for why in np.unique(missing)} - {Reason.DEPTH}
        ax.set_title(TITLES[name], fontsize=11)
        ax.set_xticks([])
        ax.set_yticks([])
    for at in range(len(maps), down * across):
        axes[at // across, at % across].set_axis_off()
    _legend(figure, frame, sorted(reasons), "reason" in maps)
    if title:
        figure.suptitle(title)
    show_figure(figure, show)
    return figure


def _map(figure: Any, ax: Any, name: Map, array: Any, scale_m: tuple[float, float], bin_m: float) -> None:
    limits: dict[str, Any] = {}
    colours: Any = "inferno"
    if name in DISTANCES:
        limits, colours = {"vmin": scale_m[0], "vmax": scale_m[1]}, DEPTHS
    elif name == "error":
        limits, colours = {"vmin": -bin_m, "vmax": bin_m}, "RdBu_r"
    shades = matplotlib.colormaps.get_cmap(colours).with_extremes(bad=NOTHING)
    image = ax.imshow(np.ma.masked_invalid(array), cmap=shades, interpolation="nearest", **limits)
    bar = figure.colorbar(image, ax=ax, label=SCALES[name], extend="both" if name == "error" else "neither", pad=0.02)
    if name in DISTANCES:
        # Near is on top, as in depth.png.
        bar.ax.invert_yaxis()


def _missing(frame: FrameArrays, name: Map) -> NDArray[np.uint8]:
    """Why a map has no value, as :class:`Reason`; 0 where it has one, or where no reason is shown."""
    if name in ("depth", "reason"):
        return frame.reason
    missing = np.zeros_like(frame.reason)
    sees_nothing = np.isnan(frame.truth)
    if name == "peak":
        has_none = np.isnan(frame.peak)
        missing[has_none] = frame.reason[has_none]
    elif name == "truth":
        missing[sees_nothing] = Reason.NO_SURFACE
    elif name == "guide":
        missing[np.isnan(frame.guide)] = Reason.NO_GUIDE
        missing[np.isnan(frame.guide) & sees_nothing] = Reason.NO_SURFACE
    return missing


def pattern_image(reason: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Red, green, blue and opacity of reasons; transparent where there is a depth. A macropixel is a tile, or several where there are few
    macropixels: a tile is about a 64th of the map."""
    tiles_in_cell = max(1, 64 // max(reason.shape))
    fine = reason.repeat(tiles_in_cell, 0).repeat(tiles_in_cell, 1)
    rows, cols = fine.shape
    tiles = np.concatenate([np.zeros_like(TILES[:1]), TILES])[fine]
    greys = tiles.transpose(0, 2, 1, 3).reshape(rows * TILE, cols * TILE)
    opacity = np.where(fine == Reason.DEPTH, np.uint8(0), np.uint8(255)).repeat(TILE, 0).repeat(TILE, 1)
    return np.dstack([greys, greys, greys, opacity])


def _patterns(ax: Any, missing: NDArray[np.uint8]) -> None:
    if not missing.any():
        return
    rows, cols = missing.shape
    ends = (-0.5, cols - 0.5, rows - 0.5, -0.5)
    image = ax.imshow(pattern_image(missing), extent=ends, interpolation="antialiased")
    # The pointer tells of values, which lie below.
    image.set_mouseover(False)


class _PatternHandler(HandlerBase):
    """Draws a reason's tiles in a legend."""

    def create_artists(
        self, legend: Any, handle: Any, x: float, y: float, width: float, height: float, size: float, trans: Any
    ) -> list[Any]:
        box = TransformedBbox(Bbox.from_bounds(x, y, width, height), trans)
        image = BboxImage(box, interpolation="nearest")
        tiles = np.tile(TILES[handle.reason - 1], (2, 4))
        image.set_data(np.dstack([tiles] * 3))
        edge = Rectangle((x, y), width, height, fill=False, edgecolor="0.2", linewidth=0.8, transform=trans)
        return [image, edge]


class _PatternHandle:
    def __init__(self, reason: Reason) -> None:
        self.reason = reason


def _legend(figure: Any, frame: FrameArrays, reasons: list[Reason], has_depth: bool) -> None:
    def label(reason: Reason) -> str:
        return f"{reason_name(reason)} {(frame.reason == reason).sum()}"

    handles: list[Any] = [_PatternHandle(reason) for reason in reasons]
    labels = [label(reason) for reason in reasons]
    if has_depth:
        handles.insert(0, Patch(facecolor=DEPTH, edgecolor="0.2"))
        labels.insert(0, label(Reason.DEPTH))
    if handles:
        columns = max(1, min(len(handles), int(figure.get_figwidth() // 2.4)))
        # Matplotlib fills column after column; these read row by row.
        order = [entry for column in range(columns) for entry in range(column, len(handles), columns)]
        figure.legend(
            handles=[handles[entry] for entry in order],
            labels=[labels[entry] for entry in order],
            handler_map={_PatternHandle: _PatternHandler()},
            loc="outside lower left",
            ncols=columns,
            fontsize=9,
            frameon=False,
        )


def plot_histogram(frame: FrameArrays, row: int, col: int, ax: Axes | None, show: bool) -> Axes:
    rows, cols, _ = frame.shape
    if not (0 <= row < rows and 0 <= col < cols):
        raise InputError(
            f"macropixel ({row}, {col}) is outside the {rows}x{cols} array; "
            f"give rows 0 to {rows - 1} and columns 0 to {cols - 1}"
        )
    figure: Figure | None = None
    if ax is None:
        figure, ax = plt.subplots(figsize=(6.0, 3.2), layout="constrained")
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
    ax.set_title(f"Macropixel in row {row}, column {col}: {what}", fontsize=10)
    if figure is not None:
        show_figure(figure, show)
    return ax
