"""Drivers, a monitor and a scoreboard for test benches in cocotb 2: photons of :func:`gdtof.light` for any chip.

>>> from cocotb.clock import Clock                                # doctest: +SKIP
>>> async def expose(dut, light, photons):                        # doctest: +SKIP
...     laser = Laser(dut.stop, period_ns=320, laser_cycles=1000)
...     spads = SpadPins(dut.spad, photons, light.pulse_ns)
...     await run_together(laser, spads)

Times are kept in whole steps of the simulator. A driver says at its end by how much rounding moved an edge at most. Needs cocotb 2
(`pip install "gdtof[cocotb]"`). Tried with Icarus 11.0 and with Verilator 5.48; cocotb 2 needs Verilator 5.036 or later.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._light import Photons
from .errors import InputError

try:
    import cocotb
    from cocotb.triggers import FallingEdge, RisingEdge, SimTimeoutError, Timer, with_timeout
    from cocotb.utils import get_sim_time, get_time_from_sim_steps
except ImportError as missing:  # pragma: no cover
    raise ImportError('gdtof.cocotb needs cocotb 2; pip install "gdtof[cocotb]"') from missing

__all__ = ["CountMonitor", "Driver", "Laser", "Mismatch", "Scoreboard", "SerialLoad", "SpadPins", "first_edge", "run_together"]


def _name(pin: Any) -> str:
    return str(getattr(pin, "_path", pin))


class Driver(Protocol):
    """Something that drives pins from a time on, to its end."""

    async def run(self, start_steps: int) -> None:
        """Drives; laser cycle 0 begins `start_steps` after the beginning of the simulation."""


def _fs_per_step() -> float:
    return float(get_time_from_sim_steps(1, "fs"))


async def _until(steps: int) -> None:
    wait = steps - int(get_sim_time("step"))
    if wait > 0:
        await Timer(wait, unit="step")


class _Edges:
    """Values of a pin or bus, each from a time on."""

    def __init__(self, handle: Any, times_fs: NDArray[np.int64], values: list[int]) -> None:
        self._handle, self._times_fs, self._values = handle, times_fs, values
        self.rounded_fs = 0.0
        """By how much an edge was moved at most so that it is a step of the simulator, fs."""

    async def run(self, start_steps: int) -> None:
        fs = _fs_per_step()
        steps = np.rint(self._times_fs / fs).astype(np.int64)
        if len(steps):
            self.rounded_fs = float(np.abs(steps * fs - self._times_fs).max())
        # Edges of one step are one change.
        for at, value in zip(steps.tolist(), self._values, strict=True):
            await _until(start_steps + at)
            self._handle.value = value


class Laser(_Edges):
    """STOP: high from the beginning of each laser cycle.

    Parameters
    ----------
    stop
        The pin.
    period_ns, laser_cycles
        As of :meth:`gdtof.Light.photons`.
    high_ns
        How long it is high in each.
    """

    def __init__(self, stop: Any, *, period_ns: float, laser_cycles: int, high_ns: float = 2.0) -> None:
        if not 0 < high_ns < period_ns:
            raise InputError(f"high_ns: {high_ns} is no part of a laser cycle of {period_ns} ns; give less")
        begins = np.arange(laser_cycles) * (1e6 * period_ns)
        times = np.stack([begins, begins + 1e6 * high_ns], axis=1).ravel()
        super().__init__(stop, np.rint(times).astype(np.int64), [1, 0] * laser_cycles)
        stop.value = 0


class SpadPins(_Edges):
    """The pins of SPADs: pulses of photons.

    Parameters
    ----------
    pins
        A bus, or a single pin. Bit 0 is the first SPAD of the first pixel.
    photons
        Of :meth:`gdtof.Light.photons`.
    pulse_ns
        How long a pulse is high; :attr:`gdtof.Light.pulse_ns`.
    bit_of
        Which bit of the bus each photon pulses; by default pixel by pixel, SPAD by SPAD.
    """

    def __init__(self, pins: Any, photons: Photons, pulse_ns: float, bit_of: ArrayLike | None = None) -> None:
        if bit_of is None:
            spads = int(photons.spad.max(initial=0)) + 1
            bits = photons.pixel * spads + photons.spad
        else:
            bits = np.asarray(bit_of, dtype=np.int64)
        if len(bits) != len(photons):
            raise InputError(f"bit_of: has {len(bits)} bits; give one for each of {len(photons)} photons")
        width = len(pins)
        if len(bits) and not 0 <= bits.min() <= bits.max() < width:
            raise InputError(f"bit_of: bit {bits.max()} is not on a bus of {width} pins; give a wider bus or fewer SPADs")
        pulse_fs = round(1e6 * pulse_ns)
        times = np.concatenate([photons.time_fs, photons.time_fs + pulse_fs])
        masks = [1 << bit for bit in bits.tolist()]
        order = np.argsort(times, kind="stable")
        # A SPAD that fires again as its pulse ends stays high.
        high: dict[int, int] = {}
        level, values = 0, []
        for edge in order.tolist():
            rises = edge < len(masks)
            mask = masks[edge % len(masks)]
            high[mask] = high.get(mask, 0) + (1 if rises else -1)
            level = level | mask if high[mask] > 0 else level & ~mask
            values.append(level)
        super().__init__(pins, times[order], values)
        pins.value = 0


class SerialLoad:
    """The serial load of start values into the chip that `gdtof export verilog` writes.

    Row 0 comes first; within a row the last column, and of a start value the highest bit. Bits change with the falling edge of LOAD_CLK
    and are taken with the rising one.

    Parameters
    ----------
    enable, clk, data
        The pins LOAD_ENABLE, LOAD_CLK and COUNTER_INITS.
    starts
        Start values, shape (rows, cols).
    bits
        Bits of a start value.
    period_ns
        Period of LOAD_CLK.
    """

    def __init__(self, enable: Any, clk: Any, data: Any, starts: ArrayLike, *, bits: int = 9, period_ns: float = 20.0) -> None:
        self._enable, self._clk, self._data, self._period_ns = enable, clk, data, period_ns
        rows = np.asarray(starts)
        if rows.ndim != 2 or rows.dtype.kind not in "iu":
            raise InputError(f"starts: are {rows.dtype} of shape {rows.shape}; give whole numbers of shape (rows, cols)")
        if rows.size and not 0 <= rows.min() <= rows.max() < 1 << bits:
            raise InputError(f"starts: are from {rows.min()} to {rows.max()}; give 0 to {(1 << bits) - 1}, which have {bits} bits")
        self._bits = [start >> bit & 1 for row in rows.tolist() for start in reversed(row) for bit in reversed(range(bits))]
        for pin in (enable, clk, data):
            pin.value = 0

    async def run(self, start_steps: int) -> None:
        """Shifts all bits in."""
        await _until(start_steps)
        half = 0.5 * self._period_ns
        self._enable.value = 1
        for bit in self._bits:
            self._data.value = bit
            await Timer(half, unit="ns", round_mode="round")
            self._clk.value = 1
            await Timer(half, unit="ns", round_mode="round")
            self._clk.value = 0
        # The last row is written while LOAD_CLK is low.
        await Timer(half, unit="ns", round_mode="round")
        self._enable.value = 0


async def run_together(*drivers: Driver) -> int:
    """Runs drivers from now on, to the end of all. Returns when they began, in steps of the simulator."""
    start = int(get_sim_time("step"))
    tasks = [cocotb.start_soon(driver.run(start)) for driver in drivers]
    for task in tasks:
        await task
    return start


async def first_edge(signal: Any, name: str, *, within_ns: float, rising: bool = True) -> None:
    """Waits for an edge.

    Raises
    ------
    TimeoutError
        When there is none; it names the signal.
    """
    edge = RisingEdge(signal) if rising else FallingEdge(signal)
    try:
        await with_timeout(edge, within_ns, "ns", round_mode="ceil")
    except SimTimeoutError:
        kind = "rise" if rising else "fall"
        raise TimeoutError(f"{name} did not {kind} within {within_ns} ns; is the clock running and the reset off?") from None


class CountMonitor:
    """Collects counts that the chip puts out: at each rising edge of CLK at which VALID is high, the next one.

    Parameters
    ----------
    clk, valid, count
        The pins.
    shape
        Of the counts, in the order in which they come: pixels, bins.
    """

    def __init__(self, clk: Any, valid: Any, count: Any, shape: tuple[int, ...]) -> None:
        self._clk, self._valid, self._count, self._shape = clk, valid, count, shape
        self._seen: list[int] = []
        self._task = cocotb.start_soon(self._watch())

    async def _watch(self) -> None:
        while True:
            await RisingEdge(self._clk)
            if self._valid.value == 1:
                self._seen.append(int(self._count.value))

    async def counts(self, *, within_ns: float) -> NDArray[np.int64]:
        """All counts, as an array of the shape.

        Raises
        ------
        TimeoutError
            When they do not come; it says how many did.
        """
        wanted = int(np.prod(self._shape))
        end = get_sim_time("ns") + within_ns
        has_risen = False
        while len(self._seen) < wanted:
            left = end - get_sim_time("ns")
            try:
                if left <= 0:
                    raise SimTimeoutError
                await with_timeout(RisingEdge(self._clk), left, "ns", round_mode="ceil")
                has_risen = True
            except SimTimeoutError:
                silent = _name(self._valid) if has_risen else f"{_name(self._clk)}, which did not rise"
                raise TimeoutError(f"{len(self._seen)} of {wanted} counts came within {within_ns} ns; look at {silent}") from None
        self._task.cancel()
        return np.array(self._seen[:wanted], dtype=np.int64).reshape(self._shape)


class Mismatch(NamedTuple):
    """A count that is not the model's."""

    place: tuple[int, ...]
    """Pixel and bin."""
    counted: int
    expected: int


