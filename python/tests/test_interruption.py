"""Python goes on while Rust works, and Ctrl-C ends the work."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable

import numpy as np
import pytest

import gdtof

LONG = 20_000
"""Laser cycles of an exposure of the whole array: some ten seconds at least."""


def interrupted(work: Callable[[], object]) -> float:
    """Seconds from Ctrl-C to the exception."""
    sent = []

    def interrupt() -> None:
        sent.append(time.monotonic())
        signal.raise_signal(signal.SIGINT)

    # Where Python was begun with the signal ignored, as in the background of a script, it would go on being ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        timer = threading.Timer(0.5, interrupt)
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            work()
        caught = time.monotonic()
        timer.join()
    finally:
        signal.signal(signal.SIGINT, before)
    return caught - sent[0]


def settles() -> bool:
    """Whether this process stops using the processor."""
    for _ in range(60):
        before = time.process_time()
        time.sleep(1.0)
        if time.process_time() - before < 0.02:
            return True
    return False


def long_frame() -> gdtof.Frame:
    return gdtof.frame(laser_cycles=LONG, skip=False)


def long_gate_replay() -> gdtof.Replayed:
    # The 64 macropixels at hand are finished.
    return gdtof.replay([], [], [], 50, laser_cycles=5000, engine="gate")


def long_drive() -> list[gdtof.DriveFrame]:
    return list(gdtof.drive("van", frames=500, laser_cycles=LONG))


def long_sum() -> object:
    return gdtof.theory.laser_cycles_for(0.9, np.full(10**5, 1e-3), 1e-2, 500, model="bernoulli")


@pytest.mark.parametrize("work", [long_frame, long_gate_replay, long_drive, long_sum])
def test_ctrl_c_ends_it_and_nothing_goes_on_behind(work: Callable[[], object]) -> None:
    seconds = interrupted(work)
    print(f"{work.__name__}: {1e3 * seconds:.0f} ms from Ctrl-C to KeyboardInterrupt")
    # A look every 50 ms; the rest is a machine that others use.
    assert seconds < 2.0
    assert settles()


def test_other_threads_go_on(sensor: gdtof.Sensor) -> None:
    counted = 0
    is_done = threading.Event()

    def count() -> None:
        nonlocal counted
        while not is_done.is_set():
            counted += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    gdtof.frame(sensor, laser_cycles=300, skip=False)
    is_done.set()
    thread.join()
    assert counted > 20


def test_progress_is_told_and_may_raise() -> None:
    told: list[int] = []
    gdtof.frame(laser_cycles=3000, progress=told.append)
    assert told == sorted(set(told))
    assert not told or 0 < told[-1] <= 64 * 64

    def enough(_: int) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        gdtof.frame(laser_cycles=LONG, skip=False, progress=enough)
    assert settles()


def test_frames_from_several_threads_are_the_same() -> None:
    sensor = gdtof.Sensor(rows=8, cols=8)
    frames: list[gdtof.Frame] = []
    threads = [
        threading.Thread(target=lambda: frames.append(gdtof.frame(sensor, laser_cycles=100)))
        for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(frames) == 4
    assert all(np.array_equal(frame.histograms, frames[0].histograms) for frame in frames)
