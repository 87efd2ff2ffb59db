#!/usr/bin/env bash
# Measures anew how fast the engines are by themselves, against Verilator and against Icarus Verilog: the figures of
# the README and of the book's chapter Performance. The machine should be quiet.
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
