#!/usr/bin/env bash
# The same macropixels, stimulus and machine, one thread each: Verilator on RTL that is written for its speed, as one loop
# over memories and bit-sliced in words of 64 and of all 4096 macropixels, against our cycle engine on the netlist.
# Histograms must agree. Processor time by a clock of nanoseconds; least, median and most of the runs; with and without
# sorting the photons by CLK edge, which either side needs. Needs verilator, a C++ compiler and Python.
#
#   benches/compare/verilator.sh [RUNS]
set -euo pipefail
cd "$(dirname "$0")/../.."
runs=${1:-5}
command -v verilator >/dev/null || { echo "verilator is not installed: nothing to compare with" >&2; exit 2; }
here=$PWD/benches/compare
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

build() { # name, file, C++ flags, Verilator's flags
    (cd "$work" && verilator --cc --exe --build -O3 --x-assign fast --x-initial fast --noassert "${@:4}" \
        --top-module macropixels -Wno-WIDTH -CFLAGS "-O3 -march=native $3" -MAKEFLAGS "OPT_FAST=-O3 OPT_SLOW=-O3" \
        --Mdir "$1" -o sim "$here/$2" "$here/verilator.cpp") >"$work/$1.log" 2>&1 ||
        { tail -20 "$work/$1.log" >&2; exit 1; }
}
build loop macropixels_loop.v ""
for width in 64 4096; do
    build $width macropixels_sliced.v -DWIDTH=$width -GWIDTH=$width --unroll-count 16
done

# Name, stimulus, STOP period and laser cycles.
compare() {
    local kind
    cargo bench --quiet --bench cycle_compare -- "$work" "$2" "$3" "$4" "$runs" >"$work/ours" 2>/dev/null
    for kind in loop 64 4096; do
        (cd "$work" && ./$kind/sim "$3" "$4" "$runs") >"$work/$kind.times"
        cmp "$work/ours.bin" "$work/theirs.bin"
    done
    python3 "$here/spread.py" "$1" $((4096 * $3 * $4)) "$work"/{loop,4096,64}.times "$work/ours"
}
python3 "$here/spread.py"
compare "street, 20 laser cycles of 520" street 520 20
compare "street, 200 laser cycles of 520" street 520 200
compare "street, 260 laser cycles of 40" street 40 260
compare "100 Mcounts/s a SPAD, 4 laser cycles of 520" bright 520 4
compare "every SPAD every CLK, 1 laser cycle of 520" every 520 1
echo "Ratios are of medians, theirs to ours. Left out by ours: control of laser cycles after the recorded one (of 1: none), CLK"
echo "periods in which no net changes. By the bit-sliced RTL: counters at rest, carries that have ended. By all: X and delays."