class Scoreboard:
    """Compares counts of the chip with those of a model.

    >>> board = Scoreboard([[0, 2], [5, 1]])
    >>> board.compare([[0, 2], [4, 1]])
    [Mismatch(place=(1, 0), counted=4, expected=5)]
    >>> print(board.report([[0, 2], [4, 1]]))
    1 of 4 counts differ: (1, 0) has 4 and should have 5
    """

    def __init__(self, expected: ArrayLike) -> None:
        self.expected = np.asarray(expected, dtype=np.int64)

    def compare(self, counts: ArrayLike) -> list[Mismatch]:
        """The counts that differ."""
        found = np.asarray(counts, dtype=np.int64)
        if found.shape != self.expected.shape:
            raise InputError(f"counts: have the shape {found.shape}; the model's have {self.expected.shape}")
        places = np.argwhere(found != self.expected)
        return [
            Mismatch(tuple(map(int, place)), int(found[tuple(place)]), int(self.expected[tuple(place)])) for place in places
        ]

    def report(self, counts: ArrayLike, most: int = 5) -> str:
        """A sentence about them; empty if all agree."""
        off = self.compare(counts)
        if not off:
            return ""
        told = [f"{place} has {counted} and should have {expected}" for place, counted, expected in off[:most]]
        more = f", and {len(off) - most} more" if len(off) > most else ""
        return f"{len(off)} of {self.expected.size} counts differ: {'; '.join(told)}{more}"
