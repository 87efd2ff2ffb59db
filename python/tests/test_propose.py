"""Designs by theory, and the example that gives them to Optuna."""

from __future__ import annotations

import importlib.util
import warnings
from pathlib import Path
from typing import Any

import pytest

import gdtof

from conftest import Command

EXAMPLE = Path(__file__).parents[1] / "examples/propose_with_optuna.py"
ASKED: dict[str, Any] = {"range_m": 20, "reflectivity": 0.1, "illuminance_klux": 1, "fps": 50, "detection": 0.95}


def test_a_design_is_judged_as_the_command_judges_it(command: Command, tmp_path: Path) -> None:
    words = "propose --range 20 --reflectivity 0.1 --klux 1 --fps 50 --detection 0.95 --bins 16 --clk 384 --thresholds 0"
    command(*words.split(), "--guide-sigma", 0.3, "--out", tmp_path)
    head, *rows = [line.split(",") for line in (tmp_path / "designs.csv").read_text().splitlines()]
    balanced = next(dict(zip(head, row, strict=True)) for row in rows if row[0] == "balanced")
    own = gdtof.Problem(**ASKED).judge(
        bins=16,
        clk_hz=384e6,
        pulse_energy_uj=float(balanced["pulse_energy_uj"]),
        rate_hz=384e6 / (int(balanced["stop_periods"]) - 0.5),
        guide_sigma_m=0.3,
    )
    assert own["possible"] and own["limit"] is None and max(own["excess"]) <= 0
    for key in ("bins", "bin_bits", "counter_bits", "stop_periods", "area", "data_bit_s"):
        assert own[key] == float(balanced[key]), key
    for key in ("laser_cycles", "power_w", "precision_m"):
        assert own[key] == pytest.approx(float(balanced[key]), rel=0.01), key


def test_what_cannot_be_says_why() -> None:
    problem = gdtof.Problem(**ASKED)
    design: dict[str, Any] = {"bins": 16, "clk_hz": 384e6, "pulse_energy_uj": 1.0, "rate_hz": 80e3, "guide_sigma_m": 0.3}
    hopeless = problem.judge(**{**design, "guide_sigma_m": 50})
    assert hopeless == {"possible": False, "limit": hopeless["limit"]} and "the guide" in hopeless["limit"]
    from_a_point = gdtof.Problem(scene=gdtof.Scene("street", {"lidar.laser_source_mm": 0}), **ASKED)
    bright = from_a_point.judge(**{**design, "pulse_energy_uj": 10.0})
    assert not bright["possible"] and "class 1" in bright["limit"] and bright["excess"][0] > 0
    too_fast = problem.judge(**{**design, "clk_hz": 1e9, "bins": 64})
    assert not too_fast["possible"] and "slower than a CLK period" in too_fast["limit"], too_fast
    with pytest.raises(gdtof.InputError, match="bins = 65 is impossible"):
        problem.judge(**{**design, "bins": 65})
    with pytest.raises(gdtof.InputError, match="fps = 0"):
        gdtof.Problem(**{**ASKED, "fps": 0})


def test_optuna_finds_designs_that_can_be_built() -> None:
    if importlib.util.find_spec("optuna") is None:
        warnings.warn("SKIPPED: no optuna to search designs with; pip install optuna", stacklevel=1)
        pytest.skip("no optuna")
    spec = importlib.util.spec_from_file_location("propose_with_optuna", EXAMPLE)
    assert spec is not None and spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    found = example.search(300)
    assert found
    for trial in found:
        assert example.PROBLEM.judge(**trial.params, guide_sigma_m=0.3)["possible"]
