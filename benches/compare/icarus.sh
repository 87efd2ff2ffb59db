#!/usr/bin/env bash
# The same netlist, stimulus and machine: Icarus Verilog against our gate engine, alone and in lanes, in one run.
# Icarus runs the exported cells, which are exact edge for edge, and cells written for its speed; ratios are
# against the latter. Histograms must agree. Whole processes are timed, start and files included: processor time,
# the best of three (of one for the exported cells, which are slow). Needs iverilog and GNU time.
#
#   benches/compare/icarus.sh [LASER_CYCLES]
set -euo pipefail
cd "$(dirname "$0")/../.."
cycles=${1:-100}
periods=520
for tool in iverilog /usr/bin/time; do
    command -v $tool >/dev/null || { echo "$tool is not installed: nothing to compare with" >&2; exit 2; }
done
cargo build --release --quiet --bin gdtof
figures=$(cargo bench --quiet --bench figures)
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
# Runs a command so many times; prints the least processor time (s) and the peak memory (MB).
measure() {
    local runs=$1; shift
    for _ in $(seq "$runs"); do
        /usr/bin/time -a -o times -f "%U %S %M" "$@" >/dev/null 2>&1
    done
    awk '{ s = $1 + $2; if (NR == 1 || s < least) least = s; if ($3 > peak) peak = $3 }
         END { printf "%.3f %.1f", least, peak / 1024 }' times
    rm times
}
ours() { # columns, more arguments
    local cols=$1; shift
    measure 3 "$gdtof" replay --rows 1 --cols "$cols" --inits inits.csv --events events.csv \
        --stop-periods $periods --laser-cycles "$cycles" --engine gate --out ours.csv "$@"
}

stimulus 1
"$gdtof" export verilog --rows 1 --cols 1 --inits inits.csv --events events.csv \
    --stop-periods $periods --laser-cycles "$cycles" --out verilog >/dev/null 2>&1
(cd verilog && iverilog -g2005 -o sim tb.v design.v cells.v && iverilog -g2005 -o lean tb.v design.v "$lean")
one=$(ours 1)
one_vcd=$(ours 1 --vcd ours.vcd)
exact=$(cd verilog && measure 1 vvp -n sim)
cmp ours.csv verilog/histograms.csv
exact_vcd=$(cd verilog && measure 1 vvp -n sim +vcd)
theirs=$(cd verilog && measure 3 vvp -n lean)
cmp ours.csv verilog/histograms.csv
theirs_vcd=$(cd verilog && measure 3 vvp -n lean +vcd)
stimulus 64
lanes=$(ours 64)
{
    printf '%s\n' "$figures"
    echo "one $one"; echo "one_vcd $one_vcd"; echo "lanes $lanes"
    echo "exact $exact"; echo "exact_vcd $exact_vcd"; echo "lean $theirs"; echo "lean_vcd $theirs_vcd"
} | awk -v k="$((cycles * periods))" '
    { v[$1] = $2; m[$1] = $3 }
    function row(name, key, pixels,   on) {
        on = key "_vcd"
        printf "%-42s %9.3f %18.3g %9.1f %9.1f %10s\n", name, v[key], pixels * k / v[key], \
            pixels * v["lean"] / v[key], m[key], (on in v) ? sprintf("%.2f", v[on] / v[key]) : "-"
    }
    END {
        printf "%-42s %9s %18s %9s %9s %10s\n", "", "CPU s", "macropixel-CLK/s", "x Icarus", "peak MB", "VCD on/off"
        row("Icarus Verilog, exported cells", "exact", 1)
        row("Icarus Verilog, cells written for speed", "lean", 1)
        row("gate engine, one macropixel", "one", 1)
        row("gate engine, 64 macropixels in lanes", "lanes", 64)
        print ""
        printf "net changes per second and core: %.1f M scalar, %.1f M in lanes\n", \
            v["scalar_changes_per_s"] / 1e6, v["lane_changes_per_s"] / 1e6
        printf "timing checks on/off: %.2f\n", v["checks_ratio"]
        for (side = 16; side <= 64; side *= 2)
            printf "elaboration of %dx%d: %.3f s, %.1f ns a cell\n", side, side, v["elaborate_" side "_s"], \
                1e9 * v["elaborate_" side "_s"] / v["cells_" side]
    }'
