"""Frames and drives."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _gdtof
from ._arguments import (
    GuideLike,
    Policy,
    SceneLike,
    SensorLike,
    guide_of,
    policy_of,
    scene_of,
    sensor_of,
    starts_of,
)
from ._arrays import FrameArrays, Map, Reason
from .errors import InputError

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Engine: TypeAlias = Literal["gate", "cycle", "window", "cohort"]


class Hint(NamedTuple):
    """What would help against a reason for missing depths."""

    reason: Reason
    """The reason."""
    surfaces: int
    """Surfaces that have no depth for it."""
    sentence: str
    """How many they are, why, and what to change."""


@dataclass(frozen=True, eq=False, repr=False)
class Maps(FrameArrays):
    """What frames and frames of drives hold: arrays by macropixel, shape (rows, cols) if not said otherwise.

    Arrays own what the simulation made; nothing was copied. Distances are along the ray (not z), in metres, NaN where there is none.
    """

    def plot(
        self,
        maps: Map | Sequence[Map] = ("depth", "truth", "guide", "error"),
        title: str | None = None,
        *,
        show: bool = True,
    ) -> Figure:
        """Maps side by side with matplotlib.

        Distances have the colours of depth.png, and in a frame of a drive those of the whole drive. Macropixels without a depth have the pattern of their reason, which the legend names. In a script a
        window opens, as by ``matplotlib.pyplot.show``.

        Parameters
        ----------
        maps
            One map, or up to eight: depth, guide, truth, peak, error, confidence, reason, counts.
        title
            Above all maps.
        show
            Open a window. Without one the figure is only returned, as it is where matplotlib has no windows (`Agg`, notebooks).
        """
        from ._plot import plot_maps

        names = [maps] if isinstance(maps, str) else list(maps)
        return plot_maps(self, names, self._depth_scale_m(), title, show)

    def plot_histogram(self, row: int, col: int, ax: Axes | None = None, *, show: bool = True) -> Axes:
        """A macropixel's histogram over distance, with the truth, the guide's estimate and the depth; shown as by :meth:`plot`, if `ax`
        is not yours."""
        from ._plot import plot_histogram

        return plot_histogram(self, row, col, ax, show)

    sensor: _gdtof.Sensor
    """The sensor, with a slower CLK where `bins_from_guide` asks for it."""
    scene: _gdtof.Scene
    """The scene."""
    stop_periods: int
    """CLK periods in a laser cycle."""
    laser_cycles: int
    """Laser cycles of the exposure."""
    seed: int
    """Seed of photons and of the guide's errors."""
    engine: Engine
    """The engine; with `tolerance_m` the one that takes what is not on the cohort engine."""

    def _described(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """What a dataset says of it besides its arrays: attributes, and coordinates without dimensions."""
        attrs = {
            "seed": self.seed,
            "engine": self.engine,
            "stop_periods": self.stop_periods,
            "laser_cycles": self.laser_cycles,
            "sensor": self.sensor.to_toml(),
            "scene": self.scene.to_toml(),
            "scene_name": self.scene.name,
        }
        return attrs, {}

    def _depth_scale_m(self) -> tuple[float, float]:
        """Depths at the ends of the colour scale, m."""
        return _gdtof.depth_scale_m(self.depth[np.isfinite(self.depth)].tolist())

    def to_xarray(self) -> xarray.Dataset:
        """All arrays by macropixel as an xarray.Dataset with dimensions row, col, bin and edge.

        Each array has its unit. Attributes of the dataset are what it was taken with: seed, engine, clocks, and sensor and scene as the text of
        TOML files, which `Sensor.from_toml` and `Scene.from_toml` read. `to_netcdf` of the dataset writes all of it."""
        from ._convert import to_xarray

        return to_xarray(self, *self._described())

    def to_pandas(self) -> pandas.DataFrame:
        """A row for each macropixel, indexed by row and col; without histograms."""
        from ._convert import to_pandas

        return to_pandas(self)

    def _repr_html_(self) -> str:
        from ._html import of_frame

        return of_frame(self)


@dataclass(frozen=True, eq=False, repr=False)
class Frame(Maps):
    """A frame. See :func:`frame` for how to take one, and :class:`Maps` for its arrays."""

    remark: str | None
    """Why most surfaces have no depth, where that is so."""
    hints: list[Hint]
    """What would help against rarer reasons for missing depths."""
    kept: dict[str, Any] | None
    """Engines chosen by `tolerance_m`, and the bound they keep."""
    probes: list[tuple[int, int]]
    """Macropixels that were run at gate level, too, and agreed to the count."""
    load_s: float
    """Time the chip needs for the load of start values, s."""
    exposure_s: float
    """Time it exposes, s."""
    readout_s: float
    """Time it needs to give its histograms away, s."""
    _taken: _gdtof.Taken
    """What the files of a frame say of it."""

    def save(self, folder: str | PathLike[str]) -> Path:
        """Writes the frame as `gdtof frame --out` does: frame.json, histograms.npy, depth.png and manifest.json, which `gdtof export frame`,
        `gdtof range`, `gdtof page` and others read.

        All of them or none: they are written beside their places first, and take the place of the set that was there before. Files of
        your own with such names are kept under others, of which a warning tells. The frame is written as it was taken, and of its arrays only
        `histograms` are read again; waveforms of probes stay in the folder that :func:`frame` was given for them.

        Parameters
        ----------
        folder
            Where to; created if missing.

        Returns
        -------
        The folder.

        Raises
        ------
        InputError
            Where it cannot be written.
        """
        path = Path(fspath(folder))
        for sentence in self._taken.save(path, np.ascontiguousarray(self.histograms)):
            warnings.warn(sentence, stacklevel=2)
        return path

    def _described(self) -> tuple[dict[str, Any], dict[str, Any]]:
        attrs, placed = super()._described()
        attrs |= {"load_s": self.load_s, "exposure_s": self.exposure_s, "readout_s": self.readout_s}
        if self.kept is not None:
            attrs["tolerance_m"] = self.kept["tolerance_m"]
        if self.remark is not None:
            attrs["remark"] = self.remark
        if self.hints:
            attrs["hints"] = "\n".join(hint.sentence for hint in self.hints)
        return attrs, placed

    def __repr__(self) -> str:
        return f"<Frame {_outline(self)}>"


@dataclass(frozen=True, eq=False, repr=False)
class DriveFrame(Maps):
    """A frame of a drive. See :func:`drive`, and :class:`Maps` for its arrays."""

    number: int
    """Its number, from 0."""
    times: dict[str, float]
    """When what happened, s on the scene's clock: images_s, load_s, exposure_s, readout_s, end_s."""
    guide_sigma: NDArray[np.float64]
    """Standard deviation that the guide claims, m; infinite where it has no estimate."""
    windows: NDArray[np.float64]
    """From where to where windows see, m, shape (rows, cols, 2)."""
    reused: dict[str, Any]
    """What was not simulated again, because it is provably that of the frame before."""
    scale_m: tuple[float, float]
    """Ends of the colour scale of depths, m: the same in all frames of a drive."""

    def _described(self) -> tuple[dict[str, Any], dict[str, Any]]:
        attrs, placed = super()._described()
        middle = (self.times["exposure_s"] + self.times["readout_s"]) / 2
        said = {"long_name": "middle of the exposure on the scene's clock", "units": "s"}
        return attrs | {"number": self.number}, placed | {"time": ((), middle, said)}

    def _depth_scale_m(self) -> tuple[float, float]:
        return self.scale_m

    def __repr__(self) -> str:
        return f"<DriveFrame {self.number}, {_outline(self)}>"


def _outline(frame: Maps) -> str:
    rows, cols, bins = frame.shape
    depths, targets = frame.summary["depths"], frame.summary["with_target"]
    return f"{rows}x{cols}x{bins}: {depths} depths of {targets} macropixels with a surface"


def _wave_cycles(cycles: int | Literal["all"] | None) -> int | None:
    return -1 if cycles == "all" else cycles


def _path(path: str | PathLike[str] | None) -> str | None:
    return None if path is None else fspath(path)


def frame(
    sensor: SensorLike = None,
    scene: SceneLike = None,
    guide: GuideLike = None,
    *,
    windows: Policy = None,
    tracking: bool = False,
    starts: ArrayLike | None = None,
    stop_periods: int = 520,
    laser_cycles: int = 1000,
    seed: int = 1,
    engine: Engine = "window",
    tolerance_m: float | None = None,
    skip: bool = True,
    false_alarm_rate: float = 1e-3,
    correct_walk: bool = True,
    calibration: str | PathLike[str] | None = None,
    bins_from_guide: bool = False,
    probes: Sequence[tuple[int, int]] = (),
    waves: str | PathLike[str] | None = None,
    wave_cycles: int | Literal["all"] | None = None,
    wave_format: Literal["vcd", "fst"] = "vcd",
    progress: Callable[[int], object] | None = None,
) -> Frame:
    """Takes a guided frame: the same numbers as `gdtof frame`, to the bit.

    Parameters
    ----------
    sensor
        A :class:`Sensor`, or the name or file of one; the QuantIC4x4 without it.
    scene
        A :class:`Scene`, or the name or file of one; the street without it.
    guide
        A :class:`Guide`, its text as `gdtof frame --guide` takes it, several of them, or a map: distances in m, shape (rows, cols), NaN
        where there is none. The scene's camera pair without it.
    windows
        What is changed in the window policy, as a dict or as `gdtof frame --windows` takes it.
    tracking
        Begin with the window policy for sequences.
    starts
        Start values of your own instead of those for the guide, shape (rows, cols) or one for all; -1 switches SPADs off.
    stop_periods
        CLK periods in a laser cycle.
    laser_cycles
        Laser cycles of the exposure.
    seed
        Seed of photons and guide errors.
    engine
        Engine of the macropixels: gate, cycle, window or cohort.
    tolerance_m
        Depth error that a cheaper engine may add on average, m.
    skip
        Leave out what the engine can do without, for the same histograms.
    false_alarm_rate
        Share of macropixels without an echo that may get a depth.
    correct_walk
        Take the range walk of strong echoes out.
    calibration
        File of a bin profile, for sensors with delay lines.
    bins_from_guide
        Slow CLK down until windows are as long as the guide's claimed errors require.
    probes
        Macropixels (row, col) to run at gate level, too: they must agree to the count, and leave waveforms.
    waves
        Folder for these waveforms, which must exist.
    wave_cycles
        Laser cycles that they keep: so many, or "all"; without it those about the first count.
    wave_format
        Their format.
    progress
        Called now and then with the number of macropixels that are done.

    Raises
    ------
    InputError
        What cannot be, and what would help.
    SimulationError
        A disagreement of netlist and models, which would be a fault of this program.

    Notes
    -----
    Other threads of Python go on meanwhile, and Ctrl-C ends it.
    """
    chip = sensor_of(sensor)
    keys = {
        "stop_periods": stop_periods,
        "laser_cycles": laser_cycles,
        "seed": seed,
        "engine": engine,
        "tolerance_m": tolerance_m,
        "skip": skip,
        "false_alarm_rate": float(false_alarm_rate),
        "correct_walk": correct_walk,
        "calibration": _path(calibration),
        "windows": policy_of(windows),
        "bins_from_guide": bins_from_guide,
    }
    if probes and waves is None:
        raise InputError("probes: leave waveforms; give waves, a folder for them")
    wanted = {
        "places": list(probes),
        "folder": _path(waves) or "",
        "format": wave_format,
        "cycles": _wave_cycles(wave_cycles),
    }
    given = None if starts is None else starts_of(starts, chip)
    taken = _gdtof.frame(
        chip, scene_of(scene), guide_of(guide), keys, tracking, given, wanted, progress
    )
    hints = [Hint(Reason(reason), *rest) for reason, *rest in taken.pop("hints")]
    return Frame(**taken, hints=hints)


class Drive(Iterator[DriveFrame]):
    """Frame after frame of a world in motion; see :func:`drive`.

    It ends after its last frame, an error or Ctrl-C. `close`, or leaving a `with`, ends it before.
    """

    def __init__(self, inner: _gdtof.Drive, frames: int | None) -> None:
        self._inner = inner
        self._left = frames

    @property
    def period_s(self) -> float:
        """From one frame to the next, s."""
        return self._inner.period_s

    @property
    def chip_s(self) -> tuple[float, float, float]:
        """What load, exposure and readout take, s."""
        return self._inner.chip_s

    def __iter__(self) -> Drive:
        return self

    def __next__(self) -> DriveFrame:
        if self._left == 0:
            self.close()
            raise StopIteration
        taken = DriveFrame(**self._inner.next_frame())
        if self._left is not None:
            self._left -= 1
        return taken

    def close(self) -> None:
        """Ends the drive."""
        self._left = 0
        self._inner.close()

    def __enter__(self) -> Drive:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


def drive(
    scene: SceneLike = None,
    sensor: SensorLike = None,
    guide: GuideLike = None,
    *,
    frames: int | None = 10,
    windows: Policy = None,
    tracking: bool = False,
    stop_periods: int = 520,
    laser_cycles: int = 1000,
    seed: int = 1,
    engine: Engine = "window",
    guide_latency_ms: float = 145.0,
    pipelined: bool = False,
    segments: int = 4,
    noise: Literal["fresh", "still"] = "fresh",
    reuse: bool = True,
    start_s: float = 0.0,
    calibration: str | PathLike[str] | None = None,
    bins_from_guide: bool = False,
) -> Drive:
    """Takes frame after frame while the world moves: the same numbers as `gdtof drive`, to the bit.

    A frame is taken when it is asked for, and memory does not grow.

    Parameters
    ----------
    scene, sensor, guide, windows, stop_periods, laser_cycles, seed, engine, calibration, bins_from_guide
        As of :func:`frame`; the cohort engine chooses its steps itself.
    frames
        Frames to take; None goes on for ever.
    tracking
        Begin with the window policy for sequences: macropixels hold the peak that they have found, step their window in doubt, and
        take over estimates of neighbours.
    guide_latency_ms
        From the cameras' images to the guide's map, ms.
    pipelined
        The guide works on the next frame while this one is loaded, exposed and read out.
    segments
        Parts of an exposure in which the world stands still, 1 to 64.
    noise
        fresh photons in every frame, or still ones: a macropixel whose light and start value have not changed keeps its histogram.
    reuse
        Leave out what is provably the same as in the frame before, for the same results.
    start_s
        Time of the scene at which the first images are taken, s.

    Raises
    ------
    InputError
        What cannot be, and what would help.
    """
    if frames is not None and frames < 0:
        raise InputError(f"frames: {frames} is impossible; give 0 or more, or None")
    keys = {
        "stop_periods": stop_periods,
        "laser_cycles": laser_cycles,
        "seed": seed,
        "engine": engine,
        "calibration": _path(calibration),
        "windows": policy_of(windows),
        "bins_from_guide": bins_from_guide,
    }
    drive_keys = {
        "guide_latency_ms": float(guide_latency_ms),
        "pipelined": pipelined,
        "segments": segments,
        "noise": noise,
        "reuse": reuse,
        "start_s": float(start_s),
    }
    inner = _gdtof.Drive(
        sensor_of(sensor), scene_of(scene), guide_of(guide), keys, tracking, drive_keys
    )
    return Drive(inner, frames)
