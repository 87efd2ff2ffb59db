"""Frames as datasets of xarray and tables of pandas."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ._arrays import WALK_LEFT_NAMES, FrameArrays, Reason, WalkLeft, reason_name
from ._gdtof import __version__

if TYPE_CHECKING:
    import pandas
    import xarray

MAPS = {
    "depth": ("measured distance along the ray", "m"),
    "bound": ("standard deviation of the measured distance by its counts", "m"),
    "spread": ("standard deviation of the depths within the macropixel", "m"),
    "guide": ("the guide's estimate", "m"),
    "truth": ("true distance", "m"),
    "peak": ("distance of the histogram's peak with its range walk", "m"),
    "confidence": ("-log10 of the chance of such a peak without an echo", "1"),
    "reason": ("why there is no depth", "1"),
    "walk_left": ("why a depth has no bound", "1"),
    "start": ("start value of the P-counter, -1 where SPADs are off", "1"),
    "in_window": ("whether the echo lies in the time window", "1"),
}


def to_xarray(frame: FrameArrays, described: dict[str, Any], placed: dict[str, Any]) -> xarray.Dataset:
    """The arrays of a frame, with what else is said of it as attributes and as coordinates."""
    try:
        import xarray
    except ImportError as error:
        raise ImportError("datasets need xarray; pip install 'gdtof[xarray]'") from error
    rows, cols, bins = frame.shape
    variables: dict[str, Any] = {
        name: (("row", "col"), getattr(frame, name), {"long_name": what, "units": unit})
        for name, (what, unit) in MAPS.items()
    }
    variables["reason"][2]["flag_values"] = np.array(list(Reason), np.uint8)
    variables["reason"][2]["flag_meanings"] = " ".join(reason.name.lower() for reason in Reason)
    variables["walk_left"][2]["flag_values"] = np.array(list(WalkLeft), np.uint8)
    variables["walk_left"][2]["flag_meanings"] = " ".join(why.name.lower() for why in WalkLeft)
    counts = {"long_name": "counts", "units": "1"}
    variables["histograms"] = (("row", "col", "bin"), frame.histograms, counts)
    edges = {"long_name": "edges of the bins after STOP", "units": "ns"}
    variables["bin_edges"] = (("row", "col", "edge"), frame.bin_edges_ns, edges)
    counted = {"row": (rows, "row"), "col": (cols, "column"), "bin": (bins, "bin, 0 earliest"), "edge": (bins + 1, "edge of a bin")}
    coords: dict[str, Any] = {
        name: (name, np.arange(count, dtype=np.int32), {"long_name": what, "units": "1"})
        for name, (count, what) in counted.items()
    }
    # NetCDF has numbers and texts as attributes, and neither None nor truth values.
    attrs: dict[str, Any] = {"source": f"gdtof {__version__}", "bin_m": frame.bin_m} | described
    return xarray.Dataset(variables, coords | placed, attrs)


def to_pandas(frame: FrameArrays) -> pandas.DataFrame:
    try:
        import pandas
    except ImportError as error:
        raise ImportError("tables need pandas; pip install 'gdtof[pandas]'") from error
    rows, cols, _ = frame.shape
    columns = {name: getattr(frame, name).ravel() for name in MAPS if name not in ("reason", "walk_left")}
    columns["counts"] = frame.counts.ravel()
    index = pandas.MultiIndex.from_product([np.arange(rows), np.arange(cols)], names=["row", "col"])
    table: pandas.DataFrame = pandas.DataFrame(columns, index=index)
    names = pandas.Index([reason_name(reason) for reason in Reason])
    codes = frame.reason.ravel().astype(np.int64)
    table["reason"] = pandas.Categorical.from_codes(codes, categories=names)
    walks = frame.walk_left.ravel().astype(np.int64)
    table["walk_left"] = pandas.Categorical.from_codes(walks, categories=pandas.Index(WALK_LEFT_NAMES))
    return table
