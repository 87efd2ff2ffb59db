"""Direct dependencies, how many crates each alone draws in, and why it stays: the table of docs/src/hardened.md.

    python3 benches/dependencies.py

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
# Without the Python package, which no command of the root builds.
ours = set(metadata["workspace_default_members"])


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
rows = []
for name, of in members.items():
    package = next(id for id in everything if name_of[id] == name and any(id in edges[our] for our in ours))
    rows.append((len(everything - reached(package)), name, of, reasons[name]))
print("| crate | in | crates that it alone draws in, itself among them | why it stays |\n|---|---|---:|---|")
for count, name, of, why in sorted(rows, key=lambda row: (-row[0], row[1])):
    print(f"| `{name}` | {', '.join(of)} | {count} | {why} |")
print(f"\n{len(everything - ours)} crates in all, without those that only tests use.")
