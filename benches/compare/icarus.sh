#!/usr/bin/env bash
# The same netlist, stimulus and machine: Icarus Verilog against our gate engine, alone and in lanes, in one run.
# Prints run times and ratios, and checks that the histograms agree. Needs iverilog.
#
#   benches/compare/icarus.sh [LASER_CYCLES]
set -euo pipefail
cd "$(dirname "$0")/../.."
cycles=${1:-20}
periods=520
command -v iverilog >/dev/null || { echo "iverilog is not installed: nothing to compare with" >&2; exit 2; }
cargo build --release --quiet
gdtof=$PWD/target/release/gdtof
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
(cd verilog && iverilog -g2005 -o sim tb.v design.v cells.v)
theirs=$(cd verilog && seconds vvp sim)
ours=$(run 1)
cmp ours.csv verilog/histograms.csv
stimulus 64
lanes=$(run 64)
awk -v t="$theirs" -v o="$ours" -v l="$lanes" -v k="$((cycles * periods))" 'BEGIN {
    printf "%-34s %10s %22s %8s\n", "", "seconds", "macropixel-CLK/s", "ratio"
    printf "%-34s %10.3f %22.3g %8s\n", "Icarus Verilog, one macropixel", t, k / t, "1"
    printf "%-34s %10.3f %22.3g %8.1f\n", "gate engine, one macropixel", o, k / o, t / o
    printf "%-34s %10.3f %22.3g %8.1f\n", "gate engine, 64 macropixels", l, 64 * k / l, 64 * t / l
}'
