from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import Unpack

from ._keys import SceneName, SensorKeys, SensorName

__all__ = [
    "DEPTH_COLOURS",
    "PATTERNS",
    "REASONS",
    "WALKS_LEFT",
    "Drive",
    "Guide",
    "Problem",
    "Scene",
    "Sensor",
    "Taken",
    "__version__",
    "bin_edges",
    "confidence",
    "depth_scale_m",
    "detector_agreement",
    "detector_checked",
    "detector_crosstalk",
    "detector_expected",
    "detector_file",
    "detector_range",
    "expose",
    "frame",
    "light",
    "photons",
    "range_counts",
    "replay",
    "starts_for",
    "sweep_outline",
    "sweep_part",
    "sweep_table",
    "sweep_text",
    "theory",
    "timing",
    "windows",
]

__version__: str
DEPTH_COLOURS: tuple[tuple[int, int, int], ...]
PATTERNS: tuple[tuple[tuple[int, int, int, int], ...], ...]
REASONS: tuple[str, ...]
WALKS_LEFT: tuple[str, ...]

@final
class Problem:
    """What a chip has to do, and what all designs have in common."""

    def __new__(
        cls,
        sensor: Sensor | None = None,
        scene: Scene | None = None,
        *,
        range_m: float,
        reflectivity: float,
        illuminance_klux: float,
        fps: float,
        detection: float = 0.99,
        precision_m: float = 0.1,
    ) -> Problem: ...
    def judge(
        self,
        *,
        bins: int,
        clk_hz: float,
        pulse_energy_uj: float,
        rate_hz: float,
        guide_sigma_m: float,
        threshold: int = 0,
        bin_bits: int | None = None,
    ) -> dict[str, Any]: ...

