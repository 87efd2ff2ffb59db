"""The designs of `gdtof propose` in Optuna: laser power, area and data of those that find a target, and nothing that cannot be built.

pip install optuna; python propose_with_optuna.py [TRIALS]
"""

from __future__ import annotations

import sys

import optuna

import gdtof

PROBLEM = gdtof.Problem(range_m=20, reflectivity=0.1, illuminance_klux=1, fps=50, detection=0.95)
COSTS = ("power_w", "area", "data_bit_s")


def costs(trial: optuna.Trial) -> tuple[float, ...]:
    design = PROBLEM.judge(
        bins=trial.suggest_int("bins", 4, 64),
        clk_hz=trial.suggest_float("clk_hz", 150e6, 800e6),
        threshold=trial.suggest_int("threshold", 0, 2),
        pulse_energy_uj=trial.suggest_float("pulse_energy_uj", 1e-3, 10, log=True),
        rate_hz=trial.suggest_float("rate_hz", 10e3, 1e6, log=True),
        guide_sigma_m=0.3,
    )
    # What cannot be at all is farther from all limits than anything that nearly can; a timing that fails is beyond them, too.
    excess = design.get("excess", [1e3])
    trial.set_user_attr("excess", excess if design["possible"] else [*excess, 1e-3])
    return tuple(design.get(cost, float("1e30")) for cost in COSTS)


def search(trials: int) -> list[optuna.trial.FrozenTrial]:
    """The front after so many trials, the least laser power first."""
    sampler = optuna.samplers.NSGAIISampler(seed=1, constraints_func=lambda trial: trial.user_attrs["excess"])
    study = optuna.create_study(directions=["minimize"] * len(COSTS), sampler=sampler)
    study.optimize(costs, n_trials=trials)
    possible = [trial for trial in study.best_trials if max(trial.user_attrs["excess"]) <= 0]
    return sorted(possible, key=lambda trial: trial.values[0])


if __name__ == "__main__":
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    for found in search(int(sys.argv[1]) if len(sys.argv) > 1 else 1000):
        power_w, area, data_bit_s = found.values
        print(f"{1e3 * power_w:8.2f} mW {area:8.0f} transistors {1e-6 * data_bit_s:8.2f} Mbit/s  {found.params}")
