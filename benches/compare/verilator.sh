#!/usr/bin/env bash
# The same macropixels, stimulus and machine: Verilator on RTL that is written for its speed (macropixels.v) against our
# cycle engine on the netlist, logic only, in one run. Histograms must agree. Needs verilator and a C++ compiler.
#
#   benches/compare/verilator.sh [LASER_CYCLES [REPEATS]]
set -euo pipefail
cd "$(dirname "$0")/../.."
cycles=${1:-20}
repeats=${2:-3}
periods=520
command -v verilator >/dev/null || { echo "verilator is not installed: nothing to compare with" >&2; exit 2; }
here=$PWD/benches/compare
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

(cd "$work" && verilator --cc --exe --build -O3 --x-assign fast --x-initial fast --noassert --top-module macropixels \
    -Wno-WIDTH -CFLAGS "-O3 -march=native" -MAKEFLAGS "OPT_FAST=-O3" \
    --Mdir build -o sim "$here/macropixels.v" "$here/macropixels.cpp") >"$work/build.log" 2>&1 ||
    { tail -20 "$work/build.log" >&2; exit 1; }

# Best of several, turn by turn, so that both see the same neighbours.
ours=""; theirs=""; one=""
least() { awk -v a="$1" -v b="$2" 'BEGIN { print (a == "" || b < a) ? b : a }'; }
for _ in $(seq "$repeats"); do
    read -r two_threads one_thread packing < <(cargo bench --quiet --bench cycle_compare -- "$work" $periods "$cycles" 2>/dev/null)
    ours=$(least "$ours" "$two_threads"); one=$(least "$one" "$one_thread"); pack=$(least "${pack:-}" "$packing")
    theirs=$(least "$theirs" "$(cd "$work" && ./build/sim $periods "$cycles")")
    cmp "$work/ours.bin" "$work/verilator.bin"
done
awk -v t="$theirs" -v o="$ours" -v s="$one" -v p="$pack" -v k="$((4096 * cycles * periods))" -v n="$(nproc)" 'BEGIN {
    row = "%-48s %9.4f %18.3g %8.1f\n"
    printf "%-48s %9s %18s %8s\n", "64x64 macropixels, histograms equal", "seconds", "macropixel-CLK/s", "ratio"
    printf row, "Verilator, RTL as one loop over memories", t, k / t, 1
    printf row, "cycle engine, netlist, one thread", s, k / s, t / s
    printf row, "cycle engine, netlist, " n " threads", o, k / o, t / o
    printf "%-48s %9.4f\n", "(sorting photons for the cycle engine, " n " threads)", p
}'
