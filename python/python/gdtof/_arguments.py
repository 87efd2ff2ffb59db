"""What functions take, as the extension wants it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from operator import index
from os import PathLike
from reprlib import repr as short
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._gdtof import Guide, Scene, Sensor
from .errors import InputError

SensorLike: TypeAlias = Sensor | str | PathLike[str] | None
SceneLike: TypeAlias = Scene | str | PathLike[str] | None
GuideLike: TypeAlias = "Guide | str | Sequence[Guide | str] | NDArray[Any] | None"
Policy: TypeAlias = str | Mapping[str, Any] | None


def sensor_of(sensor: SensorLike) -> Sensor:
    if not isinstance(sensor, Sensor | str | PathLike | None):
        raise InputError(f"sensor: {type(sensor).__name__} is no sensor; give a Sensor, the name of a built-in one or a file")
    return sensor if isinstance(sensor, Sensor) else Sensor(sensor)


def scene_of(scene: SceneLike) -> Scene:
    if not isinstance(scene, Scene | str | PathLike | None):
        raise InputError(f"scene: {type(scene).__name__} is no scene; give a Scene, the name of a built-in one or a file")
    return scene if isinstance(scene, Scene) else Scene(scene)


def guide_of(guide: GuideLike) -> Guide | None:
    if guide is None or isinstance(guide, Guide):
        return guide
    if isinstance(guide, str):
        return Guide(guide)
    if isinstance(guide, np.ndarray):
        return Guide.from_map(guide)
    if not isinstance(guide, Iterable) or not all(isinstance(one, Guide | str) for one in guide):
        raise InputError(f"guide: {short(guide)} is no guide; give texts or Guides, or a map as an array of NumPy")
    return Guide(*guide)


def policy_of(windows: Policy) -> str:
    """The window policy as `gdtof frame --windows` takes it."""
    if windows is None or isinstance(windows, str):
        return windows or ""

    if not isinstance(windows, Mapping):
        raise InputError(f"windows: {short(windows)} is no policy; give a dict, or a text such as 'overlap=0.3'")

    def text(value: Any) -> str:
        return str(value).lower() if isinstance(value, bool | np.bool_) else str(value)

    return ",".join(f"{key}={text(value)}" for key, value in windows.items())


def count(name: str, value: int, largest: int = 2**32 - 1) -> int:
    """A whole number from 0 on."""
    try:
        number = index(value)
    except TypeError:
        number = -1
    if not 0 <= number <= largest:
        raise InputError(f"{name}: {short(value)} is impossible; give a whole number, 0 to {largest}")
    return number


def seed_of(seed: int) -> int:
    return count("seed", seed, 2**64 - 1)


def periods_of(stop_periods: int, laser_cycles: int) -> tuple[int, int]:
    return count("stop_periods", stop_periods), count("laser_cycles", laser_cycles)


def whole(name: str, values: ArrayLike) -> NDArray[np.int64]:
    """Whole numbers, without rounding any."""
    if np.ma.is_masked(values):
        raise InputError(f"{name}: is masked in places; fill them with what they are")
    array = np.asarray(values)
    if array.dtype.kind == "f":
        is_whole = (array == np.trunc(array)) & (np.abs(array) < 2.0**63)
        if not is_whole.all():
            raise InputError(f"{name}: holds {array[~is_whole][0]}; give whole numbers")
        array = array.astype(np.int64)
    if array.dtype.kind not in "iub" and array.size:
        raise InputError(f"{name}: holds numbers of type {array.dtype}; give whole ones")
    if array.dtype.kind == "u" and array.size and int(array.max()) > np.iinfo(np.int64).max:
        raise InputError(f"{name}: {array.max()} is too large; give 64-bit numbers")
    return np.asarray(array, dtype=np.int64, order="C")


def starts_of(starts: ArrayLike, sensor: Sensor) -> NDArray[np.int64]:
    """Start values of every macropixel; a number stands for all."""
    array = whole("starts", starts)
    if array.ndim == 0:
        array = np.full(sensor.shape[:2], array)
    return array


def numbers(values: ArrayLike) -> NDArray[np.float64]:
    """Numbers in their shape; NaN where they are masked."""
    try:
        masked = np.ma.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{short(values)}: is no number; give numbers, in the unit of the argument's name") from None
    filled: NDArray[np.float64] = np.ma.filled(masked, np.nan)
    return filled


def real(values: ArrayLike, shape: tuple[int, ...] | None = None) -> NDArray[np.float64]:
    array = numbers(values)
    if shape is not None and array.ndim < len(shape):
        array = np.broadcast_to(array, shape)
    return np.ascontiguousarray(array)
