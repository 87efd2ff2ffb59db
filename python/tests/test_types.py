"""Types hold, and stubs are those of the extension."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parents[1]


@pytest.mark.parametrize(
    "arguments",
    [
        ["mypy", "--strict"],
        ["mypy.stubtest", "gdtof._gdtof", "--allowlist", "tests/stubtest.txt"],
    ],
    ids=["mypy", "stubtest"],
)
def test_types(arguments: list[str]) -> None:
    environment = os.environ | {"MYPYPATH": str(HERE / "python")}
    command = [sys.executable, "-m", *arguments]
    done = subprocess.run(command, cwd=HERE, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
