#!/usr/bin/env bash
# Measures anew every figure of speed that the README states, on this machine, which should be quiet: the engines by
# themselves, against Verilator and against Icarus Verilog.
#
#   benches/measure.sh [RUNS]
set -euo pipefail
cd "$(dirname "$0")/.."
runs=${1:-7}
lscpu | grep -E "Model name|^CPU\(s\)" || true
cargo build --release --quiet --bin gdtof
target/release/gdtof speed --runs "$runs"
echo
benches/compare/verilator.sh "$runs"
echo
benches/compare/icarus.sh 200 "$runs"
