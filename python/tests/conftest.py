"""Small sensors, and the command that Python is compared with."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import matplotlib
import pytest

import gdtof

matplotlib.use("Agg")

ROOT = Path(__file__).parents[2]

Command = Callable[..., str]


def _command() -> str | None:
    """The command: $GDTOF, on the PATH, or built in the repository."""
    built = [ROOT / "target" / profile / "gdtof" for profile in ("release", "debug")]
    there = [str(path) for path in built if path.exists()]
    return os.environ.get("GDTOF") or shutil.which("gdtof") or (there[0] if there else None)


@pytest.fixture(scope="session")
def command() -> Command:
    """Runs `gdtof` with arguments, and gives what it prints."""
    program = _command()
    if program is None:
        if os.environ.get("CI"):
            raise FileNotFoundError("no gdtof to compare with; set GDTOF to it")
        pytest.skip("no gdtof to compare with; build it, or set GDTOF to it")

    def run(*arguments: object, fails: bool = False) -> str:
        words = [program, *map(str, arguments)]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        assert (done.returncode != 0) is fails, done.stderr
        return done.stderr if fails else done.stdout

    return run


@pytest.fixture(scope="session")
def sensor() -> gdtof.Sensor:
    return gdtof.Sensor(rows=16, cols=16)


@pytest.fixture(scope="session")
def frame(sensor: gdtof.Sensor) -> gdtof.Frame:
    return gdtof.frame(sensor, laser_cycles=200)
