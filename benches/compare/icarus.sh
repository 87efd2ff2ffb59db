#!/usr/bin/env bash
# The same netlist, stimulus and machine: Icarus Verilog against our gate engine, alone and in lanes, in one run.
# Icarus runs the exported cells, which are exact edge for edge, and cells written for its speed; ratios are
# against the latter. Histograms must agree. Whole processes are timed, start and files included. Needs iverilog.
#
#   benches/compare/icarus.sh [LASER_CYCLES]
set -euo pipefail
cd "$(dirname "$0")/../.."
cycles=${1:-20}
periods=520
command -v iverilog >/dev/null || { echo "iverilog is not installed: nothing to compare with" >&2; exit 2; }
cargo build --release --quiet
gdtof=$PWD/target/release/gdtof
lean=$PWD/benches/compare/lean_cells.v
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

# 10 Mcounts/s of background and about one signal photon in a laser cycle, in each of $1 columns.
stimulus() {
    awk -v cols="$1" -v n="$cycles" -v p="$periods" 'BEGIN {
        srand(1); t = 1e15 / 384e6 * p
        print "time_fs,row,col,spad" > "events.csv"; print "row,col,init" > "inits.csv"
        for (c = 0; c < cols; c++) {
            print "0," c "," (300 + c * 37) % 512 > "inits.csv"
            for (i = 0; i < n; i++) {
                printf "%.0f,0,%d,%d\n", (i + 0.56 + 0.004 * rand()) * t, c, rand() * 16 > "events.csv"
                for (b = -log(rand()); b < 13.5; b -= log(rand()))
                    printf "%.0f,0,%d,%d\n", (i + b / 13.5) * t, c, rand() * 16 > "events.csv"
            }
        }
    }'
}
seconds() {
    local start end
    start=$(date +%s.%N); "$@" >/dev/null 2>&1; end=$(date +%s.%N)
    awk -v a="$start" -v b="$end" 'BEGIN { print b - a }'
}
run() { # columns -> prints seconds of ours
    seconds "$gdtof" replay --rows 1 --cols "$1" --inits inits.csv --events events.csv \
        --stop-periods $periods --laser-cycles "$cycles" --engine gate --out ours.csv
}

stimulus 1
"$gdtof" export verilog --rows 1 --cols 1 --inits inits.csv --events events.csv \
    --stop-periods $periods --laser-cycles "$cycles" --out verilog >/dev/null 2>&1
(cd verilog && iverilog -g2005 -o sim tb.v design.v cells.v && iverilog -g2005 -o lean tb.v design.v "$lean")
ours=$(run 1)
exact=$(cd verilog && seconds vvp sim)
cmp ours.csv verilog/histograms.csv
theirs=$(cd verilog && seconds vvp lean)
cmp ours.csv verilog/histograms.csv
stimulus 64
lanes=$(run 64)
awk -v e="$exact" -v t="$theirs" -v o="$ours" -v l="$lanes" -v k="$((cycles * periods))" 'BEGIN {
    row = "%-42s %9.3f %18.3g %9.1f\n"
    printf "%-42s %9s %18s %9s\n", "", "seconds", "macropixel-CLK/s", "ratio"
    printf row, "Icarus Verilog, exported cells", e, k / e, t / e
    printf row, "Icarus Verilog, cells written for speed", t, k / t, 1
    printf row, "gate engine, one macropixel", o, k / o, t / o
    printf row, "gate engine, 64 macropixels in lanes", l, 64 * k / l, 64 * t / l
}'
