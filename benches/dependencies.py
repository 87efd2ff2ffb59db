"""What direct dependencies cost to build, and why each stays: the table of docs/src/hardened.md.

    cargo build --release --timings && python3 benches/dependencies.py

Times are shares of all that `cargo build --timings` measures for dependencies: the crate's own, and with the crates that nothing else draws in.
Reasons are the comments in the manifests.
"""

import json
import re
import subprocess
import tomllib
from pathlib import Path

ROOT = Path(__file__).parent.parent
MANIFESTS = {name: ROOT / path / "Cargo.toml" for name, path in
             {"gates": "crates/gates", "light": "crates/light", "sensor": "crates/sensor", "src": "."}.items()}

metadata = json.loads(subprocess.run(["cargo", "metadata", "--format-version=1", "--locked", "--filter-platform",
                                      "x86_64-unknown-linux-gnu"], cwd=ROOT, capture_output=True, check=True).stdout)
name_of = {package["id"]: package["name"] for package in metadata["packages"]}
edges = {node["id"]: [dep["pkg"] for dep in node["deps"] if any(kind["kind"] != "dev" for kind in dep["dep_kinds"])]
         for node in metadata["resolve"]["nodes"]}
ours = set(metadata["workspace_members"])

page = max((ROOT / "target/cargo-timings").glob("*.html"), key=lambda path: path.stat().st_mtime).read_text()
units = json.loads(re.search(r"const UNIT_DATA = (\[.*?\]);\n", page, re.S)[1])
seconds = {}
for unit in units:
    seconds[unit["name"], unit["version"]] = seconds.get((unit["name"], unit["version"]), 0) + unit["duration"]
cost = {package["id"]: seconds.get((package["name"], package["version"]), 0) for package in metadata["packages"]}


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

everything = reached()
third = sum(cost[id] for id in everything - ours)
print("| crate | in | time, % | with its own, % | crates | why it stays |\n|---|---|---:|---:|---:|---|")
rows = []
for name, of in members.items():
    package = next(id for id in everything if name_of[id] == name and any(id in edges[our] for our in ours))
    alone = everything - reached(package)
    rows.append((100 * sum(cost[id] for id in alone) / third, name, of, 100 * cost[package] / third, len(alone), reasons[name]))
for total, name, of, own, count, why in sorted(rows, reverse=True):
    print(f"| `{name}` | {', '.join(of)} | {own:.1f} | {total:.1f} | {count} | {why} |")
print(f"\n{len(everything - ours)} crates, {third:.0f} s; ours {sum(cost[id] for id in ours):.0f} s.")
