#!/usr/bin/env python3
"""Direct dependencies, how many crates each alone draws in, what these take to build, and why it stays: the table of docs/robustness.md.

    python3 benches/dependencies.py

Reasons are the comments in the manifests. It builds the program for release in a folder of its own, with this file as rustc's wrapper, which
notes the processor time of every crate.
"""

import json
import os
import re
import resource
import subprocess
import sys
import tempfile
import tomllib
from collections import Counter
from pathlib import Path

if times := os.environ.get("PROCESSOR_TIMES"):
    status = subprocess.run(sys.argv[1:]).returncode
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    package = " ".join(os.environ.get(f"CARGO_PKG_{what}", "?") for what in ("NAME", "VERSION"))
    with open(times, "a") as file:
        file.write(f"{package} {used.ru_utime + used.ru_stime:.3f}\n")
    sys.exit(status)

ROOT = Path(__file__).parent.parent
MANIFESTS = {name: ROOT / path / "Cargo.toml" for name, path in
             {"gates": "crates/gates", "light": "crates/light", "scene": "crates/scene", "sensor": "crates/sensor",
              "lidar": "crates/lidar", "thesis": "crates/thesis", "src": "."}.items()}

metadata = json.loads(subprocess.run(["cargo", "metadata", "--format-version=1", "--locked", "--filter-platform",
                                      "x86_64-unknown-linux-gnu"], cwd=ROOT, capture_output=True, check=True).stdout)
name_of = {package["id"]: package["name"] for package in metadata["packages"]}
key_of = {package["id"]: f"{package['name']} {package['version']}" for package in metadata["packages"]}
edges = {node["id"]: [dep["pkg"] for dep in node["deps"] if any(kind["kind"] != "dev" for kind in dep["dep_kinds"])]
         for node in metadata["resolve"]["nodes"]}
# Without the Python package, which no command of the root builds.
ours = set(metadata["workspace_default_members"])


def processor_times():
    """Seconds by name and version of each crate, build scripts included."""
    with tempfile.TemporaryDirectory() as folder:
        times = Path(folder) / "times"
        subprocess.run(["cargo", "build", "--release", "--locked", "--quiet", "--target-dir", folder], cwd=ROOT, check=True,
                       env=os.environ | {"RUSTC_WRAPPER": str(Path(__file__).resolve()), "PROCESSOR_TIMES": str(times)})
        found = Counter()
        for line in times.read_text().splitlines():
            package, seconds = line.rsplit(" ", 1)
            found[package] += float(seconds)
        return found


def reached(without=None):
    """Crates that ours need, if they did not use one."""
    found, left = set(), list(ours)
    while left:
        package = left.pop()
        if package not in found and not (package == without):
            found.add(package)
            left += edges[package]
    return found


members, reasons = {}, {}
for member, manifest in MANIFESTS.items():
    text = manifest.read_text()
    parsed = tomllib.loads(text)
    tables = [parsed["dependencies"], *(t["dependencies"] for t in parsed.get("target", {}).values())]
    for name in sorted(set().union(*tables)):
        if not name.startswith(("guided-dtof", "femtogate")):
            members.setdefault(name, []).append(member)
            why = re.search(rf"^{name} = .*?# (.*)$", text, re.M)
            if why:
                reasons.setdefault(name, why[1])

took = processor_times()
everything = reached()
rows = []
for name, of in members.items():
    package = next(id for id in everything if name_of[id] == name and any(id in edges[our] for our in ours))
    alone = everything - reached(package)
    rows.append((sum(took[key_of[id]] for id in alone), len(alone), name, of, reasons[name]))
print("| crate | in | crates that it alone draws in, itself among them | processor time of these, s | why it stays |\n|---|---|---:|---:|---|")
for seconds, count, name, of, why in sorted(rows, key=lambda row: (-round(row[0]), row[2])):
    print(f"| `{name}` | {', '.join(of)} | {count} | {seconds:.0f} | {why} |")
total, shared = sum(took.values()), sum(took[key_of[id]] for id in everything - ours)
print(f"\n{len(everything - ours)} crates in all, without those that only tests use: {shared:.0f} s of the {total:.0f} s of the whole build.")
