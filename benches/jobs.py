#!/usr/bin/env python3
"""Times the jobs that users run, as they run them: whole processes, start, files and pictures included, on all processors of
this machine, which should be quiet. Best, median and worst of the runs by the clock on the wall; processor time and peak memory of the best run;
and what of the work was skipped because no result depends on it.

    benches/jobs.py [RUNS]        after cargo build --release
"""
import json
import os
import pathlib
import statistics
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
GDTOF = str(ROOT / "target/release/gdtof")
STREET = ["frame", "--laser-cycles", "16000", "--stop-periods", "4800", "--probe", "none"]
SECONDARIES = [
    "--set", "sensor.afterpulse_probability=0.01",
    "--set", "sensor.crosstalk_probability=0.01",
]  # fmt: skip
STUDY = """[study]
kind = "frame"
replicas = 10
[fixed]
frame.engine = "cohort"
[vary]
scene.light.illuminance_klux = [1, 10, 50, 100]
scene.lidar.pulse_energy_uj = { from = 2, to = 200, steps = 5, scale = "log" }
"""
POINTS = 200
DEMOS = ["van", "fog", "glass", "sweep", "yaw", "speed", "night", "limit"]
FRAMES = 100


def run(command: list[str]) -> tuple[float, float, float]:
    """Wall seconds, processor seconds and peak memory in MB of one process."""
    begin = time.perf_counter()
    with open(os.devnull, "w") as nothing:
        actions = [(os.POSIX_SPAWN_DUP2, nothing.fileno(), out) for out in (1, 2)]
        process = os.posix_spawn(GDTOF, [GDTOF, *command], os.environ, file_actions=actions)
    _, status, usage = os.wait4(process, 0)
    wall = time.perf_counter() - begin
    if status:
        sys.exit(f"gdtof {' '.join(command)} failed")
    return wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def job(name: str, command: list[str], runs: int, folder: str, inner: dict[str, str]) -> None:
    """Prints a line for the whole process and one for each of `inner`, keys of frame.json."""
    out = tempfile.mkdtemp(dir=folder)
    times, inside = [], {key: [] for key in inner}
    report = {}
    for _ in range(runs):
        times.append(run([*command, "--out", out]))
        if inner:
            report = json.loads(pathlib.Path(out, "frame.json").read_text())
            for key in inner:
                value = report
                for part in key.split("."):
                    value = value[part]
                inside[key].append(value)
    wall, cpu, peak = min(times)
    row(name, [t[0] for t in times], f"{cpu:.2f} s of processor time, {peak:.0f} MB")
    for key, what in inner.items():
        row(f"  of it {what}", inside[key], "")
    if report:
        work, expected = report["work"], report["photons_expected"]
        drawn = work["photons_drawn"]
        print(f"  photons drawn: {drawn} of {expected:.0f}; gdtof {' '.join(command)}")


def row(name: str, seconds: list[float], more: str) -> None:
    best, middle, worst = min(seconds), statistics.median(seconds), max(seconds)
    print(f"{name:58} {best:8.3f} {middle:8.3f} {worst:8.3f} s  {more}", flush=True)


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    print(f"{os.cpu_count()} processors; best, median and worst of {runs} runs")
    engine = {"exposure_run_time_s": "photons and engine"}
    with tempfile.TemporaryDirectory() as folder:
        probe = {"run_times.probes_s": "probe", "run_times.load_s": "load at gate level"}
        job("frame, defaults", ["frame"], runs, folder, engine | probe)
        job("street, 16 000 laser cycles, window", STREET, runs, folder, engine)
        job("the same, 1 % afterpulses and crosstalk", STREET + SECONDARIES, runs, folder, engine)
        job("the same street, cohort", [*STREET, "--engine", "cohort"], runs, folder, engine)
        drive = ["drive", "street", "--frames", str(FRAMES), "--guide", "matched"]
        job(f"drive of {FRAMES} frames, matched", drive, 1, folder, {})
        for demo in DEMOS:
            job(f"demo {demo}", ["demo", demo], runs, folder, {})
        study = pathlib.Path(folder, "study.toml")
        study.write_text(STUDY)
        wall, cpu, peak = run(["sweep", str(study), "--out", os.path.join(folder, "sweep")])
        row(f"sweep of {POINTS} cohort frames", [wall], f"{POINTS / wall:.1f} a second, {cpu:.1f} s, {peak:.0f} MB")


if __name__ == "__main__":
    main()
