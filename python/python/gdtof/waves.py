"""Waveforms as arrays."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Signal", "Waveform", "read_vcd"]

UNITS_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "ps": 1e-12, "fs": 1e-15}


@dataclass(frozen=True, eq=False, repr=False)
class Signal:
    """Changes of a signal."""

    name: str
    """Its scopes and name, joined by dots."""
    width: int
    """Bits."""
    time_fs: NDArray[np.int64]
    """When it changes, fs, shape (n,)."""
    values: NDArray[Any]
    """What it changes to; -1 where a bit is unknown. Whole numbers, Python's own where they have more than 63 bits. Shape (n,)."""

    def __repr__(self) -> str:
        return f"<Signal {self.name}, {self.width} bits: {len(self.time_fs)} changes>"

    def at(self, time_fs: int) -> int:
        """Its value at a time, -1 where it is unknown."""
        before = int(np.searchsorted(self.time_fs, time_fs, side="right"))
        return int(self.values[before - 1]) if before else -1

    def rises_fs(self) -> NDArray[np.int64]:
        """When it comes from 0 to something else, fs."""
        rises = (self.values[1:] > 0) & (self.values[:-1] == 0)
        times: NDArray[np.int64] = self.time_fs[1:][rises]
        return times


@dataclass(frozen=True, eq=False, repr=False)
class Waveform:
    """A waveform: signals by their names."""

    signals: dict[str, Signal]

    def __getitem__(self, name: str) -> Signal:
        """A signal by its full name, or by the end of it; of several, the one that is in the fewest scopes."""
        if name in self.signals:
            return self.signals[name]
        found = sorted((full.count("."), full) for full in self.signals if full.endswith(f".{name}"))
        if not found:
            raise KeyError(f"there is no signal {name!r}; Waveform.find lists names by a part of them")
        if len(found) > 1 and found[0][0] == found[1][0]:
            raise KeyError(f"{name!r} is {found[0][1]} and {found[1][1]}; give more of the name")
        return self.signals[found[0][1]]

    def find(self, part: str) -> list[str]:
        """Names with this regular expression in them."""
        return [name for name in self.signals if re.search(part, name)]

    def __len__(self) -> int:
        return len(self.signals)

    def __repr__(self) -> str:
        return f"<Waveform: {len(self)} signals>"

    def plot(
        self,
        names: Sequence[str],
        span_ns: tuple[float, float],
        origin_fs: int = 0,
        ax: Axes | None = None,
        *,
        show: bool = True,
    ) -> Axes:
        """Signals below each other with matplotlib, from and to a time in ns, counted from `origin_fs`.

        Of a bus it is shown where it is not 0; unknown is half way. In a script a window opens, unless `show` is false or `ax` is yours.
        """
        from ._plot import show_figure

        figure: Figure | None = None
        if ax is None:
            import matplotlib.pyplot as plt

            figure, ax = plt.subplots(figsize=(9.0, 0.5 + 0.6 * len(names)), layout="constrained")
        assert ax is not None
        ends_fs = [origin_fs + round(1e6 * ns) for ns in span_ns]
        for place, name in enumerate(reversed(names)):
            signal = self[name]
            inside = (signal.time_fs > ends_fs[0]) & (signal.time_fs < ends_fs[1])
            times = [ends_fs[0], *signal.time_fs[inside].tolist(), ends_fs[1]]
            values = [signal.at(time) for time in times]
            levels = [place + 0.35 * (1 + (value > 0) - (value == 0)) for value in values]
            ax.step([1e-6 * (time - origin_fs) for time in times], levels, where="post", linewidth=1)
        ax.set_yticks([place + 0.35 for place, _ in enumerate(names)], list(reversed(names)))
        ax.set_xlim(*span_ns)
        ax.set_xlabel("time (ns)")
        if figure is not None:
            show_figure(figure, show)
        return ax


def read_vcd(path: str | PathLike[str]) -> Waveform:
    """Reads a VCD file, such as the waveforms of probes and of :func:`replay`."""
    try:
        # With or without a byte order mark.
        with open(path, encoding="utf-8-sig") as file:
            return _read(file, str(path))
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is no VCD file; give one") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path and its permissions") from error


def _read(file: IO[str], path: str) -> Waveform:
    names: dict[str, list[tuple[str, int]]] = {}
    scopes: list[str] = []
    scale_fs = 1
    for line in file:
        words = line.split()
        if not words:
            continue
        if words[0] == "$scope":
            scopes.append(words[2])
        elif words[0] == "$upscope":
            scopes.pop()
        elif words[0] == "$var":
            name = "".join(words[4:-1])
            width = int(words[2])
            # A bus of one file is `name[8:0]`; its bits are in its width.
            bare = re.sub(r"\[\d+:\d+\]$", "", name)
            names.setdefault(words[3], []).append((".".join([*scopes, bare]), width))
        elif words[0] == "$timescale":
            text = line if "$end" in line else line + next(file)
            found = re.search(r"(\d+)\s*(s|ms|us|ns|ps|fs)\b", text)
            if found is None:
                raise InputError(f"{path}: has no time scale; give a VCD file")
            scale_fs = round(int(found[1]) * UNITS_S[found[2]] * 1e15)
        elif words[0] == "$enddefinitions":
            break
    else:
        raise InputError(f"{path}: is no VCD file; give one")
    times: dict[str, list[int]] = {code: [] for code in names}
    values: dict[str, list[int]] = {code: [] for code in names}
    now = 0
    for line in file:
        line = line.strip()
        if not line or line[0] == "$":
            continue
        if line[0] == "#":
            now = int(line[1:]) * scale_fs
            continue
        if line[0] in "bB":
            bits, code = line[1:].split()
        else:
            bits, code = line[0], line[1:].strip()
        if code in times:
            times[code].append(now)
            values[code].append(int(bits, 2) if set(bits) <= {"0", "1"} else -1)
    signals = {}
    for code, of_code in names.items():
        for name, width in of_code:
            kind = np.int64 if width < 64 else object
            when, what = np.array(times[code], np.int64), np.array(values[code], kind)
            signals[name] = Signal(name, width, when, what)
    return Waveform(signals)
