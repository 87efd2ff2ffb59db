#!/usr/bin/env python3
"""How the cost of photons and engine grows with laser cycles, macropixels, light, threads and bins: the built-in street, best of the
runs by the clock on the wall, and that beside what bounds it, the photons that must be drawn.

    benches/growth.py [RUNS]        after cargo build --release, on a quiet machine
"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
GDTOF = str(ROOT / "target/release/gdtof")
BASE = {"laser-cycles": 1000, "rows": 64, "cols": 64, "threads": 1}
# What is changed, and its values.
CURVES = {
    "laser cycles": [{"laser-cycles": n} for n in (250, 1000, 4000, 16000)],
    "macropixels": [{"rows": n, "cols": n} for n in (16, 32, 64, 128)],
    "laser energy, uJ": [{"set": f"scene.lidar.pulse_energy_uj={uj}"} for uj in (0.2, 2, 20, 200)],
    "sunlight, klux": [{"set": f"scene.light.illuminance_klux={klux}"} for klux in (0, 1, 10, 100)],
    "threads": [{"threads": n} for n in (1, 2)],
    "bins": [{"set": f"sensor.bins={n}"} for n in (4, 8, 16)],
}


def measure(options: dict, engine: str, runs: int, out: str) -> tuple[float, dict]:
    """Least seconds of photons and engine, and what work that was."""
    command = [GDTOF, "frame", "--probe", "none", "--quiet", "--engine", engine, "--out", out]
    for name, value in (BASE | options).items():
        command += [f"--{name}", str(value)]
    seconds = []
    for _ in range(runs):
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        report = json.loads(pathlib.Path(out, "frame.json").read_text())
        seconds.append(report["exposure_run_time_s"])
    return min(seconds), report


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    print(f"{os.cpu_count()} processors; best of {runs} runs; one thread, 64x64, 1000 laser cycles where nothing else is said")
    print("| | | `window`, ms | photons drawn, millions | ns a photon | `cohort`, ms |\n|---|---:|---:|---:|---:|---:|")
    with tempfile.TemporaryDirectory() as out:
        for curve, points in CURVES.items():
            for options in points:
                value = next(iter(options.values()))
                value = value.split("=")[1] if isinstance(value, str) else value
                if curve == "macropixels":
                    value = value * value
                window, report = measure(options, "window", runs, out)
                cohort, _ = measure(options, "cohort", runs, out)
                drawn = report["work"]["photons_drawn"]
                each = 1e9 * window * options.get("threads", 1) / drawn
                print(f"| {curve} | {value} | {1e3 * window:.1f} | {drawn / 1e6:.2f} | {each:.0f} | {1e3 * cohort:.1f} |", flush=True)


if __name__ == "__main__":
    main()