@final
class Sensor:
    """A sensor: a chip by name, a file, or keys."""

    def __new__(
        cls, source: SensorName | str | PathLike[str] | None = None, /, **keys: Unpack[SensorKeys]
    ) -> Sensor: ...
    @staticmethod
    def from_toml(text: str) -> Sensor: ...
    @staticmethod
    def from_dict(keys: dict[str, Any]) -> Sensor: ...
    def with_(self, **keys: Unpack[SensorKeys]) -> Sensor: ...
    def to_dict(self) -> dict[str, Any]: ...
    def to_toml(self) -> str: ...
    def keys(self) -> list[str]: ...
    @property
    def shape(self) -> tuple[int, int, int]: ...
    @property
    def largest_start(self) -> int: ...
    def __getitem__(self, key: str, /) -> Any: ...
    def __getattr__(self, name: str, /) -> Any: ...
    def __dir__(self) -> list[str]: ...
    def __eq__(self, value: object, /) -> bool: ...
    def __ne__(self, value: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __repr__(self) -> str: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
    def _repr_html_(self) -> str: ...

@final
class Scene:
    """A scene: one that is built in, a file, and single keys of it."""

    def __new__(
        cls, source: SceneName | str | PathLike[str] | None = None, keys: dict[str, Any] | None = None, /
    ) -> Scene: ...
    @staticmethod
    def from_toml(text: str, name: str = "scene") -> Scene: ...
    @staticmethod
    def from_dict(sections: dict[str, Any], name: str = "scene") -> Scene: ...
    def with_(self, keys: dict[str, Any], /) -> Scene: ...
    def to_dict(self) -> dict[str, Any]: ...
    def to_toml(self) -> str: ...
    @property
    def name(self) -> str: ...
    def truth(self, rows: int = 64, cols: int = 64, time_s: float = 0.0) -> NDArray[np.float64]: ...
    def __getitem__(self, key: str, /) -> Any: ...
    def __eq__(self, value: object, /) -> bool: ...
    def __ne__(self, value: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __repr__(self) -> str: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
    def _repr_html_(self) -> str: ...

@final
class Guide:
    """What tells where targets roughly are."""

    def __new__(cls, *guides: str | Guide) -> Guide: ...
    @staticmethod
    def from_map(range_m: ArrayLike, sigma_m: ArrayLike | None = None) -> Guide: ...
    @property
    def name(self) -> str: ...
    def estimate(
        self, scene: Scene | None = None, rows: int = 64, cols: int = 64, seed: int = 1
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def __eq__(self, value: object, /) -> bool: ...
    def __ne__(self, value: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __repr__(self) -> str: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Taken:
    def __new__(cls, report: str, configuration: str) -> Taken: ...
    def save(self, folder: str | PathLike[str], histograms: NDArray[np.uint16]) -> list[str]: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Drive:
    def __new__(
        cls,
        sensor: Sensor | None,
        scene: Scene | None,
        guide: Guide | None,
        keys: dict[str, Any],
        tracking: bool,
        drive_keys: dict[str, Any],
    ) -> Drive: ...
    @property
    def period_s(self) -> float: ...
    @property
    def chip_s(self) -> tuple[float, float, float]: ...
    def next_frame(self) -> dict[str, Any]: ...
    def close(self) -> None: ...

def frame(
    sensor: Sensor | None,
    scene: Scene | None,
    guide: Guide | None,
    keys: dict[str, Any],
    tracking: bool,
    starts: NDArray[np.int64] | None,
    probes: dict[str, Any] | None,
    progress: Callable[[int], object] | None,
) -> dict[str, Any]: ...
def expose(
    sensor: Sensor | None,
    scene: Scene | None,
    starts: NDArray[np.int64],
    background_hz: NDArray[np.float64],
    signal: NDArray[np.float64],
    arrival_ns: NDArray[np.float64],
    sigma_ns: NDArray[np.float64] | None,
    profile: tuple[Sequence[float], NDArray[np.float64]] | None,
    periods: tuple[int, int],
    seed: int,
    engine: str,
    progress: Callable[[int], object] | None,
) -> dict[str, Any]: ...
def replay(
    sensor: Sensor | None,
    starts: NDArray[np.int64],
    time_fs: NDArray[np.int64],
    pixel: NDArray[np.int64],
    spad: NDArray[np.int64],
    periods: tuple[int, int],
    engine: str,
    waves: str | PathLike[str] | None,
    progress: Callable[[int], object] | None,
) -> dict[str, Any]: ...
def detector_checked(described: tuple[int, str]) -> list[str]: ...
def detector_file(path: str) -> str: ...
def detector_crosstalk(
    described: tuple[int, str], sums: NDArray[np.uint32], histograms: int, is_fit: bool
) -> NDArray[np.float64]: ...
def detector_range(
    described: tuple[int, str],
    counts: NDArray[np.uint32],
    crosstalk: NDArray[np.float64] | None,
    false_alarm_rate: float,
    correct_walk: bool,
) -> dict[str, Any]: ...
def detector_expected(
    described: tuple[int, str], light: tuple[float, float, float]
) -> NDArray[np.float64]: ...
def detector_agreement(
    described: tuple[int, str],
    counts: NDArray[np.uint32],
    expected: NDArray[np.float64],
) -> list[tuple[float, int, float]]: ...
def light(
    sensor: Sensor | None, scene: Scene | None, spads: int | None, fov_deg: float | None
) -> dict[str, Any]: ...
def photons(
    sensor: Sensor | None,
    scene: Scene | None,
    spads: int | None,
    fov_deg: float | None,
    period_ns: float | None,
    periods: tuple[int, int],
    seed: int,
    progress: Callable[[int], object] | None,
) -> dict[str, Any]: ...
def range_counts(
    sensor: Sensor | None,
    scene: Scene | None,
    histograms: NDArray[np.uint16],
    starts: NDArray[np.int64],
    periods: tuple[int, int],
    false_alarm_rate: float,
    correct_walk: bool,
    calibration: str | PathLike[str] | None,
) -> dict[str, Any]: ...
def sweep_text(study: dict[str, Any]) -> str: ...
def sweep_outline(study: str | PathLike[str], text: str | None) -> tuple[int, Path, str]: ...
def sweep_part(
    study: str | PathLike[str],
    text: str | None,
    folder: str | PathLike[str],
    shard: tuple[int, int],
    threads: int,
    progress: Callable[[int], object] | None,
) -> dict[str, Any]: ...
def sweep_table(folder: str | PathLike[str]) -> dict[str, int]: ...
def timing(
    sensor: Sensor | None, process: str, voltage_v: float, temperature_c: float | None
) -> dict[str, Any]: ...
def windows(sensor: Sensor | None, stop_periods: int) -> NDArray[np.float64]: ...
def bin_edges(
    sensor: Sensor | None, starts: NDArray[np.int64], stop_periods: int
) -> NDArray[np.float64]: ...
def starts_for(
    sensor: Sensor | None, range_m: NDArray[np.float64], stop_periods: int
) -> NDArray[np.int32]: ...
def theory(
    name: str, words: Sequence[str], columns: Sequence[NDArray[np.float64]]
) -> NDArray[np.float64]: ...
def depth_scale_m(depths_m: Sequence[float], /) -> tuple[float, float]: ...
def confidence(
    histograms: NDArray[np.uint32], pulse_sigma_bins: float, laser_cycles: int
) -> NDArray[np.float64]: ...
